"""The road as a contact point meets it: its mean over the rectangle that the point stands for.

A point has one force for its rectangle, and so one height. Read at the point alone, waves shorter than two
rectangles would fold back into long ones that the road does not have; the mean holds next to nothing of them:
sin(k a) / (k a) of a wave number k for a half width a, along and across.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST = 32  # samples along a rectangle, and across it


class Strip(Protocol):
    """A road cut out for a run, as contact.roads.under_tire.PreparedRoad."""

    spacing: float  # m, the shortest length it resolves
    end: float  # m, the farthest x it may be asked for

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m)."""


class CellMean:
    """Of c points, at their y (c,) m, with rectangles of half sizes (c, 2) m; x as asked for.

    Along, the road is sampled every `spacing`, at the same places whatever is asked for, so that the answer does
    not depend on how a run is cut into pieces; each sample counts by the part of its length within the rectangle, and
    between the places of samples the mean is linear. Across, samples are means of equal strips.
    """

    def __init__(self, road: Strip, y: Array, half: Array) -> None:
        self._road = road
        rows, self._row = np.unique(np.column_stack([y, half]), axis=0, return_inverse=True)
        self._row = self._row.reshape(-1)
        widest = float(half[:, 0].max())
        self._step = max(road.spacing, 2 * widest / MOST)
        reach = int(np.ceil(widest / self._step + 0.5))
        offset = self._step * np.arange(-reach, reach + 1)
        low = np.maximum(offset - self._step / 2, -rows[:, 1:2])
        high = np.minimum(offset + self._step / 2, rows[:, 1:2])
        self._weight = np.maximum(high - low, 0.0) / (2 * rows[:, 1:2])  # (r, 2 reach + 1)
        count = int(np.clip(np.ceil(2 * rows[:, 2].max() / road.spacing), 1, MOST))
        middles = (np.arange(count) + 0.5) / count * 2 - 1
        self._y = rows[:, 0, None] + rows[:, 2, None] * middles  # (r, m)
        self._reach = reach

    def height(self, x: Array, _: Array) -> Array:
        """Mean heights (n, c) m with the points at x (n, c) m; y is known."""
        place = np.asarray(x) / self._step
        first = np.floor(place).astype(int)
        share = place - first
        begin = int(first.min(initial=0))
        mean = self._means(begin, int(first.max(initial=0)) + 2)
        here = first - begin
        near, far = mean[self._row, here], mean[self._row, here + 1]
        return near + share * (far - near)

    def _means(self, begin: int, end: int) -> Array:
        """(r, end - begin) m at the places begin * step, …"""
        places = self._step * np.arange(begin - self._reach, end + self._reach)
        x = np.minimum(places, self._road.end)
        sample = np.zeros((len(self._y), len(x)))
        for column in self._y.T:
            sample += self._road.height(*np.broadcast_arrays(x, column[:, None]))
        sample /= self._y.shape[1]
        mean = np.zeros((len(self._y), end - begin))
        for k, weight in enumerate(self._weight.T):
            mean += weight[:, None] * sample[:, k : k + end - begin]
        return mean
