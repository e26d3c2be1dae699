"""Textures: what a profile says, surfaces with a given spectrum, and lines that a laser measured."""

from collections import Counter

import numpy as np
import pytest

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.kinds.two_slope import TwoSlope
from tireroad.contact.roads.random_texture import (
    Skewed,
    Tiles,
    band_power,
    bands,
    profile_power,
    surface_density,
)
from tireroad.contact.roads.road import make_road
from tireroad.contact.roads.under_tire import (
    RoadUnderTire,
    mean_profile_depth,
    texture_of,
    third_octaves,
)
from tireroad.fem.errors import InputError

PITCH = 5e-4


def test_depth_and_level_of_a_sine() -> None:
    """Peaks of a sine of 20 mm are its amplitude; its level is that of amplitude over sqrt 2."""
    x = PITCH * np.arange(40_000)
    z = 1e-3 * np.cos(2 * np.pi * x / 0.02) + 0.01 * x + 0.3
    assert mean_profile_depth(z, PITCH) == pytest.approx(1e-3, rel=0.02)
    wavelength, level = third_octaves(z, PITCH)
    own = np.abs(wavelength / 0.02 - 1).argmin()
    assert level[own] == pytest.approx(20 * np.log10(1e-3 / np.sqrt(2) / 1e-6), abs=0.05)
    assert np.delete(level, own).max() < level[own] - 40


def test_depth_by_the_standard() -> None:
    """ISO 13473-1:2019 written anew: D.2's coefficients of the filter at 0.5 mm, there and back, and segments."""
    from scipy.signal import butter, filtfilt

    z = 1e-3 * np.cumsum(np.random.default_rng(4).standard_normal(8000)) / 30
    b, a = butter(2, 2 * 0.5 / 2.4)
    assert mean_profile_depth(z, PITCH) == pytest.approx(_depth(filtfilt(b, a, z)), rel=1e-3)
    fine = np.interp(np.arange(40_000) / 5, np.arange(8000) + 0.4, z)  # means over 0.5 mm are z
    assert mean_profile_depth(fine, PITCH / 5) == pytest.approx(
        mean_profile_depth(z, PITCH), rel=0.02
    )


