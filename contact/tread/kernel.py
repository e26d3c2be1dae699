"""A tread compliance on a regular grid of points as a convolution, without its matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tireroad.contact.tread.compliance import Influence

Array = NDArray[np.float64]
Index = NDArray[np.intp]
MARGIN = 4  # points
Box = tuple[int, int, int, int]  # first row, one past the last, first column, one past the last
EMPTY: Box = (2**31, 0, 2**31, 0)
# Rows and columns of points around those that touch, among which a step looks for others: a footprint is half of
# the points within reach of the road.
AROUND = 3


@dataclass(frozen=True)
class GridPlaces:
    """Places of c points on a regular grid of `shape`: flat indices `place` (c,), `spacing` m."""

    shape: tuple[int, int]
    spacing: tuple[float, float]
    place: Index


class KernelTread:
    """C~ f by FFT over twice the grid: c log c work and c memory for c points.

    `precondition` is the inverse of the same kernel, periodic over the grid and a `MARGIN`, since it
    falls off within a few points. Measured on one core, 100 x 100 points: 1.1 ms per product; the
    matrix would take 0.8 GB.
    """

    def __init__(self, grid: GridPlaces, influence: Influence) -> None:
        self.grid, self._influence = grid, influence
        self._size, x, y = doubled(grid)
        a, b = (np.full(x.shape, d / 2) for d in grid.spacing)
        kernel = influence(x, y, a, b)
        # Nothing is read between the two ends; a smooth transition keeps the periodic kernel
        # positive.
        self.diagonal = float(kernel[0, 0])
        for axis, n in enumerate(grid.shape):
            kernel = _bridged(kernel, axis, n)
        self._kernel = kernel
        self._transform = fft.rfft2(kernel).real
        self._period = tuple(
            min(fft.next_fast_len(n + MARGIN, real=True), most)
            for n, most in zip(grid.shape, self._size, strict=True)
        )
        around = np.ix_(*(np.fft.ifftshift(np.arange(n) - n // 2) for n in self._period))
        least = 1e-3 * self.diagonal
        self._inverse = 1.0 / np.maximum(fft.rfft2(kernel[around]).real, least)

    @property
    def around(self) -> Array:
        """The kernel (2 nx - 1, 2 ny - 1) m/N over the offsets from one end of the grid to the other."""
        i, j = (np.arange(1 - n, n) for n in self.grid.shape)
        return np.ascontiguousarray(self._kernel[i[:, None], j])

    @property
    def cells(self) -> tuple[Index, Index]:
        """Row and column (c,) of each point in the grid."""
        rows, columns = np.divmod(self.grid.place, self.grid.shape[1])
        return rows, columns

    def inside(self, box: Box) -> tuple[KernelTread, Index]:
        """The same for the points in a box of the grid, and which those are (a,)."""
        (top, bottom, left, right), (rows, columns) = box, self.cells
        index = points_in(box, self.cells)
        shape = bottom - top, right - left
        place = (rows[index] - top) * shape[1] + columns[index] - left
        return KernelTread(GridPlaces(shape, self.grid.spacing, place), self._influence), index

    def block(self, rows: Index, columns: Index) -> Array:
        """The matrix between the points `rows` (a,) and `columns` (b,), (a, b) m/N."""
        i, j = np.divmod(self.grid.place[rows, None], self.grid.shape[1])
        k, m = np.divmod(self.grid.place[columns], self.grid.shape[1])
        return self._kernel[i - k, j - m]

    def apply(self, force: Array) -> Array:
        """Approach (c,) m under forces (c,) N."""
        return self._convolve(force, self._transform, self._size)

    def precondition(self, approach: Array) -> Array:
        """Approximate forces (c,) N for an approach (c,) m."""
        return self._convolve(approach, self._inverse, self._period)

    def _convolve(self, values: Array, transform: Array, size: tuple[int, ...]) -> Array:
        nx, ny = self.grid.shape
        field = np.zeros(nx * ny)
        field[self.grid.place] = values
        spectrum = fft.rfft2(field.reshape(nx, ny), size)
        spectrum *= transform
        return fft.irfft2(spectrum, size)[:nx, :ny].ravel()[self.grid.place]


def points_in(box: Box, cells: tuple[Index, Index]) -> Index:
    """The points (a,), of those with rows and columns `cells` (c,) each, that lie in a box of the grid."""
    (top, bottom, left, right), (rows, columns) = box, cells
    return np.flatnonzero((rows >= top) & (rows < bottom) & (columns >= left) & (columns < right))


def widened(box: Box, cells: tuple[Index, Index], shape: tuple[int, ...], edge: int = 0) -> Box:
    """The box, grown by `AROUND` on each side where `cells` (rows and columns) lie beyond it or in its outermost `edge`."""
    (top, bottom, left, right), (rows, columns) = box, cells
    along, across = (top, bottom, rows, shape[0]), (left, right, columns, shape[1])
    return (*_widened(*along, edge), *_widened(*across, edge))


def _widened(first: int, last: int, cells: Index, count: int, edge: int) -> tuple[int, int]:
    """The range from `first` to before `last` of `count` cells, grown where `cells` lie beyond it."""
    low, high = int(cells.min()), int(cells.max()) + 1
    return (
        first if low >= first + edge else max(low - AROUND, 0),
        last if high <= last - edge else min(high + AROUND, count),
    )


def doubled(grid: GridPlaces) -> tuple[tuple[int, ...], Array, Array]:
    """Size of the grid on which convolutions do not wrap around, and the offsets x, y (m) on it.

    Between the two ends, where nothing is read, the offsets are 0.
    """
    size = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in grid.shape)
    offsets = [
        d * np.concatenate([np.arange(n), np.zeros(whole - 2 * n + 1), np.arange(1 - n, 0)])
        for n, d, whole in zip(grid.shape, grid.spacing, size, strict=True)
    ]
    x, y = np.meshgrid(*offsets, indexing="ij")
    return size, x, y


def _bridged(kernel: Array, axis: int, n: int) -> Array:
    """Interpolate linearly over the unused middle of a doubled axis."""
    kernel = np.moveaxis(kernel, axis, 0)
    count = len(kernel) - 2 * n + 1
    if count:
        share = (np.arange(count) + 1.0)[:, None] / (count + 1)
        kernel[n : n + count] = (1 - share) * kernel[n - 1] + share * kernel[n + count]
    return np.moveaxis(kernel, 0, axis)
