"""Spacing of the companion's points: half where that is affordable or nothing else tells, else twice."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.contact.grid_patch import ACROSS, MOST, ratio
from tireroad.contact.tread.kernel import GridPlaces
from tireroad.tests.validation.cases import oval_patch


def footprint(long: int, wide: int, lost: int = 0):
    """A grid of points that all touch but `lost` ones at its end."""
    patch = oval_patch((long, wide), (0.005, 0.005), 500.0)
    force = np.ones(long * wide)
    force[len(force) - lost :] = 0.0
    places = GridPlaces((long, wide), (0.005, 0.005), np.arange(long * wide))
    return replace(patch, force=force, places=places)


@pytest.mark.parametrize(
    ("size", "lost", "expected"),
    [
        ((10, 25), 0, 0.5),  # 1000 points with half the spacing
        ((10, 26), 10, 0.5),
        ((10, 26), 9, 2.0),
        ((60, ACROSS), 0, 2.0),
        ((60, ACROSS - 1), 0, 0.5),
    ],
)
def test_ratio(size: tuple[int, int], lost: int, expected: float) -> None:
    assert MOST == 1000
    assert ratio(footprint(*size, lost)) == expected


def test_a_curved_road_has_coarser_points() -> None:
    patch = footprint(10, 10)
    assert ratio(replace(patch, frames=np.zeros((100, 3, 3)))) == 2.0
    assert ratio(replace(patch, places=None)) == 2.0
