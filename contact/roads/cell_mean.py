"""The road at a contact point: smoothed over the rectangle that the point represents.

A point has one force for its rectangle, and so one height. Read at the point alone, waves shorter
than two rectangles would be aliased into long ones that the road does not have. The mean over the
rectangle reduces them to sin(k a) / (k a), at a wave number k for a half width a, but also lowers
waves of four rectangles by a tenth, and every crest: cobblestones at points 8 mm apart lost 5 % of
the mean load. Four thirds of it less a third of the mean over twice the rectangle cancels the
second-order part of that: it loses 1 % of waves of four rectangles, 15 % of those of two.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.under_tire import lattice_of
from tireroad.fem.compiled import library

Array = NDArray[np.float64]
COMPILED = library(Path(__file__).with_suffix(".c"))
MOST = 32  # samples along a rectangle, and across it
_SAME = 1e-12  # of the widest rectangle: strips of lines beside each other that lie so near are one


class Strip(Protocol):
    """A road cut out for a run, as contact.roads.under_tire.PreparedRoad."""

    spacing: float  # m, the shortest length it resolves
    end: float  # m, the largest x at which it may be evaluated

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m)."""


class CellMean:
    """Smoothed heights at c points with y (c,) m and rectangles of half sizes (c, 2) m, for any x and, by the slope, beside y.

    Along, the road is sampled every `spacing` at fixed positions, so that the result does not
    depend on how a run is divided; each sample counts by the part of its length within the
    rectangle. Between the positions of samples the result is a cubic through four of them, with a
    continuous slope (Catmull and Rom 1974): straight lines have steps in their slope, which all
    points pass together and the time steps fold into the band (12 dB of the longitudinal force at
    800 Hz). Across, samples are means of equal strips, shared by lines of points beside each other.
    Compiled (cell_mean.c). Not collective.
    """

    def __init__(self, road: Strip, y: Array, half: Array) -> None:
        self._road = road
        rows, row = np.unique(np.column_stack([y, half]), axis=0, return_inverse=True)
        widest, broadest = half.max(axis=0)
        self._points_y = y
        self._step = min(max(road.spacing, 2 * widest / MOST), widest / 4)
        self._reach = reach = int(np.ceil(2 * widest / self._step + 0.5))
        offset = self._step * np.arange(-reach, reach + 1)
        parts = [_parts(offset, self._step, share * rows[:, 1:2]) for share in (1, 2)]
        # Weights (2, 2 reach + 1, r) of samples within the rectangle's width, and twice that.
        along = np.stack([4 / 3 * parts[0].T, -1 / 3 * parts[1].T])
        count = 4 * int(np.clip(np.ceil(broadest / road.spacing), 2, MOST // 2))
        middles = (np.arange(count) + 0.5) / count * 4 - 2
        lines = rows[:, 0] + rows[:, 2] * middles[:, None]  # (m, r)
        self._y, column = _distinct(lines, _SAME * float(broadest))
        across = _across(lines - rows[:, 0], np.abs(middles) < 1)
        arrays = {"along": np.ascontiguousarray(along), "across": across}
        indices = {"column": column.astype(np.int32), "line": row.reshape(-1).astype(np.int32)}
        self._held: dict[str, Any] = {name: COMPILED.doubles(of) for name, of in arrays.items()}
        self._held |= {name: COMPILED.ints(of) for name, of in indices.items()}
        sizes = {"lines": len(rows), "strips": count, "reach": reach, "step": self._step}
        self._rectangles = COMPILED.ffi.new("rectangles *", self._held | sizes)
        # What is known: sums over the strips at the positions from begin - reach on, and means from begin on.
        self._begin, self._sums, self._means = 0, *_nothing(len(rows))

    def height(self, x: Array, y: Array | None = None) -> Array:
        """Heights (n, c) m with the points at x, y (n, c) m; None: each at its own y."""
        height = self._at(x, COMPILED.lib.heights_at, ())
        aside = None if y is None else y - self._points_y
        return (
            height if aside is None or not aside.any() else height + aside * self.slope(x)[..., 1]
        )

    def slope(self, x: Array, _: Array | None = None) -> Array:
        """Slopes (n, c, 2) along and across, at each point's own y; that along is the derivative of `height` there."""
        return self._at(x, COMPILED.lib.slopes_at, (2,))

    def _at(self, x: Array, function: Any, more: tuple[int, ...]) -> Array:
        """Values (n, c, *more) of the compiled `function` at x (n, c) m."""
        x = np.ascontiguousarray(x, dtype=float)
        out = np.empty(x.shape + more)
        if x.size:
            self._know(*(int(np.floor(end / self._step)) for end in (x.min(), x.max())))
            known = self._begin, COMPILED.doubles(self._means)
            function(self._rectangles, *x.shape, COMPILED.doubles(x), *known, COMPILED.doubles(out))
        return out

    def _know(self, first: int, last: int) -> None:
        """Know the means at the positions from one before `first` * step to two behind `last` * step.

        Those under the footprint are kept as it rolls on: nine of ten positions were evaluated
        before; and those of a rectangle's two lengths behind it, to which points move back within a step.
        """
        begin, end = first - 1, last + 3
        if not 0 <= begin - self._begin <= len(self._means):
            self._sums, self._means = _nothing(self._means.shape[2])
            self._begin = begin
        passed = max(begin - self._begin - 2 * self._reach, 0)
        self._sums, self._means = self._sums[passed:], self._means[passed:]
        self._begin += passed
        if self._begin + len(self._means) < end:
            self._add(end)

    def _add(self, end: int) -> None:
        """Means at the positions up to `end` * step, excluded."""
        summed, known = self._begin - self._reach + len(self._sums), len(self._means)
        self._sums = np.concatenate([self._sums, self._sums_at(summed, end + self._reach)])
        means = np.empty((end - self._begin - known, *self._means.shape[1:]))
        given = COMPILED.doubles(self._sums[known:]), COMPILED.doubles(means)
        COMPILED.lib.mean_along(self._rectangles, len(means), *given)
        self._means = np.concatenate([self._means, means])

    def _sums_at(self, begin: int, end: int) -> Array:
        """Means and slopes across (end - begin, 4, r) over one and two widths, at begin * step, ..."""
        x = np.minimum(self._step * np.arange(begin, end), self._road.end)
        height = np.ascontiguousarray(lattice_of(self._road, x, self._y))
        sums = np.empty((len(x), *self._sums.shape[1:]))
        given = COMPILED.doubles(height), COMPILED.doubles(sums)
        COMPILED.lib.sum_across(self._rectangles, *height.shape, *given)
        return sums


def _nothing(lines: int) -> tuple[Array, Array]:
    return np.empty((0, 4, lines)), np.empty((0, 2, lines))


def _distinct(values: Array, apart: float) -> tuple[Array, NDArray[np.intp]]:
    """Values (m,) of an array, ascending, one for all that lie less than `apart` from the next; their indices."""
    order = np.argsort(values, axis=None)
    ascending = values.ravel()[order]
    new = np.concatenate([[True], np.diff(ascending) > apart])
    index = np.empty(values.size, dtype=np.intp)
    index[order] = np.cumsum(new) - 1
    return ascending[new], index.reshape(values.shape)


def _across(offset: Array, within: NDArray[np.bool_]) -> Array:
    """Weights (4, m, r) of strips at offsets (m, r) m: of the mean `within` the width, of the slope by least
    squares there, and of both over twice the width."""
    cells = []
    for used in (within, np.ones(len(within), dtype=bool)):
        inside = np.where(used[:, None], offset, 0.0)
        mean = np.broadcast_to(used[:, None] / used.sum(), offset.shape)
        cells += [mean, inside / (inside**2).sum(axis=0)]
    return np.stack(cells)


def _parts(offset: Array, step: float, half: Array) -> Array:
    """Fraction (r, n) of each sample's length within rectangles of half lengths (r, 1) m."""
    low, high = np.maximum(offset - step / 2, -half), np.minimum(offset + step / 2, half)
    return np.maximum(high - low, 0.0) / (2 * half)
