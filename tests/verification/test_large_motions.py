"""The table of `validate large`: what its errors are relative to, and roads without a state."""

import numpy as np
import pytest

from tireroad.fem.nonlinear.quasi_static import Standing
from tireroad.fem.nonlinear.road import Feature
from tireroad.tests.validation.large import NAMES, Found, bar, edge, rows


def standing(along, up):
    """Two points that share a force along and up."""
    load = np.repeat([along, 0.0, up], 2) / 2
    return Standing(np.zeros(6), load[4:], load, np.zeros(0))


def test_errors_are_of_the_rise_or_of_the_largest_force_over_the_bar():
    near, far = bar(10, 20, 0, 10), bar(10, 20, 50, 10)
    found = [
        Found(
            Feature(rise=0.01), standing(0.0, 1000.0), dict.fromkeys(NAMES, standing(0.0, 1100.0))
        ),
        Found(near, standing(-100.0, 500.0), dict.fromkeys(NAMES, standing(-80.0, 550.0))),
        Found(far, standing(-400.0, 1000.0), dict.fromkeys(NAMES)),
        Found(edge(0), None, dict.fromkeys(NAMES)),
    ]
    rise, one, other, none = rows(4000.0, found)
    assert rise[2:7] == [1000.0, 0.0, 10.0, "", 10.0]
    # 50 of 1000 N and 20 of 400 N; of the points as of their own change.
    assert one[4:6] == [5.0, 5.0]
    assert one[6] == pytest.approx(100 * np.hypot(20, 50) / np.hypot(100, 500), rel=1e-2)
    assert other[2:4] == [1000.0, -400.0]
    assert set(other[4:]) == set(none[2:]) == {""}
    assert len({len(row) for row in (rise, one, other, none)}) == 1


def test_the_edge_of_a_hole_is_where_it_says():
    road = edge(20)
    heights = road.at(np.array([0.0, 0.02, 0.05, 0.30, 0.33]), np.zeros(5)).height
    assert np.allclose(heights, [0.0, -0.015, -0.03, -0.03, 0.0])
