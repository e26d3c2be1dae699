"""Roads under the axle: placing, datum, run-in, bounds, and the factory's refusals."""

from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.kinds.shapes import Sine
from tireroad.contact.roads.road import make_road
from tireroad.contact.roads.under_tire import (
    PreparedRoad,
    RoadUnderTire,
    lattice_of,
    make_motion,
)
from tireroad.fem.errors import InputError

STRIP = (0.1, 5.0, -0.1, 0.1)
STONES = {
    "kind": "cobblestones",
    "block_length": 0.14,
    "block_width": 0.12,
    "joint_width": 0.012,
    "joint_depth": 0.006,
}


def test_flat_is_zero_everywhere() -> None:
    road = make_road(kind="flat").prepare(*STRIP)
    x = np.linspace(-0.2, 5.0, 50)
    assert np.array_equal(road.height(x, 0 * x), np.zeros(50))
    assert road.highest(*STRIP) == road.lowest(*STRIP) == 0.0


def test_sine_with_phase_in_degrees() -> None:
    road = make_road(kind="sine", amplitude=2e-3, wavelength=0.5, phase=90.0, run_in=0.0)
    x = np.linspace(0.11, 5.0, 200)
    expected = 2e-3 * np.cos(2 * np.pi * x / 0.5)
    assert np.allclose(road.prepare(*STRIP).height(x, 0 * x), expected, atol=1e-15)


def test_start_lateral_and_offset_shift_the_road() -> None:
    x, y = np.linspace(0.0, 10.0, 11), np.linspace(-2.0, 2.0, 9)
    plane = Grid(x, y, 0.3 * x[:, None] + 0.7 * y[None, :])
    road = RoadUnderTire(plane, start=2.0, lateral=0.5, run_in=0.0, offset=0.25).prepare(*STRIP)
    px, py = np.array([0.2, 1.37, 4.9]), np.array([-0.1, 0.03, 0.1])
    expected = 0.3 * (px + 2.0) + 0.7 * (py + 0.5) + 0.25
    assert np.allclose(road.height(px, py), expected, atol=1e-14)
    assert np.allclose(road.extent, ((-2.0, 8.0), (-2.5, 1.5)))


def bump_at(place: float, first: float, **keys: object) -> RoadUnderTire:
    """A file's road over 4 m from `first` with a bump of 10 mm at x = place, without a run-in."""
    x = first + 0.01 * np.arange(401)
    z = 0.01 * np.exp(-(((x - place) / 0.03) ** 2))[:, None] * np.ones(2)
    return RoadUnderTire(Grid(x, np.array([-0.5, 0.5]), z), run_in=0.0, **keys)


def highest_at(road: PreparedRoad) -> float:
    """Distance (m) from the axle's start to the highest place of a strip."""
    x = np.linspace(0.05, road.end, 4001)
    return float(x[road.height(x, 0 * x).argmax()])


@pytest.mark.parametrize(
    ("first", "start", "found"),
    [
        (-1.0, None, 0.4),  # the file contains 0
        (0.0, None, 0.4),
        (-1.0, 0.0, 0.4),
        (-1.0, -0.8, 1.2),
        (0.2, None, 0.2),  # from its first x on
        (0.2, 0.1, 0.3),
    ],
)
def test_a_file_lies_at_its_own_x(first: float, start: float | None, found: float) -> None:
    road = bump_at(0.4, first, start=start).prepare(0.1, 1.5, -0.1, 0.1)
    assert highest_at(road) == pytest.approx(found, abs=2e-3)
    assert [n for n in road.notes if "starts at x = 0.2 m" in n] == list(road.notes)
    assert bool(road.notes) == (first > 0 and start is None)


def test_a_file_far_from_zero_starts_where_it_is_told() -> None:
    road = bump_at(101.4, 100.0, start=101.0).prepare(0.1, 1.5, -0.1, 0.1)
    assert highest_at(road) == pytest.approx(0.4, abs=2e-3)
    with pytest.raises(InputError, match=r"from x = 0\.1 to 1\.5 m, and it has 100 to 104 m"):
        bump_at(101.4, 100.0, start=0.0).prepare(0.1, 1.5, -0.1, 0.1)


@pytest.mark.parametrize("first", [-1.0, 0.0, 50.0])
def test_a_drum_repeats_a_file_from_its_first_x(first: float) -> None:
    keys = {"drum_radius": 0.5, "start": first + 0.2}
    road = bump_at(first + 1.0, first, **keys).prepare(0.1, 9.5, -0.1, 0.1)
    once = np.linspace(0.1, 3.0, 2901)
    for turn in (0.0, np.pi, 2 * np.pi):
        z = road.height(once + turn, 0 * once)
        assert once[z.argmax()] == pytest.approx(0.8, abs=2e-3)


