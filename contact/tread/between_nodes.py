"""Compliance of the tire's own rubber under a grid of points that the finite elements do not resolve.

A point is a uniform pressure on its rectangle. Locally the tire's outer rubber is a half-space, or a layer on its belt, with a
compliance C between the points. Elements give the points only displacements W q of their nodes: of all such displacements those
of least energy are, by Galerkin's method, W N W^T f with

    N = (W^T C^-1 W)^-1,

so that the elements lack

    C - W N W^T,

which is not negative on any mesh (as computed, beyond 4 % of the largest C: at the rim of a patch, where C^-1 is cut off), and all of
it within a few nodes. A tread law that is the tire's own outer rubber (not
`in_series` with it) counts for that alone: C between the points, and the compliance of the nodes less N, as far as they have it
(`in_elements`).

C is that of a raster of cells several times as close as the nodes, on which their shape functions are what they are between the
points too; C^-1 falls off within a few cells.

Elements are integrated selectively and coarse through the rubber, which is more and less than N. On a layer of 8 mm, nu = 0.49, of one
quadratic element with nodes 12, 8, 6, 4 mm apart, a square of 3 mm gives way by 0.43, 0.52, 0.56, 0.55 of what it does on the layer;
N has 0.28, 0.45, 0.55, 0.59 of it. Sideways they are 0.35, 0.42, 0.46, 0.49 and 0.39, 0.51, 0.59, 0.63
(tests/contact/tread/test_between_nodes.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg, sparse

from tireroad.contact.grid_patch import DeformedTread, over_cells
from tireroad.contact.patch import Patch
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.law import TreadLaw

Array = NDArray[np.float64]

_FINER = 4.0  # cells from node to node
_DECAYED = (
    0.036  # m beside a node, beyond which C^-1 is of no matter: four times a tread's thickness
)
_MARGIN = 2.0  # distances of nodes beyond the points
_SEEN = (
    0.05  # of the usual stiffness of a node: less has one of which the raster shows an edge alone
)
_STIFFEST = (
    1e-3  # of the most compliant wave: the least compliance of one, as in contact.tread.kernel
)
_CORNERS = (-1, -1), (-1, 1), (1, -1), (1, 1)


@dataclass(frozen=True, kw_only=True)
class OuterRubber(TreadLaw):
    """A tread `law` on a compliant `wall`, for forces normal to the road."""

    law: TreadLaw
    wall: Influence

    def influence(self, farthest: float) -> Influence:
        """The sum of both influences."""
        own = self.law.influence(farthest)

        def of(x: Array, y: Array, a: Array, b: Array) -> Array:
            return own(x, y, a, b) + self.wall(x, y, a, b)

        return of


def over_rectangles(influence: Influence) -> Influence:
    """The mean over a rectangle by 2 x 2 Gauss points, as in contact.grid_patch."""

    def of(x: Array, y: Array, a: Array, b: Array) -> Array:
        parts = [influence(x + i * a / 3**0.5, y + j * b / 3**0.5, a, b) for i, j in _CORNERS]
        return np.mean(parts, axis=0)

    return of


@dataclass(frozen=True)
class Raster:
    """Displacements of a face by those of p nodes, on a grid of cells: `weights` (n m, p), shape functions averaged over the cells,
    zero where there is no face; `shape` (n, m), `spacing` m along and across."""

    weights: sparse.csr_matrix
    shape: tuple[int, int]
    spacing: tuple[float, float]

    def window(
        self, first: Array, size: tuple[int, ...]
    ) -> tuple[NDArray[np.intp], sparse.csr_matrix]:
        """Cells of a window of this `size` from `first` (2,) on that lie on the grid, and their weights."""
        rows, columns = (start + np.arange(n) for start, n in zip(first, size, strict=True))
        on = np.outer(
            (rows >= 0) & (rows < self.shape[0]), (columns >= 0) & (columns < self.shape[1])
        )
        cells = rows[:, None] * self.shape[1] + columns
        return np.flatnonzero(on), self.weights[cells[on]]


def rastered(surface: DeformedTread, patch: Patch) -> Raster:
    """The displacements of a patch's nodes on the deformed `surface`, under its points and around them."""
    x0, x1, y0, y1 = patch.extent
    nodes = np.sqrt((x1 - x0) * (y1 - y0) / len(patch.index))
    beyond, apart = _MARGIN * nodes, nodes / _FINER
    ends = (x0 - beyond, x1 + beyond), (y0 - beyond, y1 + beyond)
    x, y = (np.linspace(low, high, round((high - low) / apart)) for low, high in ends)
    spacing = float(x[1] - x[0]), float(y[1] - y[0])
    points = np.stack([v.ravel() for v in np.meshgrid(x, y, indexing="ij")], axis=-1)
    ring, arc, found = surface.locate(*points.T)
    weights = over_cells(surface, points, spacing, ring, arc)[:, patch.index]
    return Raster(sparse.diags(found.astype(float)) @ weights, (len(x), len(y)), spacing)


