"""A flat road: every height is 0."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Flat:
    """Heights 0 m, endless."""

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))
    spacing = np.inf

    def height(self, x: Array, y: Array) -> Array:
        """Zeros in the shape of x, m."""
        return np.zeros(np.shape(x))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Flat":
        """Nothing to prepare."""
        return self
