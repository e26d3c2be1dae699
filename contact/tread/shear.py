"""Tangential influence of the tread, as matrix and as convolution on a grid.

Horizontal displacements of an elastic half-space, coupled with pressure (Boussinesq, Cerruti).

With z into the body, G the shear modulus, r the distance in the surface from a force t (in the
surface) and f (along z),

    2 pi G u_x = (1 - nu) t_x/r + nu (x^2 t_x + x y t_y)/r^3 - (1 - 2 nu)/2 x f/r^2,
    2 pi G u_z = (1 - nu) f/r + (1 - 2 nu)/2 (x t_x + y t_y)/r^2,

and u_y as u_x with x and y exchanged. Forces are spread uniformly over rectangles. In an
incompressible body, nu = 1/2, pressure causes no horizontal displacement. Source: Johnson, Contact
Mechanics, (3.75) and (3.76).
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tireroad.contact.tread.compliance import (
    Influence,
    over_rectangle,
    primitive_product,
    rectangle_potential,
)
from tireroad.contact.tread.kernel import GridPlaces, doubled

Array = NDArray[np.float64]
Plane = NDArray[np.complex128]  # x + iy
Index = NDArray[np.intp]


MARGIN = 4  # points beyond the grid, over which the kernel of the preconditioner has fallen off


class ShearConvolution:
    """Convolution by FFT over twice a grid of `shape`, with kernels (3 or 5, ...) of a larger one.

    `place` (a,): flat indices of the points on the grid. `beside` m/N: compliance of each point in
    series with the tread, which the preconditioner includes.
    """

    def __init__(
        self, kernels: Array, shape: tuple[int, int], place: Index, beside: float = 0.0
    ) -> None:
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
        self._period = tuple(
            min(fft.next_fast_len(n + MARGIN, real=True), 2 * n - 1) for n in shape
        )
        around = np.ix_(*(np.fft.ifftshift(np.arange(n) - n // 2) for n in self._period))
        xx, xy, yy = (fft.rfft2(kernel[around]).real for kernel in kernels[:3])
        xx, yy = xx + beside, yy + beside
        determinant = xx * yy - xy**2
        least = 1e-6 * float(determinant.max())
        self._inverse = np.stack([yy, -xy, xx]) / np.maximum(determinant, least)
        self.set_points(place)

    def at(self, place: Index) -> ShearConvolution:
        """The same between other points of the grid."""
        other = copy(self)
        other.set_points(place)
        return other

    def set_points(self, place: Index) -> None:
        """Take the points `place` (a,)."""
        rows, columns = np.divmod(place, self._shape[1])
        self._place = rows * self._size[1] + columns
        self._place_in_period = rows * self._period[1] + columns

    def precondition(self, moved: Plane) -> Plane:
        """Approximate forces (a,) N in the plane for displacements (a,) m: the periodic inverse."""
        field = np.zeros((2, self._period[0] * self._period[1]))
        field[:, self._place_in_period] = _parts(moved)
        x, y = fft.rfft2(field.reshape(2, *self._period), overwrite_x=True)
        xx, xy, yy = self._inverse
        force = np.stack([xx * x + xy * y, xy * x + yy * y])
        whole = fft.irfft2(force, self._period, overwrite_x=True).reshape(2, -1)
        return _plane(whole[:, self._place_in_period])

    def spread(self, force: Plane) -> Plane:
        """Displacements (a,) m in the plane under forces (a,) N in the plane."""
        x, y = both = self._forward(_parts(force))
        moved = np.empty_like(both)
        np.multiply(self._xx, x, out=moved[0])
        np.multiply(self._yy, y, out=moved[1])
        moved[0] += self._xy * y
        moved[1] += self._xy * x
        return _plane(self._back(moved))

    def lift(self, force: Plane) -> Array:
        """Displacements (a,) m away from the road under forces (a,) N in the plane."""
        x, y = self._forward(_parts(force))
        return self._back(self._lift[0] * x + self._lift[1] * y)

    def drag(self, force: Array) -> Plane:
        """Displacements (a,) m in the plane under forces (a,) N normal to it."""
        return _plane(self._back(-np.stack(self._lift) * self._forward(force)))

    def _forward(self, values: Array) -> Plane:
        field = np.zeros((*values.shape[:-1], self._size[0] * self._size[1]))
        field[..., self._place] = values
        return fft.rfft2(field.reshape(*values.shape[:-1], *self._size), overwrite_x=True)

    def _back(self, spectrum: Plane) -> Array:
        field = fft.irfft2(spectrum, self._size, overwrite_x=True)
        return field.reshape(*field.shape[:-2], -1)[..., self._place]


def _parts(plane: Plane) -> Array:
    """x + iy (a,) as (2, a)."""
    return plane.view(float).reshape(-1, 2).T


def _plane(parts: Array) -> Plane:
    """(2, a) as x + iy (a,)."""
    return np.ascontiguousarray(parts.T).view(complex)[:, 0]


def half_space_shear(
    x: Array, y: Array, a: Array, b: Array, youngs_modulus: float, poisson_ratio: float
) -> Array:
    """(5, ...) m/N at offsets x, y (m) from a rectangle 2a x 2b (m) under a unit force on it.

    u_x by t_x, u_x by t_y (and u_y by t_x), u_y by t_y, u_z by t_x, u_z by t_y. The displacement
    u_x by f is that of u_z by t_x with opposite sign.
    """
    nu = poisson_ratio
    shear = youngs_modulus / (2.0 * (1.0 + nu))
    whole = rectangle_potential(x, y, a, b)
    along = over_rectangle(x, y, a, b, _along, lambda p, q: p**2 / np.hypot(p, q) ** 3)
    mixed = over_rectangle(x, y, a, b, _mixed, lambda p, q: p * q / np.hypot(p, q) ** 3)
    lift = [
        over_rectangle(x, y, a, b, _lift, lambda p, q: p / (p**2 + q**2)),
        over_rectangle(y, x, b, a, _lift, lambda p, q: p / (p**2 + q**2)),
    ]
    across = whole - along
    parts = [
        (1 - nu) * whole + nu * along,
        nu * mixed,
        (1 - nu) * whole + nu * across,
        *(0.5 * (1 - 2 * nu) * part for part in lift),
    ]
    return np.stack(parts) / (2.0 * np.pi * shear * 4.0 * np.asarray(a) * np.asarray(b))


def _along(x: Array, y: Array) -> Array:
    """F with d2F/dxdy = x^2/r^3: y asinh(x/|y|)."""
    return primitive_product(y, x)


def _mixed(x: Array, y: Array) -> Array:
    """F with d2F/dxdy = x y/r^3: -r."""
    return -np.hypot(x, y)


def _lift(x: Array, y: Array) -> Array:
    """F with d2F/dxdy = x/r^2: x atan(y/x) + y ln r."""
    square = x**2 + y**2
    safe = np.where(x != 0.0, x, 1.0)
    turned = np.where(x != 0.0, x * np.arctan(y / safe), 0.0)
    return turned + 0.5 * y * np.log(np.where(square > 0.0, square, 1.0))


class Shear(Protocol):
    """The tread's displacements between all points in the plane of the road.

    Forces and displacements in the plane are complex, x + iy. `coupled`: whether pressure causes
    horizontal displacement.
    """

    coupled: bool

    def spread(self, force: Plane) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N in the plane."""

    def lift(self, force: Plane) -> Array:
        """Displacements (c,) m away from the road under forces (c,) N in the plane."""

    def drag(self, force: Array) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N normal to it."""

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index`, (a, 2a): of all forces along x, then along y."""

    def between(self, index: Index, beside: float = 0.0) -> Between:
        """`spread` between the points `index`; `beside` m/N is in series with each."""

    def matrix(self, index: Index) -> Array:
        """The same as a matrix (2a, 2a): all forces along x, then those along y."""


