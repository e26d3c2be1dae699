"""Element sizes around the axle: smaller at the footprint."""

from __future__ import annotations

import numpy as np

from tireroad.fem.keys import Limits
from tireroad.fem.sections.grid import corners

SIZE = Limits(least=0.05, most=1.0)  # of elements at the footprint, relative to that elsewhere
# (from, to) rad: the footprint's element size holds up to the first, the full size from the second.
# A deflection of 20 mm reaches 0.35 rad along a ring of 0.32 m and 0.6 rad along a section of 0.1
# m.
RING_NEAR = (0.15, 1.2)
ARC_NEAR = (0.2, 1.2)


def near_road(distance: np.ndarray, footprint_size: float, near: tuple[float, float]) -> np.ndarray:
    """Relative element size at a distance (rad) from the lowest point, linear within `near`."""
    part = np.clip((distance - near[0]) / (near[1] - near[0]), 0.0, 1.0)
    return footprint_size + (1 - footprint_size) * part


def ring_corners(segments: int, footprint_size: float) -> np.ndarray:
    """Angles of the element corners, rad, from the lowest point (0) towards +x to 2 pi."""

    def density(angle: np.ndarray) -> np.ndarray:
        return 1 / near_road(np.pi - np.abs(angle - np.pi), footprint_size, RING_NEAR)

    return corners(segments, density, 0.0, 2 * np.pi)
