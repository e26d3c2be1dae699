"""Air squeezed out between tread and road, against volumes known in closed form."""

import numpy as np
import pytest

from tireroad.contact.results.squeezed_air import FootprintCells, squeezed
from tireroad.contact.tread.kernel import GridPlaces

NX, NY, D, SPEED = 12, 5, 4e-3, 20.0
PLACES = GridPlaces((NX, NY), (D, 2 * D), np.arange(NX * NY))
X, Y = (a.ravel() for a in np.meshgrid(D * np.arange(NX), 2 * D * np.arange(NY), indexing="ij"))


def footprint(first=2, last=8) -> FootprintCells:
    """Rows `first` to `last` touch at rest, but for the outer lines along."""
    row, column = np.divmod(np.arange(NX * NY), NY)
    held = (row >= first) & (row <= last) & (column > 0) & (column < NY - 1)
    return FootprintCells.of(PLACES, 1.0 * held)


def texture(x, waves=(0.011, 0.017, 0.03)):
    return sum(1e-3 * (1 + np.sin(2 * np.pi * x / wave)) for wave in waves)


def total(gaps, step, speed=SPEED, block=50):
    cells = footprint()
    parts = (gaps[k : k + block] for k in range(0, len(gaps), block))
    return squeezed(cells, parts, np.ones((1, len(cells.cell))), speed, step), cells


def test_a_footprint_is_filled_between_its_first_and_last_points():
    force = np.zeros(NX * NY)
    force[[3 * NY + 2, 7 * NY + 2, 5 * NY + 1]] = 1.0
    cells = FootprintCells.of(PLACES, force)
    assert cells.inside[:, 2].sum() == 5 and cells.inside[:, 1].sum() == 1
    assert cells.inside.sum() == 6 == len(cells.point)
    assert np.allclose(X[cells.ahead] - X[cells.point], D)
    assert cells.area == pytest.approx(2 * D * D)


def test_lines_in_a_groove_are_filled_as_far_as_those_beside_it():
    force = np.zeros((NX, NY))
    force[2:9, 1] = force[4:11, 3] = 1.0
    cells = FootprintCells.of(PLACES, force.ravel())
    assert np.flatnonzero(cells.inside[:, 2]).tolist() == [4, 5, 6, 7, 8]
    assert not cells.inside[:, [0, 4]].any()
    none = FootprintCells.of(PLACES, np.zeros(NX * NY))
    assert not none.inside.any() and not len(none.cell)


def test_a_pattern_passes_and_gives_off_nothing_either():
    """Grooves of 8 mm with steep flanks, which the cubic between steps would not follow: without their depth the rate is the slick's,
    and so is the mean gap of the land."""
    step = 5.6e-5
    time = step * np.arange(1, 301)[:, None]
    depth = 8e-3 * (np.mod(X + SPEED * time, 0.03) < 0.006)
    gaps = texture(X + SPEED * time) + 0 * Y
    cells = footprint()
    ones = np.ones((1, len(cells.cell)))
    slick = squeezed(cells, [gaps], ones, SPEED, step)
    found = squeezed(cells, [gaps + depth], ones, SPEED, step, [depth])
    told = squeezed(cells, [gaps + depth], ones, SPEED, step)
    assert np.allclose(found.rate, slick.rate, rtol=0, atol=1e-9 * np.abs(told.rate).max())
    assert np.abs(told.rate[20:]).max() > 100 * np.abs(found.rate[20:]).max()
    assert found.height == pytest.approx(slick.height, rel=0.05)
    assert told.height > 1.4 * slick.height


@pytest.mark.parametrize("step", [D / SPEED / 4, 4.3e-5, 5.6e-5])
def test_a_texture_that_passes_under_a_tread_gives_off_nothing(step):
    """Where a step is a whole part of the way between points to rounding; otherwise to the cubic between steps."""
    time = step * np.arange(1, 401)[:, None]
    found, cells = total(texture(X + SPEED * time) + 0 * Y, step)
    moved = texture(X + SPEED * (time + step)) - texture(X + SPEED * time)
    passing = len(cells.cell) * cells.area * np.abs(moved).max() / step
    exact = abs(D / SPEED / step - round(D / SPEED / step)) < 1e-9
    settled = found.rate[20:]
    assert np.abs(settled).max() < (1e-12 if exact else 2e-4) * passing


def test_a_tread_that_sinks_gives_off_what_it_displaces():
    step, sinking = 5.6e-5, 0.3
    time = step * np.arange(1, 301)[:, None]
    found, cells = total(texture(X + SPEED * time) + 0.1 - sinking * time, step)
    wanted = sinking * len(cells.cell) * cells.area
    # The texture's waves of 11 mm pass in ten steps: their cubic is 1 % of this off, with no mean.
    assert found.rate[20:, 0] == pytest.approx(wanted, rel=2e-2)
    assert found.rate[20:, 0].mean() == pytest.approx(wanted, rel=5e-4)
    assert found.over == pytest.approx(D / SPEED)
    # Blocks do not matter, nor does the mean gap's sum.
    other, _ = total(texture(X + SPEED * time) + 0.1 - sinking * time, step, block=7)
    assert np.allclose(other.rate, found.rate, rtol=0, atol=1e-9 * wanted)
    assert other.height == pytest.approx(found.height)


def test_a_motion_of_the_tread_is_the_mean_over_the_way_between_points():
    """u = a sin(w t): -A du/dt times sin(w T / 2) / (w T / 2), half of T late."""
    step, frequency, high = 2e-5, 900.0, 1e-4
    time, wave = step * np.arange(1, 2001), 2 * np.pi * frequency
    gaps = np.repeat(1e-3 - high * np.sin(wave * time)[:, None], NX * NY, axis=1)
    found, cells = total(gaps, step)
    late = D / SPEED
    size = len(cells.cell) * cells.area * high * wave * np.sinc(frequency * late)
    wanted = size * np.cos(wave * (time - late / 2))
    assert np.abs(found.rate[20:, 0] - wanted[20:]).max() < 1e-4 * size


def test_a_shape_that_stands_on_the_road_gives_off_what_passes_through_it():
    """g(x) at rest under a tread: A v dg/dx, the difference of the gaps at its ends."""
    step = 5.6e-5
    shape = 1e-3 * ((X - X.mean()) / X.max()) ** 2
    found, cells = total(np.repeat(shape[None], 200, axis=0), step)
    wanted = SPEED * 2 * D * (shape[cells.ahead] - shape[cells.point]).sum()
    assert found.rate[20:, 0] == pytest.approx(wanted, rel=1e-9)


def test_a_tire_at_rest_is_squeezed_by_its_own_motion_alone():
    step, sinking = 1e-4, 0.2
    gaps = np.repeat(1e-2 - sinking * step * np.arange(1, 101)[:, None], NX * NY, axis=1)
    found, cells = total(gaps, step, speed=0.0)
    assert found.rate[5:, 0] == pytest.approx(sinking * len(cells.cell) * cells.area, rel=1e-9)
    assert found.over == step


def test_steps_longer_than_the_way_between_points_are_interpolated_too():
    step, sinking = 1.5 * D / SPEED, 0.3
    gaps = np.repeat(0.1 - sinking * step * np.arange(1, 61)[:, None], NX * NY, axis=1)
    found, cells = total(gaps, step)
    assert found.rate[5:, 0] == pytest.approx(sinking * len(cells.cell) * cells.area, rel=1e-9)
