"""Symmetries of a tire: found from its nodes, verified on its matrix, used to split the problem.

An isometry R of order two (it moves nodes and changes signs of components) with R A R = A decouples
symmetric from antisymmetric fields: two problems of half the size, or four with two mirrors. Belts
at +-alpha at different depths break both mirrors of a loaded tire at rest and leave their product,
the half turn about the vertical.

The parts are Q^T A Q. What couples them is rounding of A, whose entries are symmetric to about
1e-13 of the largest. It changes an eigenvalue by at most |R A R - A| / 2. The residual on A itself,
a bound on twice the relative error of a frequency, is measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial import cKDTree

from tireroad.fem.collective import allgather_rows
from tireroad.modal.solver.fields import largest_entry, multiply, rows_of
from tireroad.modal.solver.slicing import ProcessGroup

# Largest entry of R A R - A relative to that of A. A symmetric state converges to about 1e-13; a
# road load, a slope of the footprint or a different mesh on one side gives 1e-6 and more.
TOLERANCE = 1e-11
_PROBES = 8  # random fields that tell whether an isometry leaves the matrix unchanged
_PIECES = 8  # of a part, formed one by one to save memory
_NEAR = 1e-6  # of the body's size: distance within which nodes are images of each other
_OFF_CENTER = 0.37  # of a cell of that size: zero and the mesh's round numbers lie inside of cells


@dataclass(frozen=True)
class Isometry:
    """The map (x, y, z) -> flip (x, y, z), its own inverse."""

    name: str
    flip: tuple[float, float, float]

    def sign(self, component: int) -> float:
        """Sign of the image of a displacement (0-2) or a rotation (3-5), which mirrors reverse."""
        if component < 3:
            return self.flip[component]
        return self.flip[component - 3] * float(np.prod(self.flip))


MIRROR_Y = Isometry("mirror plane y = 0", (1.0, -1.0, 1.0))
MIRROR_X = Isometry("mirror plane x = 0", (-1.0, 1.0, 1.0))
HALF_TURN = Isometry("half turn about z", (-1.0, -1.0, 1.0))


@dataclass(frozen=True)
class DofPositions:
    """The positions of the unknowns.

    `place` (n, 3) m, undeformed; `component` (n,): 0, 1, 2 for displacements along x, y, z and 3,
    4, 5 for rotations about them.
    """

    place: np.ndarray
    component: np.ndarray

    @staticmethod
    def of_nodes(points: np.ndarray) -> DofPositions:
        """Three displacements at each of the points (k, 3)."""
        return DofPositions(np.repeat(points, 3, axis=0), np.tile(np.arange(3), len(points)))

    def everywhere(self, comm: MPI.Comm) -> DofPositions:
        """The sites of all processes, concatenated. Collective."""
        return DofPositions(*(allgather_rows(comm, part) for part in vars(self).values()))

    def rank(self) -> np.ndarray:
        """(n,) rank of each unknown, ordered by position, lowest points first, then by component.

        It is the same for the same tire on any number of processes and with any release of the
        libraries: coordinates that rounding parts count as equal.
        """
        cells = self.place / (_NEAR * max(float(np.abs(self.place).max(initial=0.0)), 1e-300))
        x, y, z = np.floor(cells + _OFF_CENTER).T
        order = np.lexsort((self.component, x, y, z))
        rank = np.empty(len(order), int)
        rank[order] = np.arange(len(order))
        return rank


@dataclass(frozen=True)
class Sector:
    """An invariant subspace of a group of symmetries.

    `basis` (n, d) is an isometry onto its fields; `matrix` has this process's rows, in its team, of
    A on them.
    """

    basis: sparse.csr_matrix
    matrix: sparse.csr_matrix
    copies: int = 1

    def fields(self, vectors: np.ndarray) -> np.ndarray:
        """Fields (n, k) from vectors (d, k)."""
        return self.basis @ vectors


def whole(matrix: PETSc.Mat, team: ProcessGroup) -> Sector:
    """The undivided problem. Collective."""
    size = matrix.getSize()[0]
    return Sector(sparse.identity(size, format="csr"), _own_rows(matrix, team))


def _own_rows(matrix: PETSc.Mat, team: ProcessGroup) -> sparse.csr_matrix:
    own = team.own(matrix.getSize()[0])
    return rows_of(matrix, np.arange(own.start, own.stop))


@dataclass(frozen=True)
class Symmetry:
    """An isometry that leaves a matrix A unchanged.

    `image` is its signed permutation R (n, n); `defect` a bound on the norm of R A R - A, from an
    estimate of its rows, in the units of the eigenvalues: the rounding or slight asymmetry of A.
    """

    isometry: Isometry
    image: sparse.csr_matrix
    defect: float


def symmetries(matrix: PETSc.Mat, sites: DofPositions) -> list[Symmetry]:
    """Independent symmetries of the matrix (n, n), with the `sites` of all its unknowns.
    Collective.

    The two mirrors are tried first. The half turn is their product, so it is tried only where there
    is neither.
    """
    found = [_found(matrix, sites, isometry) for isometry in (MIRROR_Y, MIRROR_X)]
    if not any(found):
        found = [_found(matrix, sites, HALF_TURN)]
    return [symmetry for symmetry in found if symmetry]


def _found(matrix: PETSc.Mat, sites: DofPositions, isometry: Isometry) -> Symmetry | None:
    image = _permutation(sites, isometry)
    if image is None:
        return None
    entries = int(np.diff(matrix.getValuesCSR()[0]).max(initial=0))
    spread = np.sqrt(matrix.comm.tompi4py().allreduce(entries, MPI.MAX))
    length = _change(matrix, image)
    if length > TOLERANCE * largest_entry(matrix) * spread:
        return None
    return Symmetry(isometry, image, float(spread * length))


def _change(matrix: PETSc.Mat, image: sparse.csr_matrix) -> float:
    """Estimated length of the longest row of D = R A R - A.

    The mean square of row i of D v over random v of +-1 is the sum of its squared entries, and the
    largest of the estimates is rarely too small. A hundredth of the cost of R A R. Collective.
    """
    comm, own = matrix.comm.tompi4py(), slice(*matrix.getOwnershipRange())
    signs = np.random.default_rng(11).choice([-1.0, 1.0], (matrix.getSize()[0], _PROBES))
    straight = multiply(matrix, signs[own])
    turned = image[own] @ allgather_rows(comm, multiply(matrix, (image @ signs)[own]))
    length = np.sqrt(((turned - straight) ** 2).mean(axis=1)).max(initial=0.0)
    return comm.allreduce(float(length), MPI.MAX)


def sectors(matrix: PETSc.Mat, images: list[sparse.csr_matrix], team: ProcessGroup) -> list[Sector]:
    """The parts into which commuting signed permutations of order two split a symmetric matrix.

    Without any it stays whole. Collective.
    """
    bases = [sparse.identity(matrix.getSize()[0], format="csr")]
    for image in images:
        bases = [half for basis in bases for half in _halves(basis, image)]
    return [_sector(matrix, basis, team) for basis in bases]


def _sector(matrix: PETSc.Mat, basis: sparse.csr_matrix, team: ProcessGroup) -> Sector:
    """Q^T A Q from the rows of A that each piece of Q reaches. Collective."""
    own, columns = team.own(basis.shape[1]), basis.tocsc()
    parts = []
    for some in np.array_split(np.arange(own.start, own.stop), _PIECES):
        piece = columns[:, some]
        rows = np.unique(piece.indices)
        parts.append(piece.tocsr()[rows].T @ (rows_of(matrix, rows) @ basis))
    part = sparse.vstack(parts, format="csr")
    part.sort_indices()
    return Sector(basis, part)


def _permutation(sites: DofPositions, isometry: Isometry) -> sparse.csr_matrix | None:
    """The signed permutation that maps a field to its image; None if an unknown has no image."""
    size = len(sites.component)
    image, sign = np.empty(size, int), np.empty(size)
    near = _NEAR * np.abs(sites.place).max(initial=0.0)
    for component in np.unique(sites.component):
        same = np.flatnonzero(sites.component == component)
        points = sites.place[same]
        distance, partner = cKDTree(points).query(points * isometry.flip)
        if distance.max(initial=0.0) > near or len(np.unique(partner)) != len(partner):
            return None
        image[same] = same[partner]
        sign[same] = isometry.sign(component)
    return sparse.csr_matrix((sign, (image, np.arange(size))), (size, size))


def _halves(basis: sparse.csr_matrix, image: sparse.csr_matrix) -> list[sparse.csr_matrix]:
    """The symmetric and the antisymmetric part of a space that the isometry maps onto itself."""
    size = basis.shape[1]
    inner = (basis.T @ image @ basis).tocoo()  # a signed permutation again, besides rounded zeros
    real = np.abs(inner.data) > 0.5
    partner, sign = np.empty(size, int), np.empty(size)
    partner[inner.col[real]], sign[inner.col[real]] = inner.row[real], np.sign(inner.data[real])
    own = np.arange(size)
    pairs = own[own < partner]
    halves = []
    for parity in (1.0, -1.0):
        fixed = own[(own == partner) & (sign == parity)]
        count = len(pairs) + len(fixed)
        rows = np.concatenate([pairs, fixed, partner[pairs]])
        columns = np.concatenate([np.arange(count), np.arange(len(pairs))])
        root = np.full(len(pairs), np.sqrt(0.5))
        values = np.concatenate([root, np.ones(len(fixed)), parity * sign[pairs] * root])
        halves.append((basis @ sparse.csr_matrix((values, (rows, columns)), (size, count))).tocsr())
    return [half for half in halves if half.shape[1]]
