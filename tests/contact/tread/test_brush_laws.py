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
