"""Bristles look upstream, and by area they are the same on every grid."""

import numpy as np
import pytest

from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw, upstream
from tireroad.tests.reference.step import Pressed
from tireroad.tests.validation.cases import oval_patch


def test_upstream_is_linear_interpolation_on_each_line() -> None:
    x = np.array([0.0, 0.01, 0.03, 0.0, 0.02])
    line = np.array([0, 0, 0, 1, 1])
    matrix = upstream(x, line, 0.005).toarray()
    assert np.allclose(matrix @ x, [0.005, 0.015, 0.0, 0.005, 0.0])
    assert np.allclose(matrix.sum(axis=1), [1, 1, 0, 1, 0])
    assert np.array_equal(upstream(x, line, 0.0).toarray(), np.eye(5))


@pytest.mark.slow
def test_a_brush_by_area_is_the_same_on_every_grid() -> None:
    """Sticking on a rigid tire: k_A s int (way from the entry) dA, k_A s b (n p)^2/2 on each line of n points
    p long and b wide, for an ellipse k_A s 8/3 a^2 b; by points it grows."""
    slip, per_area, forces, lines = 2e-3, 5e7, {"area": [], "point": []}, []
    for fine in (1, 4, 8):
        patch = oval_patch((9 * fine, 7 * fine), (0.015 / fine, 0.02 / fine), 500.0)
        touching = patch.force > 0
        for kind, stiffness in (("area", per_area * patch.area), ("point", 1e4)):
            law = BrushLaw(stiffness, None, (slip, 0.0))
            brush = Brush(law, patch.points[:, 0], patch.line, 20.0, 1e-4 / fine)
            brush.begin(touching)
            c = len(patch.points)
            # Rigid: no forces move anything.
            friction = BrushFriction(brush, np.zeros((3 * c, 3 * c)), None, tolerance=1e-12)
            gap, none = np.where(touching, 0.0, 1.0), np.zeros(2 * c)
            for _ in range(200 * fine):
                friction.solve(Pressed(), gap, touching, patch.force, none)
            force = (np.reshape(law.stiffness, (-1, 1)) * -brush.deflection).sum(axis=0)
            a, b = 0.6 * patch.points[:, :2].max(axis=0)
            exact = per_area * slip * 8 / 3 * a**2 * b
            forces[kind].append(abs(float(force[0])) / exact)
        long, wide = 2 * patch.half_sizes[0]
        own = sum((long * touching[patch.line == k].sum()) ** 2 / 2 for k in np.unique(patch.line))
        lines.append(per_area * slip * wide * own / exact)
    assert forces["area"] == pytest.approx(lines, rel=1e-6)
    assert forces["area"][-1] == pytest.approx(1.0, abs=0.02)
    assert forces["point"][-1] / forces["point"][0] > 30.0


def _rolled(touching, free, step: float) -> np.ndarray:
    """Deflections (n, c) along a line of points 1 cm apart that `touching` (n, c) presses on the road, `free` (n,) m displaced along
    it, of a rigid tire at 10 m/s."""
    n, c = touching.shape
    law = BrushLaw(1e4, None)
    brush = Brush(law, 0.01 * np.arange(c), np.zeros(c, int), 10.0, step)
    brush.begin(touching[0])
    friction = BrushFriction(brush, np.zeros((3 * c, 3 * c)), None, tolerance=1e-12)
    found = np.zeros((n, c))
    for k in range(n):
        pressed, moved = 100.0 * touching[k], np.zeros(2 * c)
        moved[:c] = free[k]
        friction.solve(Pressed(), np.where(touching[k], 0.0, 1.0), touching[k], pressed, moved)
        found[k] = brush.deflection[:, 0]
    return found


@pytest.mark.parametrize("step", [1e-3, 3e-4, 1.1e-4, 2e-5])
def test_what_adheres_is_carried_through_the_footprint_unspread(step: float) -> None:
    """The base is displaced by 1 mm for 4 ms: the 4 cm of tread that enter then stay behind by 1 mm, to the end of 30 points."""
    c, n = 30, round(0.06 / step)
    time = step * np.arange(1, n + 1)
    shifted = (time > 0.0205) & (time <= 0.0245)
    e = _rolled(np.ones((n, c), bool), 1e-3 * shifted, step)
    # At the end of the line, 29.5 cm behind the edge, what entered passes 29.5 ms later.
    last = -e[:, 0]
    assert last[time > 0.0245].max() == pytest.approx(1e-3, rel=1e-9)
    later = time > 0.03
    assert last[later].sum() * step == pytest.approx(4e-6, abs=1.2 * step * 1e-3)
    centre = (time * last)[later].sum() / last[later].sum()
    assert centre == pytest.approx(0.0225 + 0.0295, abs=1.5 * step)
    width = np.sqrt(((time - centre) ** 2 * last)[later].sum() / last[later].sum())
    # Uniform over 4 ms, in the mean of a cell that takes 1 ms to pass.
    assert width == pytest.approx(np.sqrt((0.004**2 + 0.001**2) / 12), abs=0.5 * step)


@pytest.mark.parametrize("step", [1e-4, 3e-5])
def test_what_adheres_to_an_asperity_goes_with_it(step: float) -> None:
    """An asperity 2 cm long moves through 12 points with the tread; the base is displaced more and more: so are bristles from where
    they came to stand on, while the points that touch change."""
    c, n = 12, round(0.009 / step)
    time = step * np.arange(1, n + 1)
    middle = 0.1 - 10.0 * time
    touching = np.abs(0.01 * np.arange(c) - middle[:, None]) < 0.01
    e = _rolled(touching, 1e-3 * time / 0.01, step)
    begun = step  # the end of the step in which it is touched
    some = touching[1:]
    expected = np.broadcast_to(1e-3 * (time - begun)[:, None] / 0.01, touching.shape)
    # At the ends of the asperity bristles come to stand until it has gone on by one point.
    assert np.abs(e[1:] - expected[1:])[some].max() < 0.06 * expected.max()