class Between:
    """The operator `apply` from (a,) N to (a,) m, complex.

    `own` m/N: mean self-compliance of a point's two components; `bound` m/N of the largest singular
    value; `precondition` from (a,) m to (a,) N, about the inverse, None: only `own` is known.
    """

    def __init__(
        self,
        apply: Callable[[Plane], Plane],
        own: float | Array,
        bound: float,
        precondition: Callable[[Plane], Plane] | None = None,
    ) -> None:
        self.apply, self.own, self.bound, self.precondition = apply, own, bound, precondition


class MatrixShear:
    """Between points (c, 2) m with rectangles of half sizes (c, 2) m, at any positions."""

    def __init__(self, points: Array, half_sizes: Array, influence: Influence) -> None:
        x, y = (points[:, None, k] - points[None, :, k] for k in (0, 1))
        xx, xy, yy, zx, zy = influence(x, y, half_sizes[None, :, 0], half_sizes[None, :, 1])
        # As a matrix of adjacent real and imaginary parts.
        count = len(points)
        both = np.block([[xx, xy], [xy, yy]])
        both = 0.5 * (both + both.T)
        order = np.arange(2 * count).reshape(2, -1).T.ravel()
        self._matrix = both[np.ix_(order, order)]
        self._lift = 0.5 * (zx - zx.T) - 0.5j * (zy - zy.T)
        self.coupled = bool(self._lift.any())

    def spread(self, force: Plane) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N in the plane."""
        return (self._matrix @ force.view(float)).view(complex)

    def lift(self, force: Plane) -> Array:
        """Displacements (c,) m away from the road under forces (c,) N in the plane."""
        return (self._lift @ force).real

    def drag(self, force: Array) -> Plane:
        """Displacements (c,) m in the plane under normal forces (c,) N, the transpose of `lift`."""
        return self._lift.T.conj() @ force

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index` as a matrix (a, 2a)."""
        some = self._lift[np.ix_(index, index)]
        return np.hstack([some.real, -some.imag])

    def matrix(self, index: Index) -> Array:
        """`spread` as a matrix, x of all points, then y."""
        some = np.concatenate([2 * index, 2 * index + 1])
        return self._matrix[np.ix_(some, some)]

    def between(self, index: Index, beside: float = 0.0) -> Between:
        """`spread` between the points `index`."""
        some = np.stack([2 * index, 2 * index + 1], axis=-1).ravel()
        matrix = self._matrix[np.ix_(some, some)]

        def apply(force: Plane) -> Plane:
            return (matrix @ force.view(float)).view(complex)

        own = matrix.diagonal().reshape(-1, 2).mean(axis=1)
        return Between(apply, own, float(np.abs(matrix).sum(axis=1).max(initial=0.0)))


