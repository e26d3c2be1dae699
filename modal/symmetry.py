"""Mirror planes of a tire: found from its nodes, verified on its matrix, and used to split the problem.

A mirror R (reflect the nodes, change the sign of one component) with R A R = A leaves the symmetric
and the antisymmetric fields to themselves: two problems of half the size. Two mirrors make four.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.spatial import cKDTree

# Largest entry of R A R - A relative to that of A: a symmetric state converges to about 1e-13; a road
# load, a slope of the footprint or another mesh on one side gives 1e-6 and more.
TOLERANCE = 1e-11
_NEAR = 1e-6  # of the body's size: nodes are mirror images


@dataclass(frozen=True)
class Sites:
    """Where unknowns sit: `place` (n, 3) m, undeformed, and `component` (n,): 0, 1, 2 motion along x, y, z,
    3, 4, 5 rotation about them.
    """

    place: np.ndarray
    component: np.ndarray

    @staticmethod
    def of_nodes(points: np.ndarray) -> Sites:
        """Three unknowns at each of the points (k, 3)."""
        return Sites(np.repeat(points, 3, axis=0), np.tile(np.arange(3), len(points)))

    def everywhere(self, comm: MPI.Comm) -> Sites:
        """Those of all processes, one after the other. Collective."""
        return Sites(*(np.concatenate(comm.allgather(part)) for part in vars(self).values()))


def sectors(
    matrix: sparse.csr_matrix, sites: Sites, axes: tuple[int, ...] = (1, 0)
) -> list[sparse.csr_matrix]:
    """Isometries Q (n, k) onto the invariant spaces of the mirrors that the matrix has; [1] without any.

    `matrix` (n, n) symmetric, `sites` of all its unknowns; `axes` the normals of the mirror planes
    through the origin that are tried (y, then x). Not collective.
    """
    bases = [sparse.identity(matrix.shape[0], format="csr")]
    for axis in axes:
        mirror = _mirror(sites, axis)
        if mirror is not None and _invariant(matrix, mirror):
            bases = [half for basis in bases for half in _halves(basis, mirror)]
    return bases


def _mirror(sites: Sites, axis: int) -> sparse.csr_matrix | None:
    """The signed permutation that reflects a field, or None when an unknown has no mirror image."""
    flip = np.ones(3)
    flip[axis] = -1.0
    size = len(sites.component)
    image, sign = np.empty(size, int), np.empty(size)
    near = _NEAR * np.abs(sites.place).max(initial=0.0)
    for component in np.unique(sites.component):
        same = np.flatnonzero(sites.component == component)
        points = sites.place[same]
        distance, partner = cKDTree(points).query(points * flip)
        if distance.max(initial=0.0) > near or len(np.unique(partner)) != len(partner):
            return None
        image[same] = same[partner]
        # A rotation is mirrored the other way round than a motion.
        sign[same] = flip[component] if component < 3 else -flip[component - 3]
    return sparse.csr_matrix((sign, (image, np.arange(size))), (size, size))


def _invariant(matrix: sparse.csr_matrix, mirror: sparse.csr_matrix) -> bool:
    largest = abs(matrix).max()
    return abs(mirror @ matrix @ mirror.T - matrix).max() <= TOLERANCE * largest


def _halves(basis: sparse.csr_matrix, mirror: sparse.csr_matrix) -> list[sparse.csr_matrix]:
    """The symmetric and the antisymmetric part of a space that the mirror maps onto itself."""
    size = basis.shape[1]
    inner = (basis.T @ mirror @ basis).tocoo()  # again a signed permutation, beside rounded zeros
    real = np.abs(inner.data) > 0.5
    image, sign = np.empty(size, int), np.empty(size)
    image[inner.col[real]], sign[inner.col[real]] = inner.row[real], np.sign(inner.data[real])
    own = np.arange(size)
    pairs = own[own < image]
    halves = []
    for parity in (1.0, -1.0):
        fixed = own[(own == image) & (sign == parity)]
        count = len(pairs) + len(fixed)
        rows = np.concatenate([pairs, fixed, image[pairs]])
        columns = np.concatenate([np.arange(count), np.arange(len(pairs))])
        root = np.full(len(pairs), np.sqrt(0.5))
        values = np.concatenate([root, np.ones(len(fixed)), parity * sign[pairs] * root])
        halves.append((basis @ sparse.csr_matrix((values, (rows, columns)), (size, count))).tocsr())
    return [half for half in halves if half.shape[1]]
