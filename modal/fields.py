"""Fields over all unknowns, spread by rows over the processes, many at once."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.modal.spectrum import Slice

CHUNK = 64  # columns a matrix product: no second copy of all vectors


def scaled_by(stiffness: PETSc.Mat, mass: np.ndarray) -> PETSc.Mat:
    """M^-1/2 K M^-1/2 of a diagonal mass (own rows). Collective."""
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


def collect(matrix: PETSc.Mat, bases, found: list[Slice], order: np.ndarray) -> np.ndarray:
    """This process's rows of the vectors in the given order, each slice sent by its owner. Collective."""
    comm = matrix.comm.tompi4py()
    ranges = matrix.getOwnershipRanges()
    column = np.full(sum(len(one.values) for one in found), -1)
    column[order] = np.arange(len(order))
    vectors = np.empty((ranges[comm.rank + 1] - ranges[comm.rank], len(order)), order="F")
    start = 0
    for one in found:
        place = column[start : start + len(one.values)]
        start += len(one.values)
        wanted = place >= 0
        if not wanted.any():
            continue
        parts = None
        if one.owner == comm.rank:
            full = bases[one.matrix] @ one.vectors[:, wanted]
            parts = [full[low:high] for low, high in zip(ranges, ranges[1:], strict=False)]
        vectors[:, place[wanted]] = comm.scatter(parts, root=one.owner)
    return vectors


def multiply(matrix: PETSc.Mat, vectors: np.ndarray) -> np.ndarray:
    """This process's rows of matrix @ vectors, vectors given by rows (n, m). Collective."""
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
    return comm.allreduce(left.T @ right)