def test_mean_datum_takes_the_strips_mean_and_nothing_else() -> None:
    x, y = np.linspace(0.0, 10.0, 11), np.linspace(-2.0, 2.0, 9)
    heights = 1.0 + 0.3 * x[:, None] + 0.7 * y[None, :]
    road = make_road_of(Grid(x, y, heights), datum="mean")
    middle = np.array([0.5 * (STRIP[0] + STRIP[1])])
    assert road.height(middle, np.zeros(1))[0] == pytest.approx(0.0, abs=1e-12)
    assert road.height(middle + 1.0, np.zeros(1))[0] == pytest.approx(0.3)


def test_longest_wave_takes_hills_out_and_leaves_the_texture() -> None:
    """ISO 16610-21: half of a wave of the cut-off length passes, far shorter ones whole."""
    x = np.arange(0.0, 40.0, 0.01)
    y = np.linspace(-1.0, 1.0, 5)
    middle = np.arange(15.0, 20.0, 0.01)
    left = {}
    for wavelength in (20.0, 2.0, 0.2):
        wave = np.sin(2 * np.pi * x / wavelength)
        grid = Grid(x, y, np.tile(wave[:, None], (1, len(y))))
        road = RoadUnderTire(grid, run_in=0.0, longest_wave=2.0).prepare(0.0, 39.0, -0.1, 0.1)
        left[wavelength] = np.abs(road.height(middle, 0 * middle)).max()
        assert road.lowest(15.0, 20.0, -0.1, 0.1) <= -left[wavelength]
        assert road.highest(15.0, 20.0, -0.1, 0.1) >= left[wavelength]
    assert left[20.0] < 0.01
    assert left[2.0] == pytest.approx(0.5, abs=0.01)
    assert left[0.2] == pytest.approx(1.0, abs=0.01)


def test_a_cut_off_far_longer_than_the_road_takes_its_mean_out_at_once() -> None:
    """The filter's weight in steps, 3e7 of them, took two minutes and 2.5 GB."""
    x, y = np.arange(0.0, 3.0, 5e-4), np.linspace(-1.0, 1.0, 5)
    wave = 1e-3 * (2.0 + np.sin(2 * np.pi * x / 0.3))
    grid = Grid(x, y, np.tile(wave[:, None], (1, len(y))))
    road = RoadUnderTire(grid, run_in=0.0, longest_wave=1e4).prepare(0.0, 2.9, -0.1, 0.1)
    middle = np.arange(0.5, 2.5, 0.01)
    mean = wave[x <= 2.9].mean()
    expected = np.interp(middle, x, wave) - mean
    np.testing.assert_allclose(road.height(middle, 0 * middle), expected, atol=2e-6)


def make_road_of(grid: Grid, datum: str) -> PreparedRoad:
    return RoadUnderTire(grid, run_in=0.0, datum=datum).prepare(*STRIP)


def test_run_in_starts_flat_and_is_twice_differentiable() -> None:
    road = RoadUnderTire(Sine(amplitude=1e-3, wavelength=0.8, phase=90.0), run_in=0.4).prepare(
        *STRIP
    )
    bare = Sine(amplitude=1e-3, wavelength=0.8, phase=90.0)
    under_the_tire = np.linspace(-0.3, 0.1, 40)
    assert np.all(road.height(under_the_tire, np.zeros(40)) == 0.0)
    beyond = np.linspace(0.5, 5.0, 100)
    assert np.array_equal(road.height(beyond, 0 * beyond), bare.height(beyond, 0 * beyond))
    h = 1e-4
    for joint in (0.1, 0.5):
        x = joint + h * np.arange(-2, 3)
        z = road.height(x, 0 * x)
        left, right = z[0] - 2 * z[1] + z[2], z[2] - 2 * z[3] + z[4]
        assert abs(left - right) / h**2 < 1e-3 * (2 * np.pi / 0.8) ** 2


@pytest.mark.parametrize("kind", ["sine", "cobblestones", "grid"])
def test_bounds_hold(kind: str) -> None:
    rng = np.random.default_rng(1)
    road = {
        "sine": make_road(kind="sine", amplitude=1e-3, wavelength=0.3),
        "cobblestones": make_road(
            kind="cobblestones",
            block_length=0.1,
            block_width=0.08,
            joint_width=0.01,
            joint_depth=0.008,
            edge_radius=0.004,
            height_scatter=0.002,
        ),
        "grid": RoadUnderTire(
            Grid(np.linspace(0, 6, 61), np.linspace(-1, 1, 21), rng.standard_normal((61, 21))),
            offset=0.3,
            datum="mean",
        ),
    }[kind].prepare(*STRIP)
    x, y = rng.uniform(-0.1, 5.0, 20_000), rng.uniform(-0.1, 0.1, 20_000)
    z = road.height(x, y)
    assert road.lowest(*STRIP) <= z.min() < 0.0 < z.max() <= road.highest(*STRIP)


