"""Operations on many fields over all unknowns, distributed by rows over the processes.

Among them products with very sparse matrices that every process holds whole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.collective import from_local_rows, summed
from tireroad.modal.solver.slicing import Modes, Part, Slice, Team


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


_AT_ONCE = 16  # vectors that one process holds whole
CHUNK = 64  # columns per matrix product, to avoid a second copy of all vectors
_BETWEEN = 4 * CHUNK  # per product with all vectors: with 64, BLAS packs them half of the time
# Defect above which a correction pays: neighbouring slices are orthogonal to about 1e-11.
_REPAIR = 1e-12


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
    matrix: PETSc.Mat, parts: Sequence[Part], found: list[Slice], order: np.ndarray, team: Team
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
        mine = vectors[:, columns]
        defect = gram(comm, mine, mine) - np.eye(len(columns))
        if np.abs(defect).max() > _REPAIR:
            # Leave what is rounding already: mixing it in would carry stiff modes into soft ones.
            mine -= mine @ (np.where(np.abs(defect) > _REPAIR / 10, defect, 0.0) / 2)
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
    out = np.empty((m, m))
    out[:, k:] = between(comm, vectors, matrix, vectors[:, k:])
    own = out[k:, k:]
    out[k:, k:] = (own + sign * own.T) / 2
    out[k:, :k] = sign * out[:k, k:].T
    if known is not None:
        out[:k, :k] = known
    return out


def loss_factors(
    modes: Modes, loss: PETSc.Mat, comm: MPI.Comm, known: np.ndarray | None
) -> np.ndarray:
    """eta_k = phi . sum_r eta_r K_r phi / omega_k^2 (m,) of mass-normalised modes, rigid ones 0.

    `known`: the values of the first modes, which are reused. Collective.
    """
    done = np.zeros(0) if known is None else known
    lost = np.empty(modes.vectors.shape[1] - len(done))
    for start in range(0, len(lost), CHUNK):
        some = modes.vectors[:, len(done) + start : len(done) + start + CHUNK]
        lost[start : start + CHUNK] = (some * multiply(loss, some)).sum(axis=0)
    squares = modes.squares[len(done) :]
    eta = np.divide(comm.allreduce(lost), squares, out=np.zeros(len(squares)), where=squares > 0)
    return np.concatenate([done, eta])
