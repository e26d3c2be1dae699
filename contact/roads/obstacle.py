"""A step, or a cleat, on an otherwise flat road, square to the rolling direction or at an angle."""

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

SHARP = 1e-3  # m: what counts as the length of an edge without a ramp


class Obstacle:
    """z = h [s((xi)/r) - s((xi - l)/r)], xi = x cos(a) + y sin(a) - position; a step ends nowhere.

    `height` h (m, may be negative: a pothole), `length` l (m) from edge to edge, infinite for a
    step, `ramp` r (m) of each edge, s the smoothstep over it (a jump for r = 0), `angle` a in
    radians between its edge and the axle, `position` (m) of its foot on the road's middle line.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(
        self, position: float, height: float, length: float, ramp: float, angle: float
    ) -> None:
        if not length > ramp >= 0.0:
            raise InputError(
                f"road: length {length:g} m must be more than ramp = {ramp:g} m, and that not negative"
            )
        if not abs(angle) < np.pi / 2:
            raise InputError("road: angle must be less than 90 degrees")
        self._position, self._height, self._length, self._ramp = position, height, length, ramp
        self._along, self._across = np.cos(angle), np.sin(angle)
        self.spacing = max(ramp, SHARP)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        xi = np.asarray(x) * self._along + np.asarray(y) * self._across - self._position
        rise = self._edge(xi)
        if np.isfinite(self._length):
            rise = rise - self._edge(xi - self._length)
        return self._height * rise

    def _edge(self, xi: Array) -> Array:
        if self._ramp == 0.0:
            return (xi > 0.0).astype(float)
        s = np.clip(xi / self._ramp, 0.0, 1.0)
        return s * s * (3.0 - 2.0 * s)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Bound of any strip, m."""
        return max(self._height, 0.0)

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Bound of any strip, m."""
        return min(self._height, 0.0)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Obstacle":
        """Nothing to prepare."""
        return self