def test_points_beyond_the_strip_are_an_error() -> None:
    road = make_road(kind="sine", amplitude=1e-3, wavelength=0.3).prepare(*STRIP)
    with pytest.raises(ValueError, match="beyond the prepared strip"):
        road.height(np.array([5.1]), np.zeros(1))


def test_factory_takes_a_scenes_object_and_ignores_what_is_none() -> None:
    spec = SimpleNamespace(kind="sine", amplitude=1e-3, wavelength=0.2, phase=None, datum=None)
    road = make_road(spec).prepare(*STRIP)
    assert road.spacing == 0.1  # two points a wave: the shortest length it resolves
    assert road.height(np.array([2.05]), np.zeros(1))[0] == pytest.approx(
        1e-3 * np.sin(41 / 2 * np.pi)
    )


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"kind": "gravel"}, "gravel"),
        ({"kind": "sine", "wavelenght": 1e-3}, "wavelenght does not belong to kind = sine"),
        ({"kind": "grid"}, "file is missing"),
        ({}, "kind is missing"),
        (
            {"kind": "sine", "amplitude": 1e-3, "wavelength": 0.0},
            "wavelength must be ≥ 0.001, .* not 0 m",
        ),
        ({"kind": "sine", "amplitude": -1.0, "wavelength": 1.0}, "amplitude"),
        ({**STONES, "datum": "median"}, "median"),
        ({"kind": "flat", "run_in": -1.0}, "run_in"),
        ({"kind": "crg", "file": "nowhere.crg"}, "no such file"),
        ({"kind": "grid", "file": "road.txt"}, r"\.txt"),
    ],
)
def test_factory_refuses(keys: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_road(**keys)


def test_empty_strip_is_refused() -> None:
    with pytest.raises(InputError, match="empty strip"):
        make_road(kind="flat").prepare(1.0, 0.0, -0.1, 0.1)


def test_motions() -> None:
    assert make_motion("none")(3.0) == 0.0
    ramp = make_motion("ramp", amplitude=-2e-3, duration=0.5)
    assert ramp(0.0) == 0.0 and ramp(-1.0) == 0.0
    assert ramp(0.25) == pytest.approx(-1e-3) and ramp(7.0) == -2e-3
    sine = make_motion("sine", amplitude=1e-3, frequency=50.0)
    assert sine(0.0) == 0.0 and sine(0.005) == pytest.approx(1e-3)
    for keys, message in (
        ({"kind": "hop"}, "hop"),
        ({"kind": "ramp", "duration": 0.0}, "duration must be"),
        ({"kind": "sine", "frequency": 0.0}, "frequency must be"),
    ):
        with pytest.raises(InputError, match=message):
            make_motion(**keys)


@pytest.mark.parametrize(
    "keys",
    [
        {"kind": "flat"},
        {"kind": "sine", "wavelength": 0.3, "amplitude": 1e-3},
        {"kind": "cleat", "position": 0.6, "height": 0.01, "angle": 20.0},
        STONES,
        {"kind": "iso8608", "shortest_wave": 0.01},
        {"kind": "texture", "cut_off": 0.004, "roll_off": 0.02},
        {"kind": "two-slope", "skewness": -1.0},
        {"kind": "two-slope", "longest_wave": 0.5, "lateral": 0.07, "start": -1.3},
        {"kind": "texture", "drum_radius": 0.2},
    ],
    ids=lambda keys: "-".join(str(value) for value in keys.values()),
)
def test_a_lattice_of_heights_has_their_bits(keys) -> None:
    """Over the run-in, over several tiles and chunks, in any order of x; in pieces too."""
    road = make_road(**keys).prepare(*STRIP)
    x, y = (
        np.random.default_rng(1).permutation(np.linspace(-0.2, 5.0, 900)),
        np.linspace(-0.1, 0.1, 31),
    )
    pairs = np.broadcast_arrays(x[:, None], y)
    whole = lattice_of(road, x, y)
    assert whole.shape == (900, 31) and np.array_equal(whole, road.height(*pairs))
    pieces = [lattice_of(road, part, y) for part in np.split(x, [1, 13, 400])]
    assert np.array_equal(np.concatenate(pieces), whole)
