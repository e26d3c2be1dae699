"""The road at a contact point: smoothed over the rectangle that the point represents.

A point has one force for its rectangle, and so one height. Read at the point alone, waves shorter
than two rectangles would be aliased into long ones that the road does not have. The mean over the
rectangle reduces them to sin(k a) / (k a), at a wave number k for a half width a, but also lowers
waves of four rectangles by a tenth, and every crest: cobblestones at points 8 mm apart lost 5 % of
the mean load. Four thirds of it less a third of the mean over twice the rectangle cancels the
second-order part of that: it loses 1 % of waves of four rectangles, 15 % of those of two.
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
    end: float  # m, the largest x at which it may be evaluated

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m)."""


class CellMean:
    """Smoothed heights at c points with y (c,) m and rectangles of half sizes (c, 2) m, for any x.

    Along, the road is sampled every `spacing` at fixed positions, so that the result does not
    depend on how a run is divided; each sample counts by the part of its length within the
    rectangle. Between the positions of samples the result is a cubic through four of them, with a
    continuous slope (Catmull and Rom 1974): straight lines have steps in their slope, which all
    points pass together and the time steps fold into the band (12 dB of the longitudinal force at
    800 Hz). Across, samples are means of equal strips.
    """

    def __init__(self, road: Strip, y: Array, half: Array) -> None:
        self._road = road
        rows, self._row = np.unique(np.column_stack([y, half]), axis=0, return_inverse=True)
        self._row = self._row.reshape(-1)
        widest, broadest = half.max(axis=0)
        self._step = min(max(road.spacing, 2 * widest / MOST), widest / 4)
        self._reach = reach = int(np.ceil(2 * widest / self._step + 0.5))
        offset = self._step * np.arange(-reach, reach + 1)
        parts = [_parts(offset, self._step, share * rows[:, 1:2]) for share in (1, 2)]
        # Weights (2, r, 2 reach + 1) of samples within the rectangle's width, and twice that.
        self._weight = np.stack([4 / 3 * parts[0], -1 / 3 * parts[1]])
        count = 4 * int(np.clip(np.ceil(broadest / road.spacing), 2, MOST // 2))
        middles = (np.arange(count) + 0.5) / count * 4 - 2
        self._within = np.abs(middles) < 1
        self._y = rows[:, 0, None] + rows[:, 2, None] * middles  # (r, m)
        # Weights (2, r, m) of the slope across, by least squares over the width and twice that.
        self._across = np.zeros((2, *self._y.shape))
        for across, used in zip(self._across, (self._within, np.full(count, True)), strict=True):
            offset = np.where(used, self._y - rows[:, :1], 0.0)
            across[:] = offset / (offset**2).sum(axis=1, keepdims=True)
        self._begin, self._mean = 0, np.empty((2, len(rows), 0))

    def height(self, x: Array, _: Array) -> Array:
        """Heights (n, c) m with the points at x (n, c) m; y is known."""
        share, (mean, _across), here = self._at(x)
        return sum(w * mean[self._row, here + k] for k, w in enumerate(_cubic(share), -1))

    def slope(self, x: Array, _: Array) -> Array:
        """Slopes (n, c, 2) along and across; that along is the derivative of `height`."""
        share, (mean, across), here = self._at(x)
        along = sum(w * mean[self._row, here + k] for k, w in enumerate(_steepness(share), -1))
        near, far = across[self._row, here], across[self._row, here + 1]
        return np.stack([along / self._step, near + share * (far - near)], axis=-1)

    def _at(self, x: Array) -> tuple[Array, Array, NDArray[np.intp]]:
        """For x (n, c) m: the part of the way between two positions, means and slopes across
        (2, r, ...) at the positions, and the first one's index (n, c)."""
        place = np.asarray(x) / self._step
        first = np.floor(place).astype(int)
        begin = int(first.min(initial=0)) - 1
        known = self._known(begin, int(first.max(initial=0)) + 3)
        return place - first, known, first - self._begin

    def _known(self, begin: int, end: int) -> Array:
        """Means and slopes across (2, r, ...) at the positions from `_begin` * step to `end` * step
        at least.

        Those under the footprint are kept as it rolls on: nine of ten positions were evaluated
        before.
        """
        known = self._begin + self._mean.shape[2]
        if not self._begin <= begin <= known:
            self._mean, known = np.empty((2, len(self._y), 0)), begin
        else:
            self._mean = self._mean[:, :, begin - self._begin :]
        self._begin = begin
        if end > known:
            self._mean = np.concatenate([self._mean, self._means(known, end)], axis=2)
        return self._mean

    def _means(self, begin: int, end: int) -> Array:
        """Means (m) and slopes across (2, r, end - begin) at the positions begin * step, ..."""
        places = self._step * np.arange(begin - self._reach, end + self._reach)
        x = np.minimum(places, self._road.end)
        # Over the width and twice that; heights, and their slope across.
        sample = np.zeros((2, 2, len(self._y), len(x)))
        for k, (column, within) in enumerate(zip(self._y.T, self._within, strict=True)):
            here = self._road.height(*np.broadcast_arrays(x, column[:, None]))
            sample[1, 0] += here
            sample[1, 1] += self._across[1, :, k, None] * here
            if within:
                sample[0, 0] += here
                sample[0, 1] += self._across[0, :, k, None] * here
        sample[:, 0] /= np.array([self._within.sum(), len(self._within)])[:, None, None]
        found = np.zeros((2, len(self._y), end - begin))
        for k in range(self._weight.shape[2]):
            part = sample[:, :, :, k : k + end - begin]
            found += (self._weight[:, None, :, k, None] * part).sum(axis=0)
        return found


def _cubic(t: Array) -> tuple[Array, ...]:
    """Weights of the positions before, at, after and beyond, at a part t of the way from one to the next."""
    return (
        t * (t * (2 - t) - 1) / 2,
        (t * t * (3 * t - 5) + 2) / 2,
        t * (t * (4 - 3 * t) + 1) / 2,
        t * t * (t - 1) / 2,
    )


def _steepness(t: Array) -> tuple[Array, ...]:
    """Derivatives of those weights by t."""
    return (
        (t * (4 - 3 * t) - 1) / 2,
        t * (9 * t - 10) / 2,
        (t * (8 - 9 * t) + 1) / 2,
        t * (3 * t - 2) / 2,
    )


def _parts(offset: Array, step: float, half: Array) -> Array:
    """Fraction (r, n) of each sample's length within rectangles of half lengths (r, 1) m."""
    low, high = np.maximum(offset - step / 2, -half), np.minimum(offset + step / 2, half)
    return np.maximum(high - low, 0.0) / (2 * half)
