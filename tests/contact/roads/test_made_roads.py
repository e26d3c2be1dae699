"""Steps, cleats, ISO 8608 profiles and textures: heights, spectra, bounds, memory."""

import tracemalloc

import numpy as np
import pytest
from scipy import signal

from tireroad.contact.roads.kinds.iso8608 import CHUNK, CLASSES, Iso8608
from tireroad.contact.roads.kinds.shapes import Cleat
from tireroad.contact.roads.kinds.texture import TextureRoad
from tireroad.contact.roads.road import make_road
from tireroad.fem.errors import InputError


def test_cleat_and_step() -> None:
    x = np.array([0.29, 0.31, 0.33, 0.35, 0.40, 0.41, 0.44])
    zero = np.zeros(len(x))
    cleat = make_road(kind="cleat", position=0.3, height=0.01, length=0.1, ramp=0.02, angle=0.0)
    assert np.allclose(cleat.road.height(x, zero), [0, 0.005, 0.01, 0.01, 0.01, 0.005, 0])
    step = make_road(kind="step", position=0.3, height=-0.02, ramp=0.0, angle=30.0)
    assert np.allclose(step.road.height(x, zero) / -0.02, [0, 1, 1, 1, 1, 1, 1])
    # At 30 degrees the edge is met 0.1 tan(30) later 0.1 m to the right.
    edge = 0.3 + 0.1 * np.tan(np.pi / 6)
    side = np.array([-0.1, -0.1])
    assert np.array_equal(step.road.height(edge + np.array([-1e-9, 1e-9]), side), [0.0, -0.02])
    assert (step.road.highest(0, 1, 0, 1), step.road.lowest(0, 1, 0, 1)) == (0.0, -0.02)
    with pytest.raises(InputError, match="ramp"):
        Cleat(length=0.02, ramp=0.03)


@pytest.mark.parametrize("kind", ["step", "cleat"])
@pytest.mark.parametrize("angle", [-60.0, 0.0, 45.0])
def test_an_oblique_edge_begins_at_its_position(kind: str, angle: float) -> None:
    road = make_road(kind=kind, position=0.5, height=0.01, ramp=1e-4, angle=angle).road
    x = np.linspace(0.3, 0.7, 40001)
    begun = [float(x[road.height(x, np.full(len(x), y)).argmax()]) for y in (-0.05, 0.0, 0.05)]
    right, middle, left = begun
    assert middle == pytest.approx(0.5, abs=3e-4)
    # Positive angles: the left side is met first.
    assert right - left == pytest.approx(0.1 * np.tan(np.radians(angle)), abs=3e-5)


@pytest.mark.parametrize("ramp", [0.0, 0.01])
@pytest.mark.parametrize("length", [0.05, None])
@pytest.mark.parametrize("height", [0.01, -0.02])
def test_bounds_of_an_obstacle_are_those_of_the_strip(ramp, length, height) -> None:
    kind = {"kind": "step"} if length is None else {"kind": "cleat", "length": length}
    road = make_road(**kind, position=0.5, height=height, ramp=ramp, angle=30.0).road
    for x0 in np.arange(0.3, 0.7, 0.013):
        for long in (0.004, 0.1):
            strip = x0, x0 + long, -0.05, 0.05
            x, y = np.meshgrid(np.linspace(*strip[:2], 201), np.linspace(*strip[2:], 101))
            z, bounds = road.height(x, y), (road.lowest(*strip), road.highest(*strip))
            assert bounds[0] <= z.min() + 1e-12 and z.max() - 1e-12 <= bounds[1]
            assert np.ptp(bounds) < 1e-12 or np.ptp(z) > 0.0
    assert road.highest(0.0, 0.4, -0.05, 0.05) == road.lowest(0.0, 0.4, -0.05, 0.05) == 0.0


@pytest.mark.slow
def test_iso8608_has_its_class_spectrum() -> None:
    pitch = 0.05
    x = pitch * np.arange(200_000)
    z = Iso8608(road_class="C", shortest_wave=0.5, seed=3).make().height(x, 0 * x)
    frequency, density = signal.welch(z, 1 / pitch, nperseg=8192)
    for low, high in ((0.02, 0.1), (0.1, 0.5), (0.5, 1.8)):
        band = (frequency >= low) & (frequency < high)
        expected = CLASSES["C"] * (frequency[band] / 0.1) ** -2
        assert (density[band] / expected).mean() == pytest.approx(1.0, abs=0.2)
    assert density[frequency > 2.5].max() < 1e-6 * density.max()


