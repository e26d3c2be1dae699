"""A road that repeats, as on a drum, blended over a seam so that its heights are continuous."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tireroad.contact.roads.under_tire import Road

Array = NDArray[np.float64]
_SEAM = 0.1  # of the length, and at most this many metres, are blended
_LONGEST = 0.2


class Repeated:
    """h(x mod L) of a road h, whose last part b blends into the mirror image of its beginning:

        z = (1 - w) h(x) + w h(L - x),   w from 0 to 1 over L - b < x < L.

    So z is continuous and only its slope jumps, and the road is needed only over its `length` L
    (m). x counts from the first x of a measured road, and from 0 on others.
    """

    def __init__(self, road: Road, length: float) -> None:
        self._road, self._length = road, length
        self._first: float = getattr(road, "measured", (0.0, 0.0))[0]
        self._seam = min(_SEAM * length, _LONGEST)
        self.spacing = road.spacing
        self.shortest_wave: float = getattr(road, "shortest_wave", 0.0)
        self.filled: int = getattr(road, "filled", 0)
        self.notes: tuple[str, ...] = (
            *getattr(road, "notes", ()),
            f"repeats after {length:.4g} m, blended over {self._seam:.2g} m",
        )

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Endless along x, as wide as the road, m."""
        return (-np.inf, np.inf), self._road.extent[1]

    @property
    def _period(self) -> tuple[float, float]:
        """The part of the road that is needed, m."""
        return self._first, self._first + self._length

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        place = np.mod(x - self._first, self._length)
        z = self._road.height(self._first + place, y)
        share = (place - (self._length - self._seam)) / self._seam
        late = share > 0
        if late.any():
            w = share[late] ** 2 * (3.0 - 2.0 * share[late])
            back = self._first + (self._length - place[late])
            mirrored = self._road.height(back, np.asarray(y)[late])
            z = np.array(z)
            z[late] = (1.0 - w) * z[late] + w * mirrored
        return z

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of the heights anywhere along x, m."""
        return self._road.highest(*self._period, y0, y1)

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of the heights anywhere along x, m."""
        return self._road.lowest(*self._period, y0, y1)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Repeated:
        """The repeated road, with one period prepared. InputError if the road is shorter."""
        return Repeated(self._road.prepare(*self._period, y0, y1), self._length)
