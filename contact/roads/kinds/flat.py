"""A flat road: every height is 0."""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.kind import EndlessRoad, road_kind

Array = NDArray[np.float64]


@road_kind("flat", "flat: all heights are 0")
class Flat(EndlessRoad):
    """Heights 0 m, endless."""

    def height(self, x: Array, y: Array) -> Array:
        """Zeros in the shape of x, m."""
        return np.zeros(np.shape(x))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0