MOST_RECTANGLES = 100  # whose kernels are kept


class KernelShear:
    """The same on a regular grid, by FFT.

    Between some of the points over the rectangle that contains them, whose kernels are kept: it
    changes less often than the points.
    """

    def __init__(self, grid: GridPlaces, influence: Influence) -> None:
        self._grid = grid
        _, x, y = doubled(grid)
        self._kernels = influence(x, y, *(np.full(x.shape, d / 2) for d in grid.spacing))
        self.coupled = bool(self._kernels[3:].any())
        self._whole = ShearConvolution(self._kernels, grid.shape, grid.place)
        self._rectangles: dict[tuple[int, int, float], ShearConvolution] = {}

    def spread(self, force: Plane) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N in the plane."""
        return self._whole.spread(force)

    def lift(self, force: Plane) -> Array:
        """Displacements (c,) m away from the road under forces (c,) N in the plane."""
        return self._whole.lift(force)

    def drag(self, force: Array) -> Plane:
        """Displacements (c,) m in the plane under normal forces (c,) N, the transpose of `lift`."""
        return self._whole.drag(force)

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index` as a matrix (a, 2a)."""
        return np.hstack([*self._between(index)[3:]])

    def matrix(self, index: Index) -> Array:
        """`spread` as a matrix, x of all points, then y."""
        xx, xy, yy = self._between(index)[:3]
        return np.block([[xx, xy], [xy, yy]])

    def between(self, index: Index, beside: float = 0.0) -> Between:
        """`spread` between the points `index`; `beside` m/N is in series with each."""
        i, j = np.divmod(self._grid.place[index], self._grid.shape[1])
        i, j = i - i.min(), j - j.min()
        shape = int(i.max()) + 1, int(j.max()) + 1
        place = i * shape[1] + j
        if (*shape, beside) not in self._rectangles:
            if len(self._rectangles) >= MOST_RECTANGLES:
                self._rectangles.clear()
            one = ShearConvolution(self._kernels[:3], shape, place, beside)
            self._rectangles[(*shape, beside)] = one
        part = self._rectangles[(*shape, beside)].at(place)
        return Between(part.spread, part.own, part.bound, part.precondition)

    def _between(self, index: Index) -> Array:
        """All kernels between the points `index`, (5, a, a)."""
        i, j = np.divmod(self._grid.place[index], self._grid.shape[1])
        return self._kernels[:, i[:, None] - i, j[:, None] - j]
