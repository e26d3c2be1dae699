"""Fields over all unknowns, distributed by rows: products, and the order, sign and basis of the modes.

An eigensolver leaves the sign undetermined, and for a repeated eigenvalue the whole basis V (n, k).
Here

    r = the unknown whose row of V is longest,   v_1 = V V_r^T / |V_r|

and so on in the remainder of V. This depends on the space alone; v_1 has its largest component at
r, and it is positive. Lengths within a thousandth count as equal, and the first by position is
taken, so that a symmetric mode has a unique sign too. The modes are the same on any number of
processes to rounding, sign and order included.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.collective import from_local_rows, summed
from tireroad.fem.matrices.operators import Compound
from tireroad.modal.solver.slicing import ProcessGroup, Slice, SymmetricPart

_AT_ONCE = 16  # vectors that one process holds whole
CHUNK = 64  # columns per matrix product, to avoid a second copy of all vectors
_ROWS = 4096  # of all vectors at a time, when they are changed in place
_BETWEEN = 4 * CHUNK  # per product with all vectors: with 64, BLAS packs them half of the time
# Defect above which a correction pays: neighbouring slices are orthogonal to about 1e-11.
_REPAIR = 1e-12
_SAME_LENGTH = 1e-3  # relative


def congruent(matrix: PETSc.Mat, basis: sparse.csr_matrix) -> PETSc.Mat:
    """B^T A B, distributed by rows, for a real B (n, d) whole on every process. Collective."""
    size, columns = basis.shape
    start, end = matrix.getOwnershipRange()
    own = basis[start:end]
    across = end - start if columns == size else PETSc.DECIDE  # distributed as A, where possible
    spread = from_local_rows(own, ((end - start, size), (across, columns)), matrix.comm)
    product = matrix.ptap(spread)
    spread.destroy()
    return product


def rows_of(matrix: PETSc.Mat, wanted: np.ndarray) -> sparse.csr_matrix:
    """Rows (k, n) of the matrix at the ascending indices `wanted`, which differ by process.
    Collective.
    """
    indices = np.asarray(wanted).astype(PETSc.IntType, copy=False)
    rows = PETSc.IS().createGeneral(indices, comm=PETSc.COMM_SELF)
    every = PETSc.IS().createStride(matrix.getSize()[1], first=0, step=1, comm=PETSc.COMM_SELF)
    (found,) = matrix.createSubMatrices(rows, every)
    indptr, indices, values = found.getValuesCSR()
    size = found.getSize()
    for one in (rows, every, found):
        one.destroy()
    return sparse.csr_matrix((values, indices, indptr), size)


def largest_entry(matrix: PETSc.Mat) -> float:
    """Largest magnitude of an entry. Collective."""
    values = matrix.getValuesCSR()[2]
    return matrix.comm.tompi4py().allreduce(float(np.abs(values).max(initial=0.0)), MPI.MAX)


def row_sum(matrix: PETSc.Mat) -> float:
    """Largest row sum of magnitudes, an upper bound on the eigenvalues of a symmetric matrix.
    Collective.
    """
    return float(matrix.norm(PETSc.NormType.NORM_INFINITY))


def less(matrix: PETSc.Mat, other: PETSc.Mat) -> PETSc.Mat:
    """A - B. Collective."""
    difference = matrix.copy()
    difference.axpy(-1.0, other, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    return difference


def scaled_by(stiffness: PETSc.Mat, mass: np.ndarray) -> PETSc.Mat:
    """M^-1/2 K M^-1/2 for a diagonal mass (own rows). Collective."""
    scaled = stiffness.copy()
    roots = scaled.createVecLeft()
    roots.array[:] = 1 / np.sqrt(mass)
    scaled.diagonalScale(roots, roots)
    scaled.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    roots.destroy()
    return scaled


def everywhere(matrix: PETSc.Mat) -> sparse.csr_matrix:
    """The whole matrix on every process. Collective."""
    size = matrix.getSize()[0]
    every = PETSc.IS().createStride(size, first=0, step=1, comm=PETSc.COMM_SELF)
    (whole,) = matrix.createSubMatrices(every, every)
    rows, columns, values = whole.getValuesCSR()
    every.destroy()
    whole.destroy()
    return sparse.csr_matrix((values, columns, rows), (size, size))


def collect(
    matrix: PETSc.Mat,
    parts: Sequence[SymmetricPart],
    found: list[Slice],
    order: np.ndarray,
    team: ProcessGroup,
) -> np.ndarray:
    """This process's rows of the vectors in the given order. Collective.

    The first process of the team that has the vectors sends them a few at a time, and holds no more
    than those whole.
    """
    comm = matrix.comm.tompi4py()
    ranges = np.asarray(matrix.getOwnershipRanges())
    own = int(ranges[comm.rank + 1] - ranges[comm.rank])
    column = np.full(sum(len(one.values) for one in found), -1)
    column[order] = np.arange(len(order))
    vectors = np.empty((own, len(order)), order="F")
    start = 0
    for one in found:
        copies = parts[one.part].copies
        for first in range(0, len(one.values) // copies, _AT_ONCE):
            last = min(first + _AT_ONCE, len(one.values) // copies)
            place = column[start + first * copies : start + last * copies]
            wanted = place >= 0
            width = int(wanted.sum())
            if not width:
                continue
            sent, rows = None, np.empty((own, width))
            if one.vectors is not None:  # in its team only
                shapes = team.at_root(one.vectors[:, first:last])
                if shapes is not None:
                    fields = parts[one.part].fields(shapes)[:, wanted]
                    counts = np.diff(ranges) * width, ranges[:-1] * width
                    sent = [np.ascontiguousarray(fields), *counts, MPI.DOUBLE]
            comm.Scatterv(sent, rows, root=one.owner)
            vectors[:, place[wanted]] = rows
        start += len(one.values)
    return vectors


def multiply(matrix: PETSc.Mat, vectors: np.ndarray) -> np.ndarray:
    """This process's rows of matrix @ vectors, for vectors given by rows (n, m). Collective."""
    rows, columns = vectors.shape
    out = np.empty((rows, columns), order="F")
    for start in range(0, columns, CHUNK):
        some = np.asfortranarray(vectors[:, start : start + CHUNK])
        sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, some.shape[1]))
        dense = PETSc.Mat().createDense(sizes, array=some, comm=matrix.comm)
        product = matrix.matMult(dense)
        out[:, start : start + CHUNK] = product.getDenseArray()
        product.destroy()
        dense.destroy()
    return out


