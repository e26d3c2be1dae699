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

from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tireroad.contact.tread.compliance import (
    Influence,
    over_rectangle,
    primitive_product,
    rectangle_potential,
)
from tireroad.contact.tread.kernel import Box, GridPlaces, KernelTread, doubled, points_in
from tireroad.fem.compiled import Library, library

Array = NDArray[np.float64]
Plane = NDArray[np.complex128]  # x + iy
Index = NDArray[np.intp]

_SPECTRA = library(Path(__file__).with_name("spectra.c"))
_WITHIN = 2  # cells of the inverse of a tread that precondition a Newton step
_LEAST = 0.01  # of the largest eigenvalue: the least of what is inverted
_UNREAD = 0.2  # share of the sum of a kernel that a Newton step leaves out, whose problem is solved to a tenth


class ShearConvolution:
    """Convolution by FFT over twice a grid of `shape`, with kernels (5, ...) on it; `place` (a,): flat
    indices of the points on the grid.
    """

    def __init__(self, kernels: Array, shape: tuple[int, int], place: Index) -> None:
        self._size = kernels.shape[1:]
        self._xx, self._xy, self._yy, *self._lift = fft.rfft2(kernels)
        rows, columns = np.divmod(place, shape[1])
        self._place = rows * self._size[1] + columns

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
    """The tread's displacements between c points (`count`) in the plane of the road.

    Forces and displacements in the plane are complex, x + iy. `coupled`: whether pressure causes
    horizontal displacement. `own` m/N: mean self-compliance of a point's two components; `bound` m/N of the
    largest singular value.
    """

    count: int
    coupled: bool
    own: Any  # a number, or (c,)
    bound: float

    def spread(self, force: Plane) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N in the plane."""

    def lift(self, force: Plane) -> Array:
        """Displacements (c,) m away from the road under forces (c,) N in the plane."""

    def drag(self, force: Array) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N normal to it."""

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index`, (a, 2a): of all forces along x, then along y."""

    def matrix(self, index: Index) -> Array:
        """`spread` between the points `index`, (2a, 2a): all forces along x, then those along y."""

    def compiled(self, library: Library) -> dict[str, Any]:
        """The tread in the structure `plane` of the kernel (contact.solver.stick_slip)."""

    def inverse(self, library: Library, spring: float) -> dict[str, Any]:
        """About the inverse of `spread` with a spring (m/N) in series at each point, likewise; {} if there is none."""


class MatrixShear:
    """Between points (c, 2) m with rectangles of half sizes (c, 2) m, at any positions."""

    def __init__(self, points: Array, half_sizes: Array, influence: Influence) -> None:
        x, y = (points[:, None, k] - points[None, :, k] for k in (0, 1))
        xx, xy, yy, zx, zy = influence(x, y, half_sizes[None, :, 0], half_sizes[None, :, 1])
        self.count = len(points)
        even = (0.5 * (part + part.T) for part in (xx, xy, yy))
        odd = (0.5 * (part - part.T) for part in (zx, zy))
        self._parts = [np.ascontiguousarray(part) for part in (*even, *odd)]
        self.coupled = bool(self._parts[3].any() or self._parts[4].any())
        self.own = 0.5 * (self._parts[0].diagonal() + self._parts[2].diagonal())
        along, mixed, across = (np.abs(part).sum(axis=1) for part in self._parts[:3])
        self.bound = float(max((along + mixed).max(initial=0.0), (mixed + across).max(initial=0.0)))

    def spread(self, force: Plane) -> Plane:
        """Displacements (c,) m in the plane under forces (c,) N in the plane."""
        xx, xy, yy = self._parts[:3]
        return xx @ force.real + xy @ force.imag + 1j * (xy @ force.real + yy @ force.imag)

    def lift(self, force: Plane) -> Array:
        """Displacements (c,) m away from the road under forces (c,) N in the plane."""
        zx, zy = self._parts[3:]
        return np.asarray(zx @ force.real + zy @ force.imag)

    def drag(self, force: Array) -> Plane:
        """Displacements (c,) m in the plane under normal forces (c,) N, the transpose of `lift`."""
        zx, zy = self._parts[3:]
        return -(zx @ force) - 1j * (zy @ force)

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index` as a matrix (a, 2a)."""
        return np.hstack([part[np.ix_(index, index)] for part in self._parts[3:]])

    def matrix(self, index: Index) -> Array:
        """`spread` as a matrix, x of all points, then y."""
        xx, xy, yy = (part[np.ix_(index, index)] for part in self._parts[:3])
        return np.block([[xx, xy], [xy, yy]])

    def inverse(self, library: Library, spring: float) -> dict[str, Any]:
        """None: the points are on no grid."""
        return {}

    def compiled(self, library: Library) -> dict[str, Any]:
        """The five matrices."""
        kernel = [library.doubles(part) for part in self._parts]
        return {"tread": library.lib.MATRIX, "coupled": self.coupled, "kernel": kernel}


class KernelShear:
    """The same on a regular grid: for all points by FFT, for those that touch by their kernels (contact.c)."""

    def __init__(self, grid: GridPlaces, influence: Influence) -> None:
        self._grid, self.count = grid, len(grid.place)
        _, x, y = doubled(grid)
        self._kernels = influence(x, y, *(np.full(x.shape, d / 2) for d in grid.spacing))
        self.coupled = bool(self._kernels[3:].any())
        self._whole = ShearConvolution(self._kernels, grid.shape, grid.place)
        far = (np.arange(1 - n, n) for n in grid.shape)  # behind, in the layout of `doubled`
        i, j = np.ix_(*far)
        self._around = np.ascontiguousarray(self._kernels[:, i, j])
        self.own = float(self._kernels[0, 0, 0] + self._kernels[2, 0, 0]) / 2
        # Upper bound of the row sums of both components of `spread`.
        self.bound = float(np.abs(self._around[:3]).sum())
        self.spread, self.lift, self.drag = self._whole.spread, self._whole.lift, self._whole.drag

    def lifted(self, index: Index) -> Array:
        """`lift` between the points `index` as a matrix (a, 2a)."""
        return np.hstack([*self._between(index)[3:]])

    def matrix(self, index: Index) -> Array:
        """`spread` as a matrix, x of all points, then y."""
        xx, xy, yy = self._between(index)[:3]
        return np.block([[xx, xy], [xy, yy]])

    @property
    def around(self) -> Array:
        """The kernels (5, 2 nx - 1, 2 ny - 1) over the offsets from one end of the grid to the other."""
        return self._around

    def compiled(self, library: Library) -> dict[str, Any]:
        """The five kernels, and the points on the grid."""
        return _on_grid(library, self._around, self._around[[0, 2]], self._grid) | {
            "coupled": self.coupled
        }

    def inverse(self, library: Library, spring: float) -> dict[str, Any]:
        """Kernels of the inverse of `spread` with a spring (m/N) in series at each point, where the grid is endless: they decay
        in a few cells. In the layout of `compiled`."""
        nx, ny = self._grid.shape
        whole = np.zeros((3, *self._kernels.shape[1:]))
        whole[:, np.arange(1 - nx, nx)[:, None], np.arange(1 - ny, ny)] = self._around[:3]
        xx, xy, yy = fft.fft2(whole).real
        own = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)  # the smaller eigenvalue of each wave
        spring = max(
            spring, _LEAST * own.max() - own.min()
        )  # positive definite, whatever the ends of the grid cut off
        xx, yy = xx + spring, yy + spring
        kernels = fft.ifft2(np.array([yy, -xy, xx]) / (xx * yy - xy**2)).real
        kernels = kernels[:, np.arange(1 - nx, nx)[:, None], np.arange(1 - ny, ny)]
        return {
            "inverse": [library.doubles(kernel) for kernel in _in_vectors(kernels)],
            "within": _WITHIN,
        }

    def _between(self, index: Index) -> Array:
        """All kernels between the points `index`, (5, a, a)."""
        i, j = np.divmod(self._grid.place[index], self._grid.shape[1])
        return self._kernels[:, i[:, None] - i, j[:, None] - j]


class GridTread:
    """Displacements of a tread on a grid in all directions, under forces normal to the road and in its plane: a
    convolution, (3, c) m for (3, c) N, z, x, y. `shear`: None where it is rigid in its plane; `box` of the whole grid."""

    def __init__(self, normal: KernelTread, shear: KernelShear | None) -> None:
        self._normal, self._grid = normal, normal.grid
        beside = np.zeros((5, *normal.around.shape)) if shear is None else shear.around
        self._around = np.concatenate([normal.around[None], beside])
        self.coupled = shear is not None and shear.coupled
        nx, ny = self._grid.shape
        self.box: Box = (0, nx, 0, ny)

    def inside(self, box: Box) -> GridConvolution:
        """The same between the points in a box of the grid."""
        return GridConvolution(self._around, self.coupled, box, self._normal.cells)

    def compiled(self, library: Library) -> dict[str, Any]:
        """As KernelShear.compiled."""
        read = self._around[[0, 1, 3]]
        return _on_grid(library, self._around[1:], read, self._grid) | {"coupled": self.coupled}

    def pressed(self, library: Library) -> Any:
        """The kernel of displacements normal to the road by forces normal to it, in the layout of `compiled`."""
        return library.doubles(_in_vectors(self._around[:1]))


class GridConvolution:
    """GridTread between the points in a `box`, by FFT over twice that."""

    def __init__(self, around: Array, coupled: bool, box: Box, cells: tuple[Index, Index]) -> None:
        top, bottom, left, right = box
        (rows, columns), inside = cells, points_in(box, cells)
        self.shape = shape = bottom - top, right - left
        self._size = tuple(fft.next_fast_len(2 * n - 1, real=True) for n in shape)
        self._place = (rows[inside] - top) * self._size[1] + columns[inside] - left
        kernels, middle = np.zeros((6, *self._size)), [n // 2 for n in around.shape[1:]]
        i, j = (np.arange(1 - n, n) for n in shape)
        kernels[:, i[:, None], j] = around[:, middle[0] + i[:, None], middle[1] + j]
        spectra = fft.rfft2(kernels)
        self._even = np.ascontiguousarray(spectra[:4].real)
        self._odd = np.ascontiguousarray(spectra[4:].imag) if coupled else None

    def __call__(self, force: Array) -> Array:
        """Displacements (3, a) m under forces (3, a) N at the points of the box."""
        field = np.zeros((3, self._size[0] * self._size[1]))
        field[:, self._place] = force
        forces = fft.rfft2(field.reshape(3, *self._size), overwrite_x=True)
        moved = np.empty_like(forces)
        odd = _SPECTRA.ffi.NULL if self._odd is None else _SPECTRA.doubles(self._odd)
        spectra = (_SPECTRA.doubles(values.view(float)) for values in (forces, moved))
        _SPECTRA.lib.convolve(forces[0].size, _SPECTRA.doubles(self._even), odd, *spectra)
        whole = fft.irfft2(moved, self._size, overwrite_x=True)
        return whole.reshape(3, -1).take(self._place, axis=1)  # in rows


def _on_grid(library: Library, around: Array, read: Array, grid: GridPlaces) -> dict[str, Any]:
    """Kernels (5, 2 nx - 1, 2 ny - 1) and places of points in the structure `plane` of the kernel.

    A Newton step reads kernels as far as those to `read` (k, ...) have most of their sum (`_UNREAD`).
    """
    size, (nx, ny) = np.abs(read).max(axis=0), grid.shape
    apart = np.maximum(*np.meshgrid(*(abs(np.arange(1 - n, n)) for n in (nx, ny)), indexing="ij"))
    within = np.bincount(apart.ravel(), weights=size.ravel()).cumsum()
    near = int(np.searchsorted(within, (1.0 - _UNREAD) * within[-1]))
    row, column = np.divmod(grid.place, ny)
    return {
        "tread": library.lib.GRID, "kernel": [library.doubles(kernel) for kernel in _in_vectors(around)],
        "nx": nx, "ny": ny, "near": near,
        "row": library.ints(row.astype(np.int32)), "column": library.ints(column.astype(np.int32)),
    }  # fmt: skip


def _in_vectors(kernels: Array) -> Array:
    """Kernels (k, ...) as (k, n + 8): what is read by eights may end behind the last."""
    return np.hstack([kernels.reshape(len(kernels), -1), np.zeros((len(kernels), 8))])