def _depth(z: np.ndarray) -> float:
    depths = []
    for piece in z[: len(z) // 200 * 200].reshape(-1, 200):
        level = piece - np.polyval(np.polyfit(np.arange(200), piece, 1), np.arange(200))
        depths.append((level[:100].max() + level[100:].max()) / 2)
    return float(np.mean(depths))


def test_no_band_is_told_that_the_grid_does_not_resolve() -> None:
    """Interpolation between points 1 mm apart made 26 dB at 1.3 mm of a road cut off at 4 mm."""
    x, y = 1e-3 * np.arange(1000), 1e-3 * np.arange(5)
    z = 1e-4 * np.cos(2 * np.pi * x / 0.004)[:, None] + 0 * y
    strip = 0.05, 0.9, 1e-3, 3e-3
    texture = RoadUnderTire(Grid(x, y, z), run_in=0.0).prepare(*strip).texture
    assert 0.002 < texture.wavelength.min() < 0.003
    two = make_road(kind="two-slope", stone_size=0.004).prepare(0.0, 3.0, -1e-3, 1e-3).texture
    assert 0.004 < two.wavelength.min() < 0.006


def test_level_of_a_class_a_road_carried_on() -> None:
    """G = 16e-6 (n / 0.1)^-2: 22.7 dB at 5 mm (a^2 = 0.23 n G)."""
    power = band_power([5e-3], [22.7], np.array([200 * 10**-0.05, 200 * 10**0.05]))
    assert power[0] == pytest.approx(0.2308 * 200 * 16e-6 * 2000.0**-2, rel=0.02)


def test_flat_and_short_roads_have_no_depth() -> None:
    assert make_road(kind="flat").prepare(0.0, 5.0, -0.1, 0.1).texture is None
    assert make_road(kind="sine").prepare(0.0, 0.15, -0.1, 0.1).texture is None
    sine = make_road(kind="sine", wavelength=0.02, amplitude=1e-3).prepare(0.0, 3.0, -0.1, 0.1)
    assert sine.texture.depth == pytest.approx(1e-3, rel=0.06)


def test_profile_of_an_isotropic_surface() -> None:
    """The matrix against brute force: profiles of a discrete surface with C = 1 in one band."""
    edges = np.array([20.0, 40.0, 80.0, 160.0])
    wave = (np.arange(-2000, 2000) + 0.5) * 0.1
    for band in range(3):
        radius = np.hypot(wave[:, None], wave[None, :])
        inside = (radius >= edges[band]) & (radius < edges[band + 1])
        along = inside.sum(axis=1) * 0.1
        found = [
            along[(np.abs(wave) >= a) & (np.abs(wave) < b)].sum() * 0.1
            for a, b in zip(edges[:-1], edges[1:], strict=True)
        ]
        assert found == pytest.approx(profile_power(edges)[:, band], rel=5e-3, abs=1.0)


def test_a_spectrum_that_no_surface_has_is_met_as_near_as_can_be() -> None:
    edges = bands(0.005, 0.1)
    power = 1e-9 * np.geomspace(1e-6, 1.0, len(edges) - 1)  # falls by 60 dB towards long waves
    density = surface_density(edges, power)
    assert (density >= 0).all() and np.isfinite(density).all()
    assert (profile_power(edges) @ density)[-1] == pytest.approx(power[-1], rel=0.5)


@pytest.mark.long
def test_two_slopes_have_their_levels() -> None:
    spec = TwoSlope(seed=3, road_class="B")
    road, x = spec.make(), PITCH * np.arange(40_000)
    found = [texture_of(road.height(x, 0 * x + y), PITCH) for y in (0.0, 0.11, 0.23)]
    level = 10 * np.log10(np.mean([10 ** (t.level / 10) for t in found], axis=0))
    wavelength = found[0].wavelength
    order = np.argsort(spec.wavelengths)
    asked = np.interp(
        np.log(wavelength), np.log(np.array(spec.wavelengths))[order], np.array(spec.levels)[order]
    )
    kept = (wavelength > 0.0045) & (wavelength < 0.13)
    assert np.abs(level - asked)[kept].max() < 1.0
    assert np.abs((level - asked)[kept].mean()) < 0.4
    assert level[wavelength < 0.0033].max() < 28  # cut at the stone; kinks between places are left
    assert found[0].depth == pytest.approx(1.1e-3, abs=0.2e-3)
    assert road.lowest(0, 20, 0, 0.3) <= road.height(x, 0 * x).min()
    assert road.highest(0, 20, 0, 0.3) >= road.height(x, 0 * x).max()


def test_a_skewed_texture_keeps_mean_and_variance() -> None:
    h = np.random.default_rng(0).standard_normal(1_000_000)
    for skewness in (-1.0, -0.5, 0.8):
        z = Skewed(skewness)(h)
        assert abs(z.mean()) < 0.005 and z.var() == pytest.approx(1.0, abs=0.02)
        assert (z**3).mean() == pytest.approx(skewness, abs=0.05)
        low, high = Skewed(skewness).bounds(-3.0, 3.0)
        assert low <= Skewed(skewness)(np.linspace(-3, 3, 999)).min()
        assert high >= Skewed(skewness)(np.linspace(-3, 3, 999)).max()
    assert np.array_equal(Skewed(0.0)(h), h)


@pytest.mark.parametrize(
    ("keys", "named"),
    [
        ({"levels": (40.0,)}, "levels"),
        ({"wavelengths": (0.1, 0.1), "levels": (40.0, 41.0)}, "wavelengths"),
        ({"stone_size": 0.4}, "stone_size"),
    ],
)
def test_two_slopes_that_do_not_fit(keys, named) -> None:
    with pytest.raises(InputError, match=named):
        TwoSlope(**keys)


def test_the_road_of_a_drum_comes_again() -> None:
    """After the circumference, continuous at the seam, within its bounds; a wave that fits nowhere is blended."""
    keys = {"kind": "sine", "wavelength": 0.17, "amplitude": 1e-3, "run_in": 0.0}
    drum, plane = make_road(**keys, drum_radius=0.5), make_road(**keys)
    length = np.pi
    strip = drum.prepare(-5.0, 30.0, -0.1, 0.1)
    x = np.arange(0.0, 20.0, 1e-3)
    z = strip.height(x, 0 * x)
    assert np.allclose(z, strip.height(x + length, 0 * x), atol=1e-12)
    fine = 6 * length + np.linspace(-0.25, 0.05, 4001)
    steepest = 1e-3 * 2 * np.pi / 0.17
    assert np.abs(np.diff(strip.height(fine, 0 * fine)) / np.diff(fine)).max() < 1.5 * steepest
    assert strip.lowest(-1, 20, 0, 0) <= z.min() and z.max() <= strip.highest(-1, 20, 0, 0)
    inside = plane.prepare(-5.0, 30.0, -0.1, 0.1).height(x[:2500], 0 * x[:2500])
    assert np.allclose(z[:2500], inside, atol=1e-12)
    assert "repeats after 3.142 m" in strip.notes[-1]


def test_a_tile_is_drawn_once_while_a_footprint_passes(monkeypatch) -> None:
    """A footprint longer than three of the short waves' tiles: each step drew all of them anew."""
    drawn = []
    draw = Tiles._tile
    monkeypatch.setattr(
        Tiles, "_tile", lambda self, k: drawn.append((id(self), k)) or draw(self, k)
    )
    road = TwoSlope(stone_size=0.004).make()
    x, y = np.broadcast_arrays(np.linspace(0.0, 0.8, 81)[:, None], np.linspace(-0.05, 0.05, 5))
    for step in range(40):
        road.height(x + 0.004 * step, y)
    assert len(drawn) == len(set(drawn)) > 6


def test_levelling_and_bounds_draw_each_tile_once(monkeypatch) -> None:
    """A strip of 20 m, whose short waves have 125 halves of tiles, under all its width: what is drawn is drawn once."""
    drawn: list[tuple[float, int]] = []
    tile = Tiles._tile
    monkeypatch.setattr(
        Tiles,
        "_tile",
        lambda self, number: drawn.append((self.spacing, number)) or tile(self, number),
    )
    road = make_road(kind="two-slope", longest_wave=0.5)
    prepared = road.prepare(0.0, 20.0, -0.1, 0.1)
    levelled = Counter(drawn)
    assert len(levelled) > 100 and max(levelled.values()) == 1
    drawn.clear()
    prepared.highest(0.0, 20.0, -0.1, 0.1)
    assert len(drawn) < 0.1 * len(levelled)