def gram(comm: MPI.Comm, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left^T right over all processes, rows distributed alike. Collective."""
    return summed(comm, left.T @ right)


def between(comm: MPI.Comm, left: np.ndarray, matrix: PETSc.Mat, right: np.ndarray) -> np.ndarray:
    """left^T matrix right (m, k) over all processes, in blocks of columns to save memory.
    Collective.
    """
    out = np.empty((left.shape[1], right.shape[1]))
    for start in range(0, right.shape[1], _BETWEEN):
        some = slice(start, start + _BETWEEN)
        out[:, some] = left.T @ multiply(matrix, right[:, some])
    return summed(comm, out)


def orthonormalise(comm: MPI.Comm, vectors: np.ndarray, part: np.ndarray) -> float:
    """Correct V in place where slices meet; the largest entry of V^T V - 1 afterwards. Collective.

    One Newton-Schulz step V (3 - V^T V) / 2 squares the defect and changes no vector by more than
    the defect. `part` (m,) is the part of each vector; those of different parts are orthogonal by
    construction.
    """
    worst = 0.0
    for one in np.unique(part):
        columns = np.flatnonzero(part == one)
        mine = vectors if len(columns) == len(part) else vectors[:, columns]
        defect = gram(comm, mine, mine) - np.eye(len(columns))
        if np.abs(defect).max() > _REPAIR:
            # Leave what is rounding already: mixing it in would carry stiff modes into soft ones.
            change = np.where(np.abs(defect) > _REPAIR / 10, defect, 0.0) / 2
            for start in range(0, len(mine), _ROWS):
                mine[start : start + _ROWS] -= mine[start : start + _ROWS] @ change
            if mine is not vectors:
                vectors[:, columns] = mine
            defect = gram(comm, mine, mine) - np.eye(len(columns))
        worst = max(worst, float(np.abs(defect).max()))
    return worst


def projected(
    comm: MPI.Comm, vectors: np.ndarray, matrix: PETSc.Mat, sign: int, known: np.ndarray | None
) -> np.ndarray:
    """V^T X V (m, m), symmetric (sign 1) or skew (-1); `known` (k, k) is its upper left part.

    Collective.
    """
    m, k = vectors.shape[1], 0 if known is None else len(known)
    upper = np.zeros((m, m))
    for start in range(k, m, _BETWEEN):
        end = min(start + _BETWEEN, m)  # the part below follows by symmetry: half of the work
        upper[:end, start:end] = vectors[:, :end].T @ multiply(matrix, vectors[:, start:end])
    upper = summed(comm, upper)
    for start in range(k, m, _BETWEEN):
        own = upper[start : start + _BETWEEN, start : start + _BETWEEN]
        own[:] = (own + sign * own.T) / 2
        upper[start : start + _BETWEEN, :start] = sign * upper[:start, start : start + _BETWEEN].T
    if known is not None:
        upper[:k, :k] = known
    return upper


def strain_energies(
    vectors: np.ndarray, compounds: Sequence[Compound], comm: MPI.Comm
) -> np.ndarray:
    """phi . K_c phi (c, m) 1/s2 of fields (n, m) of unit modal mass, own rows. Collective."""
    stored = np.empty((len(compounds), vectors.shape[1]))
    for start in range(0, vectors.shape[1], CHUNK):
        some = vectors[:, start : start + CHUNK]
        for row, compound in zip(stored, compounds, strict=True):
            row[start : start + CHUNK] = (some * multiply(compound.stiffness, some)).sum(axis=0)
    return summed(comm, stored)


def ordered(values: np.ndarray, family: np.ndarray, same: float) -> tuple[np.ndarray, np.ndarray]:
    """The order of the values (k,), and the group (k,) of each in that order.

    Values ascend; equal ones (to the relative distance `same` from one to the next) are ordered by
    family (k,). A group is the equal values of one family.
    """
    order = np.argsort(values, kind="stable")
    step = np.diff(values[order]) > same * np.abs(values[order][1:])
    level = np.concatenate([[0], np.cumsum(step)])
    order = order[np.lexsort((family[order], level))]
    change = step | (np.diff(family[order]) != 0)
    return order, np.concatenate([[0], np.cumsum(change)])


def normalise_modes(
    comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray, group: np.ndarray
) -> None:
    """Fix signs, and bases of groups (m,) of more than one column, of own rows (n, m) in place.
    Collective.

    `rank` (n,) of own rows in an order of all rows that does not depend on the processes.
    """
    first, size = np.unique(group, return_index=True, return_counts=True)[1:]
    alone = first[size == 1]
    for start in range(0, len(alone), CHUNK):
        some = alone[start : start + CHUNK]
        vectors[:, some] *= _signs(comm, vectors[:, some], rank)
    for begin, count in zip(first[size > 1], size[size > 1], strict=True):
        vectors[:, begin : begin + count] = _based(comm, vectors[:, begin : begin + count], rank)


def _signs(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Signs (m,) of the largest component of each column, the first by rank among equals.
    Collective.
    """
    size = np.abs(vectors)
    largest = _over_all(comm, size.max(axis=0, initial=0.0), MPI.MAX)
    place = np.where(size >= (1 - _SAME_LENGTH) * largest, rank[:, None], np.iinfo(int).max)
    foremost = place.min(axis=0, initial=np.iinfo(int).max)
    winner = _over_all(comm, foremost, MPI.MIN)
    sign = np.zeros(vectors.shape[1])
    mine = np.flatnonzero(foremost == winner)
    if len(vectors):
        sign[mine] = np.sign(vectors[place.argmin(axis=0)[mine], mine])
    return _over_all(comm, sign, MPI.SUM)


def _based(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """V (n, k) rotated to the basis that the rule gives its space. Collective."""
    k = vectors.shape[1]
    turn, left = np.zeros((k, 0)), vectors
    for _ in range(k):
        row = _longest_row(comm, left, rank)
        row = row - turn @ (turn.T @ row)
        turn = np.column_stack([turn, row / np.linalg.norm(row)])
        left = vectors - (vectors @ turn) @ turn.T
    return vectors @ turn


def _longest_row(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """The longest row (k,) over all processes, the first by rank among equals. Collective."""
    length = np.linalg.norm(vectors, axis=1)
    largest = comm.allreduce(float(length.max(initial=0.0)), op=MPI.MAX)
    place = np.where(length >= (1 - _SAME_LENGTH) * largest, rank, np.iinfo(int).max)
    foremost = int(place.min(initial=np.iinfo(int).max))
    row = np.zeros(vectors.shape[1])
    if foremost == comm.allreduce(foremost, op=MPI.MIN):
        row = vectors[place.argmin()].copy()
    return _over_all(comm, row, MPI.SUM)


def _over_all(comm: MPI.Comm, values: np.ndarray, operation: MPI.Op) -> np.ndarray:
    out = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), out, op=operation)
    return out
