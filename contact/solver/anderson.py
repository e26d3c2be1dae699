"""Anderson's acceleration of a fixed point (J. ACM 12 (1965) 547)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIXED = 5  # places that are combined


class Mixed:
    """Anderson's acceleration of places p that are sought where their rest d(p) = 0: the last few are combined so that
    their rests, weighted, cancel as well as they can."""

    def __init__(self) -> None:
        self._place: list[Array] = []
        self._rest: list[Array] = []
        self._weighted: list[Array] = []

    def next(self, place: Array, rest: Array, weight: Array) -> Array:
        """The next place, from one and its rest; `weight`: what the rest is judged by."""
        self._place.append(place)
        self._rest.append(rest)
        self._weighted.append((weight * rest).sum(axis=0))
        for held in (self._place, self._rest, self._weighted):
            del held[:-MIXED]
        ahead: Array = place + rest
        if len(self._place) == 1:
            return ahead
        last = self._weighted[-1]
        apart = np.stack([last - one for one in self._weighted[:-1]], axis=1)
        share, *_ = np.linalg.lstsq(apart, last, rcond=1e-6)
        for one, p, d in zip(share, self._place[:-1], self._rest[:-1], strict=True):
            ahead = ahead - one * (place + rest - p - d)
        return ahead
