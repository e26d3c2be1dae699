"""Displacements in the plane of the road and normal to it between points of a grid, by FFT."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Array = NDArray[np.float64]
Plane = NDArray[np.complex128]  # x + iy
Index = NDArray[np.intp]


class Convolution:
    """Convolution by FFT over twice a grid of `shape`, with kernels (3 or 5, ...) of a larger one.

    `place` (a,): flat indices of points on the grid.
    """

    def __init__(self, kernels: Array, shape: tuple[int, int]) -> None:
        self._shape = shape
        self._size = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        rows, columns = (
            np.concatenate([np.arange(n), np.zeros(size - 2 * n + 1, int), np.arange(1 - n, 0)])
            for n, size in zip(shape, self._size, strict=True)
        )
        some = kernels[:, rows[:, None], columns]
        self.own = float(some[0, 0, 0] + some[2, 0, 0]) / 2
        # Upper bound of the row sums of both components of `spread`.
        self.bound = float(np.abs(some[:3]).sum())
        self._xx, self._xy, self._yy, *self._lift = fft.rfft2(some)

    def spread(self, force: Plane, place: Index) -> Plane:
        """Displacements (a,) m in the plane under forces (a,) N in the plane."""
        x, y = self._forward(np.stack([force.real, force.imag]), place)
        moved = np.stack([self._xx * x + self._xy * y, self._xy * x + self._yy * y])
        u, v = self._back(moved, place)
        return u + 1j * v

    def lift(self, force: Plane, place: Index) -> Array:
        """Displacements (a,) m away from the road under forces (a,) N in the plane."""
        x, y = self._forward(np.stack([force.real, force.imag]), place)
        return self._back(self._lift[0] * x + self._lift[1] * y, place)

    def drag(self, force: Array, place: Index) -> Plane:
        """Displacements (a,) m in the plane under forces (a,) N normal to it."""
        x, y = self._back(-np.stack(self._lift) * self._forward(force, place), place)
        return x + 1j * y

    def _forward(self, values: Array, place: Index) -> Plane:
        nx, ny = self._shape
        field = np.zeros((*values.shape[:-1], nx * ny))
        field[..., place] = values
        return fft.rfft2(field.reshape(*values.shape[:-1], nx, ny), self._size)

    def _back(self, spectrum: Plane, place: Index) -> Array:
        nx, ny = self._shape
        field = fft.irfft2(spectrum, self._size)[..., :nx, :ny]
        return field.reshape(*field.shape[:-2], -1)[..., place]
