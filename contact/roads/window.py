"""The part of a road's rows that the tire is passing over, without holes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.rows import PIECE, Rows
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]


class Window:
    """Heights z at rows `first` to `first` + len(x) and columns of a road, x (n,), y (w,) in m.

    Only the rows last needed, and as many ahead of them as make `PIECE` numbers, are in memory;
    holes in them are filled. `missing` counts all holes, `hole` is the first (row, column) or None.
    """

    def __init__(
        self, rows: Rows, place: tuple[int, slice], x: Array, y: Array, source: str
    ) -> None:
        self._rows, (self._first, self._columns), self._source = rows, place, source
        self._x, self._y = x, y
        # As many rows as are read at a time: files yield whole rows, of which a part is kept.
        self._most = max(PIECE // rows.shape[1], 2)
        self._begin, self._z = 0, np.empty((0, len(y)))
        self._corners: tuple[Array, ...] = ()
        self._known = np.zeros(0, dtype=bool)
        self.missing = 0
        self.hole: tuple[int, int] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """The state without the rows in memory, which are read again when needed."""
        nothing = {"_begin": 0, "_z": np.empty((0, len(self._y))), "_corners": ()}
        return self.__dict__ | nothing

    def scan(self) -> None:
        """Search all rows for holes, once. InputError if there is no height at all."""
        known = np.ones(len(self._x), dtype=bool)
        for first in range(0, len(self._x), self._most):
            missing = np.isnan(self._read(first, min(first + self._most, len(self._x))))
            known[first : first + len(missing)] = ~missing.all(axis=1)
            if self.hole is None and missing.any():
                i, j = np.argwhere(missing)[0]
                self.hole = first + int(i), int(j)
            self.missing += int(missing.sum())
        if not known.any():
            raise InputError(f"{self._source}: no valid height in the strip driven over")
        self._known = known

    def bilinear(self, i: NDArray[np.intp], s: Array, j: NDArray[np.intp], t: Array) -> Array:
        """Heights in the cells (i, j) at the fractions s along and t across."""
        if i.size == 0:
            return np.zeros(i.shape)
        low, high = int(i.min()), int(i.max())
        if high - low + 2 > self._most:
            return self._by_pieces(i, s, j, t)
        self._hold(low, high + 2)
        k = (i - self._begin) * len(self._y) + j
        near, near_left, far, far_left = (corner.take(k) for corner in self._corners)
        near += t * (near_left - near)
        far += t * (far_left - far)
        return near + s * (far - near)

    def bounds(self, rows: slice, columns: slice) -> tuple[float, float]:
        """Lowest and highest height of the rows and columns, without holes."""
        low, high = np.inf, -np.inf
        for first in range(rows.start, rows.stop, self._most):
            last = min(first + self._most, rows.stop)
            self._hold(first, last)
            z = self._z[first - self._begin : last - self._begin, columns]
            # Without a known height both stay infinite, and nothing is warned of.
            low = min(low, np.nanmin(z, initial=np.inf))
            high = max(high, np.nanmax(z, initial=-np.inf))
        return float(low), float(high)

    def _by_pieces(self, i: NDArray[np.intp], s: Array, j: NDArray[np.intp], t: Array) -> Array:
        out, piece = np.empty(i.shape), i // (self._most - 1)
        for one in np.unique(piece):
            here = piece == one
            out[here] = self.bilinear(i[here], s[here], j[here], t[here])
        return out

    def _hold(self, low: int, high: int) -> None:
        """Load the rows from `low` to `high`, and as many beyond as there is room for."""
        if low >= self._begin and high <= self._begin + len(self._z):
            return
        # A few behind too, since not all points of a patch are evaluated in one call.
        margin = (self._most - (high - low)) // 8
        begin = max(low - margin, 0)
        end = min(max(begin + self._most, high), len(self._x))
        z = self._read(begin, end)
        if len(self._known) and self.missing:
            z = self._without_holes(z, begin, end)
        # Four views in which a single index finds the corners of a cell.
        self._begin, self._z = begin, np.ascontiguousarray(z)
        flat, width = self._z.ravel(), len(self._y)
        self._corners = flat, flat[1:], flat[width:], flat[width + 1 :]

    def _without_holes(self, z: Array, begin: int, end: int) -> Array:
        """Fill holes, using the nearest known row on either side for rows without any height."""
        known = np.flatnonzero(self._known)
        k0, k1 = np.searchsorted(known, [begin, end - 1])
        before, after = known[max(k0 - 1, 0)], known[min(k1, len(known) - 1)]
        extra = [row for row in (before, after) if not begin <= row < end]
        index = np.concatenate([np.arange(begin, end), np.array(extra, dtype=int)])
        z = np.concatenate([z, *(self._read(row, row + 1) for row in extra)])
        order = np.argsort(index)
        filled = fill_holes(z[order], self._x[index[order]], self._y, self._source)
        return filled[np.searchsorted(index[order], np.arange(begin, end))]

    def _read(self, i0: int, i1: int) -> Array:
        try:
            z = self._rows.read(self._first + i0, self._first + i1)[:, self._columns]
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._source}: cannot be read ({error})") from error
        if np.isinf(z).any():
            raise InputError(f"{self._source}: {int(np.isinf(z).sum())} heights are infinite")
        return z


def fill_holes(z: Array, x: Array, y: Array, source: str = "road") -> Array:
    """z (nx, ny) m with NaN replaced.

    Linear across y between valid neighbours, the nearest one beyond the last; then the same
    along x for rows without any. InputError if all heights are missing.
    """
    if not np.isnan(z).any():
        return z
    z = z.copy()
    for row in np.flatnonzero(np.isnan(z).any(axis=1)):
        valid = ~np.isnan(z[row])
        if valid.any():
            z[row] = np.interp(y, y[valid], z[row, valid])
    known = ~np.isnan(z[:, 0])
    if not known.any():
        raise InputError(f"{source}: no valid height in the strip driven over")
    for column in range(z.shape[1] if not known.all() else 0):
        z[:, column] = np.interp(x, x[known], z[known, column])
    return z