def test_iso8608_is_smooth_repeatable_and_bounded() -> None:
    road, again = (Iso8608(road_class="D", seed=5).make() for _ in range(2))
    seam = CHUNK * 0.1 / 16
    x = seam + np.linspace(-1e-3, 1e-3, 2001)
    z = road.height(x, 0 * x)
    assert np.abs(np.diff(z, 2)).max() < 1e-9
    exact = np.cos(np.outer(x, road._wavenumber) + road._phase) @ road._amplitude
    assert np.abs(z - exact).max() < 1e-2 * road._amplitude[-1]
    assert np.array_equal(z, again.height(x, 0 * x))
    assert not np.allclose(z, Iso8608(road_class="D", seed=6).make().height(x, 0 * x))
    far = np.linspace(3.0, 40.0, 50001)
    heights = road.height(far, 0 * far)
    assert road.lowest(3, 40, 0, 0) <= heights.min() and heights.max() <= road.highest(3, 40, 0, 0)
    assert road.highest(3, 40, 0, 0) < heights.max() + 1e-3


@pytest.mark.slow
def test_ten_kilometres_take_no_more_memory_than_ten_metres() -> None:
    road = Iso8608(road_class="C", shortest_wave=0.5).make()
    patch = np.linspace(-0.1, 0.1, 50)
    road.height(patch, patch)
    tracemalloc.start()
    for way in np.arange(0.0, 10_000.0, 20.0):
        road.height(way + patch, patch)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 60e6


def test_texture_spectrum() -> None:
    road = TextureRoad(roll_off=0.02, cut_off=0.002, seed=1).make()
    tile = road._tile(3)
    assert tile.std() == pytest.approx(2e-4)
    assert abs(tile.mean()) < 1e-12
    power = np.abs(np.fft.fft2(tile)) ** 2
    pitch = 0.0005
    q = np.hypot(
        *(
            np.fft.fftfreq(n, pitch)[s]
            for n, s in zip(tile.shape, ((slice(None), None), (None, slice(None))), strict=True)
        )
    )
    inner, outer = (q > 60) & (q < 80), (q > 300) & (q < 400)
    slope = np.log(power[outer].mean() / power[inner].mean()) / np.log(350 / 70)
    assert slope == pytest.approx(-3.6, abs=0.15)
    assert power[(q > 510) | ((q < 49) & (q > 0))].max() < 1e-20 * power.max()
    with pytest.raises(InputError, match="cut_off"):
        TextureRoad(roll_off=1.0, cut_off=1e-5)


@pytest.mark.slow
def test_texture_is_continuous_repeatable_and_bounded() -> None:
    road, again = (TextureRoad(roll_off=0.02, cut_off=0.002, seed=1).make() for _ in range(2))
    half = 0.16
    for seam in (-half, 0.0, 3 * half):
        x = seam + np.array([-1e-9, 1e-9])
        assert np.ptp(road.height(x, 0.013 + 0 * x)) < 1e-9
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 5000))
    z = road.height(x, y)
    assert np.array_equal(z[::-1], again.height(x[::-1], y[::-1]))
    assert road.lowest(-1, 1, -1, 1) <= z.min() and z.max() <= road.highest(-1, 1, -1, 1)


@pytest.mark.slow
def test_texture_never_repeats_and_keeps_its_variance_along() -> None:
    """The mean over many places of z(x) z(x + lag) is near 0 at every lag, that of z z near rms²."""
    road = TextureRoad(roll_off=0.02, cut_off=0.002, seed=1).make()
    pitch = 0.0005
    x = pitch * np.arange(round(8.0 / pitch))
    rows = road.height(*np.broadcast_arrays(x, 0.029 * np.arange(20)[:, None])) / 2e-4
    assert rows.var() == pytest.approx(1.0, abs=0.03)
    # Where two tiles weigh the same, and where one weighs all.
    for place in (0.0, 0.08):
        here = np.abs(np.mod(x - place + 0.08, 0.16) - 0.08) < 0.01
        assert rows[:, here].var() == pytest.approx(1.0, abs=0.12)
    spectrum = np.abs(np.fft.rfft(rows, 2 * len(x), axis=1)) ** 2
    correlation = np.fft.irfft(spectrum.mean(axis=0))[: len(x) // 2] / len(x)
    assert np.abs(correlation[round(0.1 / pitch) :]).max() < 0.15


def test_the_share_of_its_height_that_the_run_in_leaves() -> None:
    """A cleat within it is met lower: a tenth of its force, without a word."""
    cleat = make_road(kind="cleat", height=2e-3, position=0.13, run_in=0.1, start=0.02)
    road = cleat.prepare(0.08, 1.0, -0.1, 0.1)
    top = 0.14  # of the cleat, along the road itself
    assert road.share(top) == pytest.approx(road.height(np.array([0.12]), np.zeros(1))[0] / 2e-3)
    assert 0 < road.share(top) < 0.5 and road.share(0.05) == 0.0 and road.share(0.21) == 1.0
