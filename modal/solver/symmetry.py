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
from tireroad.modal.solver.fields import congruent, largest_entry, less, multiply, row_sum, rows_of
from tireroad.modal.solver.slicing import ALONE, ProcessGroup

# Largest entry of R A R - A relative to that of A. A symmetric state converges to about 1e-13; a
# road load, a slope of the footprint or a different mesh on one side gives 1e-6 and more.
TOLERANCE = 1e-11
_PROBES = 8  # random fields that tell whether an isometry leaves the matrix unchanged
_PIECES = 8  # of a part, formed one by one to save memory
_NEAR = 1e-6  # of the body's size: distance within which nodes are images of each other
_OFF_CENTER = 0.37  # of a cell of that size: zero and the mesh's round numbers lie inside of cells
_LONGEST = 4  # most nodes of a segment along the ring


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
    isometries = [_found(matrix, sites, isometry) for isometry in (MIRROR_Y, MIRROR_X)]
    if not any(isometries):
        isometries = [_found(matrix, sites, HALF_TURN)]
    return [symmetry for symmetry in isometries if symmetry]


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


@dataclass(frozen=True)
class RepeatingMatrix:
    """A matrix that repeats from segment to segment.

    `turn` (n, n) maps the components of all segments, in sequence, to the unknowns; `blocks`
    j -> A_j (d, d) sparse; `angle` (d,) within the segment, rad; `kept` (d, d) complex unitary: the
    columns that a symmetry keeps, None without one; `defect`: the norm of the change of the matrix
    in a rotation by one segment, in the units of its eigenvalues.

    A ring of equal segments is split by wave number. With tangential, axial and radial components
    at each node, the matrix of an axisymmetric state repeats from segment to segment: blocks A_j
    couple a segment with the j-th after it. The fields

        u_s = Re[e^{i n s alpha} v],  alpha = 2 pi / N,
        H_n v = lambda v,   H_n = sum_j e^{i n j alpha} A_j

    are decoupled for n = 0 ... N / 2; all but the first and, for even N, the last come in pairs
    (Thomas, Int. J. Numer. Meth. Eng. 14 (1979) 81). A symmetry that reverses the sense around the
    ring, a mirror or, with belts at an angle, the half turn, maps v to P conj(v), with P a signed
    permutation once each node's phase e^{i n delta} is taken out. On the fields that it keeps, H_n
    is real and symmetric. Without one, H_n = A + i B is solved as [[A, -B], [B, A]], which has each
    eigenvalue twice.
    """

    segments: int
    turn: sparse.csr_matrix
    blocks: dict[int, sparse.csr_matrix]
    angle: np.ndarray
    kept: sparse.csr_matrix | None
    defect: float

    @property
    def waves(self) -> range:
        """Wave numbers n."""
        return range(self.segments // 2 + 1)

    def single(self, n: int) -> bool:
        """Whether the modes of a wave number are single, not in pairs."""
        return n == 0 or 2 * n == self.segments

    def wave(self, n: int, team: ProcessGroup = ALONE) -> Wave:
        """The problem of one wave number, own rows of it in the team."""
        matrix, basis, copies = self._problem(n)
        return Wave(self, n, matrix[team.own(matrix.shape[0])], basis, copies)

    def _problem(self, n: int) -> tuple[sparse.csr_matrix, sparse.csr_matrix, int]:
        """Its whole matrix, its basis, and the number of copies of each of its eigenvalues."""
        size = len(self.angle)
        H = self._hermitian(n)
        if self.single(n):
            return H.real.tocsr(), sparse.identity(size, format="csr"), 1
        if self.kept is None:
            doubled = sparse.bmat([[H.real, -H.imag], [H.imag, H.real]], format="csr")
            unit = sparse.identity(size, format="csr")
            return doubled, sparse.hstack([unit, 1j * unit], format="csr"), 1
        basis = self._basis(n)
        return (basis.getH() @ H @ basis).real.tocsr(), basis, 2

    def _hermitian(self, n: int) -> sparse.csr_matrix:
        phase = 2j * np.pi * n / self.segments
        return sum(np.exp(phase * j) * block for j, block in self.blocks.items()).tocsr()

    def _basis(self, n: int) -> sparse.csr_matrix:
        return sparse.diags(np.exp(1j * n * self.angle)) @ self.kept

    def is_kept(self) -> bool:
        """Whether H_n is real on the kept fields, at a wave number that would show it."""
        n = max(1, self.segments // 3)
        basis = self._basis(n)
        H = (basis.getH() @ self._hermitian(n) @ basis).tocsr()
        return abs(H.imag).max() <= TOLERANCE * abs(H).max()


@dataclass(frozen=True)
class Wave:
    """The fields of one wave number.

    Own rows of a `matrix` (d, d), real symmetric; `basis` (., d) maps its vectors to v.
    """

    ring: RepeatingMatrix
    number: int
    matrix: sparse.csr_matrix
    basis: sparse.csr_matrix
    copies: int

    def fields(self, vectors: np.ndarray) -> np.ndarray:
        """Fields (n, k copies) on the ring; of a pair, first the one that the symmetry keeps.

        The pair is a cosine about the lowest point, then a sine.
        """
        N, v = self.ring.segments, self.basis @ vectors
        if self.copies == 2:
            v = np.stack([v, -1j * v], axis=-1).reshape(len(v), -1)
        phase = np.exp(2j * np.pi * self.number / N * np.arange(N))
        fields = (phase[:, None, None] * v).real.reshape(-1, v.shape[1])
        scale = np.sqrt((1 if self.ring.single(self.number) else 2) / N)
        return self.ring.turn @ (scale * fields)


def repeated(matrix: PETSc.Mat, sites: DofPositions) -> RepeatingMatrix | None:
    """The matrix (n, n) as a ring of as many equal segments as possible; None if it is not one.

    `sites` of all unknowns on every process. Collective.
    """
    if len(sites.component) % 3 or (sites.component.reshape(-1, 3) != np.arange(3)).any():
        return None
    points = sites.place[::3]
    angle = np.arctan2(points[:, 0], -points[:, 2]) % (2 * np.pi)
    near = _NEAR * np.abs(points).max(initial=0.0)
    circles = np.hypot(points[:, 0], points[:, 2])
    if not len(points) or circles.min() < near:
        return None
    places = len(np.unique(np.rint(angle / _NEAR).astype(int) % round(2 * np.pi / _NEAR)))
    for nodes in range(1, _LONGEST + 1):
        if places % nodes or places // nodes < 3:
            continue
        segments = _segments(points, angle, places // nodes, near)
        if segments is None:
            continue
        ring = _verified(matrix, points, angle, segments)
        if ring is not None:
            return ring
    return None


def _segments(points: np.ndarray, angle: np.ndarray, count: int, near: float) -> np.ndarray | None:
    """Nodes (segments, nodes of each) in one order; None if the segments are not equal."""
    alpha = 2 * np.pi / count
    segment = np.floor((angle + _NEAR) / alpha).astype(int) % count
    reach, rest = np.hypot(points[:, 0], points[:, 2]), angle - segment * alpha
    back = np.stack([reach * np.sin(rest), points[:, 1], reach * np.cos(rest)], axis=1)
    first = np.flatnonzero(segment == 0)
    if len(first) * count != len(points):
        return None
    distance, image = cKDTree(back[first]).query(back)
    order = segment * len(first) + image
    if distance.max() > near or len(np.unique(order)) != len(order):
        return None
    return np.argsort(order).reshape(count, -1)


def _verified(
    matrix: PETSc.Mat, points: np.ndarray, angle: np.ndarray, nodes: np.ndarray
) -> RepeatingMatrix | None:
    """The ring; None if rotation by one segment changes the matrix. Collective."""
    count, each = nodes.shape[0], 3 * nodes.shape[1]
    turn = _turned(angle, nodes.ravel())
    size = turn.shape[0]
    allowed = TOLERANCE * largest_entry(matrix)
    along = np.roll(np.arange(size), each)
    two = np.unique(turn[:, : 2 * each].tocoo().row)
    first = (turn[two][:, : 2 * each].T @ rows_of(matrix, two) @ turn).tocsr()
    if abs(first[each:] - first[:each][:, along]).max() > allowed:
        # A load shows on the second segment already: saves the product with all of them.
        return None
    local = congruent(matrix, turn)
    by_one = congruent(local, sparse.identity(size, format="csr")[:, along])
    difference = less(by_one, local)
    far, defect = largest_entry(difference), row_sum(difference)
    top = rows_of(local, np.arange(each)).tocoo()
    for item in (local, by_one, difference):
        item.destroy()
    if far > allowed:
        return None
    blocks = {}
    for j in np.unique(top.col // each):
        inside = top.col // each == j
        entries = top.data[inside], (top.row[inside], top.col[inside] - j * each)
        blocks[int(j)] = sparse.csr_matrix(entries, (each, each))
    own = nodes[0]
    within = np.where(angle[own] > np.pi, angle[own] - 2 * np.pi, angle[own])
    for along_axle in (1.0, -1.0):
        columns_left = _kept(points[own], within, 2 * np.pi / count, along_axle)
        if columns_left is not None:
            ring = RepeatingMatrix(count, turn, blocks, np.repeat(within, 3), columns_left, defect)
            if ring.is_kept():
                return ring
    return RepeatingMatrix(count, turn, blocks, np.repeat(within, 3), None, defect)


def _turned(angle: np.ndarray, order: np.ndarray) -> sparse.csr_matrix:
    """Tangential, axial and radial components of the nodes, in their order, to x, y, z."""
    size = 3 * len(order)
    sine, cosine = np.sin(angle[order]), np.cos(angle[order])
    unit, none = np.ones(len(order)), np.zeros(len(order))
    axes = np.array([[cosine, none, sine], [none, unit, none], [sine, none, -cosine]])
    rows = np.broadcast_to((3 * order + np.arange(3)[:, None])[:, None], axes.shape)
    columns = np.broadcast_to((3 * np.arange(len(order)) + np.arange(3)[:, None])[None], axes.shape)
    turn = sparse.csr_matrix((axes.ravel(), (rows.ravel(), columns.ravel())), (size, size))
    turn.eliminate_zeros()
    return turn


def _kept(
    points: np.ndarray, within: np.ndarray, alpha: float, along_axle: float
) -> sparse.csr_matrix | None:
    """Columns (d, d) that v -> P conj(v) keeps, for (x, y) -> (-x, `along_axle` y)."""
    near = _NEAR * np.abs(points).max(initial=0.0)
    reach = np.hypot(points[:, 0], points[:, 2])
    here, there = ((angle + _NEAR) % alpha for angle in (within, -within))
    place = np.stack([reach, points[:, 1], reach * here], axis=1)
    image = np.stack([reach, along_axle * points[:, 1], reach * there], axis=1)
    distance, partner = cKDTree(place).query(image)
    if distance.max(initial=0.0) > near or len(np.unique(partner)) != len(partner):
        return None
    sign = np.tile([-1.0, along_axle, 1.0], len(points))
    to = (3 * partner[:, None] + np.arange(3)).ravel()
    own = np.arange(len(to))
    fixed, first = own[own == to], own[own < to]
    root = np.sqrt(0.5)
    one, turned = np.full(len(first), root), sign[first] * root
    # Columns: e_a (or i e_a) of a node that is its own image; (e_a + s e_b) and i (e_a - s e_b) of
    # a pair.
    values = [np.where(sign[fixed] > 0, 1.0, 1j), one, turned, 1j * one, -1j * turned]
    rows = [fixed, first, to[first], first, to[first]]
    pair = len(fixed) + np.arange(len(first))
    columns = [np.arange(len(fixed)), pair, pair, pair + len(first), pair + len(first)]
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sparse.csr_matrix(entries, (len(own), len(own)))