def on_nodes(face: Raster, wall: Influence, shear: Influence | None = None) -> Array:
    """N (p, p) m/N between the nodes of a face; (3p, 3p) in z, x, y with `shear`.

    `wall`: the influence that makes C, and `shear` that in the plane of the road.
    """
    columns, p = face.weights.tocsc(), face.weights.shape[1]
    shapes = [columns[:, [node]] for node in range(p)]
    cells = [np.stack(np.divmod(one.indices, face.shape[1])) for one in shapes]
    beside = np.array([math.ceil(_DECAYED / d) for d in face.spacing])
    widest = np.max([np.ptp(own, axis=1) for own in cells if own.size], axis=0) + 1
    size = tuple(fft.next_fast_len(int(n), real=True) for n in widest + 2 * beside)
    stiffness = _inverse_symbol(size, face.spacing, wall, shear)
    k = stiffness.shape[-1]
    held = np.zeros((k, p, k, p))
    for node, (one, own) in enumerate(zip(shapes, cells, strict=True)):
        if not own.size:
            continue
        first, moved = own.min(axis=1) - beside, np.zeros(size)
        moved[tuple(own - first[:, None])] = one.data
        spectrum = fft.rfft2(moved)[..., None, None] * stiffness
        force = fft.irfft2(spectrum, size, axes=(0, 1)).reshape(-1, k * k)
        inside, weights = face.window(first, size)
        held[:, :, :, node] = (weights.T @ force[inside]).reshape(p, k, k).transpose(1, 0, 2)
    whole = held.reshape(k * p, k * p)
    whole = (whole + whole.T) / 2
    stiff = whole.diagonal()[:p]
    seen = np.tile(stiff > _SEEN * np.median(stiff), k)
    inner = linalg.inv(whole[np.ix_(seen, seen)])
    known = np.zeros_like(whole)
    known[np.ix_(seen, seen)] = (inner + inner.T) / 2
    return known


def _inverse_symbol(
    size: tuple[int, ...],
    spacing: tuple[float, float],
    wall: Influence,
    shear: Influence | None,
) -> NDArray[np.complex128]:
    """C^-1 (..., k, k) N/m of each wave on a periodic grid of this size, k = 1 or 3."""
    along, across = (
        d * np.fft.ifftshift(np.arange(n) - n // 2) for n, d in zip(size, spacing, strict=True)
    )
    x, y = np.meshgrid(along, across, indexing="ij")
    halves = [np.full(x.shape, d / 2) for d in spacing]
    normal = fft.rfft2(wall(x, y, *halves)).real
    if shear is None:
        return 1.0 / np.maximum(normal, _STIFFEST * normal.max())[..., None, None]
    parts = fft.rfft2(shear(x, y, *halves))
    (xx, xy, yy), (zx, zy) = parts[:3].real, 1j * parts[3:].imag
    rows = [[normal, zx, zy], [-zx, xx, xy], [-zy, xy, yy]]
    symbol = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    value, vector = np.linalg.eigh(symbol)
    value = np.maximum(value, _STIFFEST * value.max())
    return (vector / value[..., None, :]) @ vector.conj().swapaxes(-1, -2)


def in_elements(known: Array, nodes: Array) -> Array:
    """The part of `known` N (k, k) m/N that the compliance A (k, k) m/N of `nodes` has: no more than either, in all directions,

        N^(1/2) min(L, 1) N^(1/2),   N^(-1/2) A N^(-1/2) = V L V^T,

    so that nodes without it give way still, and a tread may be stiffer at once than N is.
    """
    seen = np.flatnonzero(known.diagonal() > 0.0)
    some = np.ix_(seen, seen)
    root = linalg.cholesky(known[some], lower=True)
    half = linalg.solve_triangular(root, (nodes[some] + nodes[some].T) / 2, lower=True)
    share, vectors = linalg.eigh(linalg.solve_triangular(root, half.T, lower=True))
    sides = root @ vectors
    out = np.zeros_like(known)
    out[some] = (sides * np.clip(share, 0.0, 1.0)) @ sides.T
    return out


def without(nodes: Array, known: Array | None) -> Array:
    """A compliance (r, k) m/N of `nodes` less what they have of the tread, `known` N in its first rows and columns."""
    if known is None:
        return nodes
    felt, n = nodes.copy(), len(known)
    felt[:n, :n] -= known
    return felt


def before_equilibrium(patch: Patch, known: Array, nodal_force: Array) -> Patch:
    """The patch before its equilibrium for nodes more rigid by `known` N (p, p), of the same unloaded shape.

    `nodal_force` (p,) N: the forces under which its gap was computed.
    """
    assert patch.weights is not None
    return replace(patch, gap=patch.gap - patch.weights @ (known @ nodal_force))
