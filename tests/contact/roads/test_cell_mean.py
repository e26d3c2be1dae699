"""The road under a point is smoothed over the point's rectangle: in closed form, and without aliases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from reference.cell_mean import smoothed

from tireroad.contact.roads.cell_mean import CellMean
from tireroad.contact.roads.road import make_road

HALF = np.array([[2e-3, 1e-3]])


@dataclass
class Wave:
    """cos(2 pi (x / length + y / across)) of 1 m."""

    length: float
    across: float = np.inf
    spacing: float = 2.5e-4
    end: float = 10.0

    def height(self, x, y):
        return np.cos(2 * np.pi * (x / self.length + y / self.across))


def mean(road, x, y=0.0, half=HALF):
    return CellMean(road, np.full(1, y), half).height(np.atleast_1d(x)[:, None])[:, 0]


def left(half, length, across=np.inf):
    """What is left of a wave: four thirds of its mean over the rectangle less a third of that over twice it."""
    one, two = (
        np.sinc(2 * k * half[0] / length) * np.sinc(2 * k * half[1] / across) for k in (1, 2)
    )
    return 4 / 3 * one - 1 / 3 * two


@pytest.mark.parametrize("length", [5e-3, 0.02, 0.2])
def test_a_wave_is_lowered_by_its_means(length) -> None:
    x = np.linspace(0.1, 0.13, 50)
    expected = left(HALF[0], length) * Wave(length).height(x, 0.0)
    np.testing.assert_allclose(mean(Wave(length), x), expected, atol=8e-3)
    expected = left(HALF[0], length, 8e-3) * Wave(length, 8e-3).height(x, 3e-3)
    np.testing.assert_allclose(mean(Wave(length, 8e-3), x, 3e-3), expected, atol=8e-3)


def test_waves_of_four_rectangles_and_more_stay() -> None:
    """To second order in the rectangle: a mean would take a tenth of one of four, this 1.2 % (1.7 as sampled), and 0.1 % of eight."""
    x = np.linspace(0.1, 0.13, 50)
    for count, lost in ((4, 0.016), (8, 2e-3)):
        wave = Wave(count * 4e-3, spacing=count * 2e-3)
        assert abs(mean(wave, x) - wave.height(x, 0.0)).max() == pytest.approx(lost, abs=lost / 2)


def test_a_slope_and_a_flat_road_stay_as_they_are() -> None:
    class Slope(Wave):
        def height(self, x, y):
            return 0.1 * x - 0.2 * y + 0.03

    x = np.linspace(0.1, 0.4, 7)
    np.testing.assert_allclose(mean(Slope(1.0), x, 0.01), 0.1 * x - 0.002 + 0.03, atol=1e-12)


def test_the_answer_does_not_depend_on_how_a_run_is_cut() -> None:
    """The same bits, alone or in a block: a loop that goes on finds the same road."""
    road = CellMean(Wave(7e-3), np.array([0.0, 1e-3]), np.repeat(HALF, 2, axis=0))
    x = np.linspace(0.1, 0.2, 64)[:, None] + [0.0, 3e-3]
    whole = road.height(x)
    alone = np.concatenate([road.height(row[None], None) for row in x])
    assert (whole == alone).all()


def test_points_of_other_sizes_have_means_of_their_own() -> None:
    half = np.array([[2e-3, 1e-3], [1e-3, 1e-3]])
    x = np.full((1, 2), 0.1)
    found = CellMean(Wave(0.01), np.zeros(2), half).height(x)[0]
    np.testing.assert_allclose(found, [left(one, 0.01) for one in half], atol=3e-3)


def test_a_strip_ends_where_it_was_cut() -> None:
    class Cut(Wave):
        def height(self, x, y):
            assert x.max() <= self.end
            return super().height(x, y)

    assert np.isfinite(mean(Cut(0.05), 9.9995)).all()


def test_waves_that_points_cannot_tell_are_gone() -> None:
    """Points 4 mm apart take a wave of 4.1 mm for one of 164 mm; of what they are given 4 % of it are left."""
    x = 4e-3 * np.arange(41)
    wave = Wave(4.1e-3)
    means = CellMean(wave, np.zeros(41), np.repeat(HALF, 41, axis=0)).height(x[None])[0]
    false = np.exp(-2j * np.pi * x / 0.164)
    assert 2 * abs(false @ wave.height(x, 0.0)) / 41 == pytest.approx(1.0, abs=0.05)
    assert 2 * abs(false @ means) / 41 < 0.045


def test_what_a_footprint_was_over_is_asked_for_once_and_to_the_last_bit() -> None:
    """Rolled on, back and away: the same bits as from the beginning; rolled on, as much road as is new."""
    asked = []

    class Counted(Wave):
        def height(self, x, y):
            asked.append(np.shape(x)[1])
            return super().height(x, y)

    patch = np.linspace(0.0, 0.2, 50)
    kept = CellMean(Counted(0.013), np.zeros(50), np.tile(HALF, (50, 1)))
    spent = []
    for start in (0.1, 0.11, 0.12, 0.115, 0.3, 5.0):
        asked.clear()
        x = start + patch[None]
        found = kept.height(x)
        spent.append(sum(asked))
        fresh = CellMean(Wave(0.013), np.zeros(50), np.tile(HALF, (50, 1)))
        assert np.array_equal(found, fresh.height(x, None))
    assert spent[1] < 0.15 * spent[0] and spent[2] == pytest.approx(spent[1], rel=0.02)


@pytest.mark.parametrize("length", [0.012, 0.02, 0.1])
def test_the_slope_has_no_steps(length) -> None:
    """As points and time steps meet it: straight lines between positions of 0.5 mm were off by 8 % at 20 mm."""
    x = 0.1 + 22.05 * 5.6e-5 * np.arange(200)
    road = CellMean(Wave(length), np.zeros(1), HALF)
    slope = road.slope(x[:, None])[:, 0, 0]
    k = 2 * np.pi / length
    exact = -k * left(HALF[0], length) * np.sin(k * x)
    # What is sampled is lowered a little more; that is no step.
    kept = slope @ exact / (exact @ exact)
    assert kept == pytest.approx(1.0, abs=0.03)
    assert np.abs(slope - kept * exact).max() < 0.01 * k


@pytest.mark.parametrize(
    "road", [{"kind": "two-slope", "seed": 3}, {"kind": "cobblestones", "run_in": 0.0}]
)
@pytest.mark.parametrize("scatter", [0.0, 1e-3])
def test_what_is_compiled_agrees_with_plain_numpy(road, scatter) -> None:
    """Lines that share their strips and lines that do not, of several sizes, up to the end of the strip."""
    rough = np.random.default_rng(1)
    y = np.repeat([-0.01, 0.0, 0.01, 0.02], 3) + scatter * rough.standard_normal(12)
    half = np.tile([[0.005, 0.005], [0.004, 0.005], [0.005, 0.003]], (4, 1))
    prepared = make_road(**road).prepare(0.0, 0.5, -0.1, 0.1)
    x = np.sort(rough.uniform(0.05, 0.5, (20, 12)), axis=0)
    height, slope = smoothed(prepared, y, half, x)
    mean = CellMean(prepared, y, half)
    assert np.abs(mean.height(x, y) - height).max() < 1e-12 * np.abs(height).max()
    assert np.abs(mean.slope(x, y) - slope).max() < 1e-11 * np.abs(slope).max()


def test_lines_beside_each_other_share_their_strips() -> None:
    """Half of those of a line lie on half of its neighbour's."""
    asked = []

    class Counted(Wave):
        def height(self, x, y):
            asked.append(len(np.unique(y)))
            return super().height(x, y)

    y = 0.1 + 2e-3 * np.arange(20)
    CellMean(Counted(0.01), y, np.repeat(HALF, 20, axis=0)).height(np.full((1, 20), 0.1))
    CellMean(Counted(0.01), y[:1], HALF).height(np.full((1, 1), 0.1))
    shared, alone = asked
    assert shared == alone + 19 * alone / 2
