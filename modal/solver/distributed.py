"""Products of a distributed sparse matrix with very sparse ones that every process holds whole."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.matrices.local_rows import from_local_rows


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
