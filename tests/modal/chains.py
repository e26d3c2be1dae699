"""Spring chains with eigenvalues in closed form, as distributed PETSc matrices; no finite elements."""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse


def distributed(matrix: sparse.spmatrix, comm=MPI.COMM_WORLD, unit: int = 1) -> PETSc.Mat:
    """A matrix given whole on every process, spread by rows in blocks of `unit`. Collective."""
    csr = sparse.csr_matrix(matrix)
    low, high = own_rows(csr.shape[0], comm, unit)
    part = csr[low:high]
    index = (part.indptr.astype(PETSc.IntType), part.indices.astype(PETSc.IntType))
    size = (high - low, csr.shape[0])
    return PETSc.Mat().createAIJ((size, size), csr=(*index, part.data), comm=comm)


def own_rows(size: int, comm=MPI.COMM_WORLD, unit: int = 1) -> tuple[int, int]:
    """This process's half-open range of rows."""
    units = size // unit
    return units * comm.rank // comm.size * unit, units * (comm.rank + 1) // comm.size * unit


def chain(n: int) -> tuple[sparse.csr_matrix, np.ndarray]:
    """n unit masses between two walls; lambda_k = 4 sin^2(k pi / (2 (n + 1))), ascending."""
    k = np.arange(1, n + 1)
    matrix = sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n), format="csr")
    return matrix, 4 * np.sin(k * np.pi / (2 * (n + 1))) ** 2


def ring(n: int) -> tuple[sparse.csr_matrix, np.ndarray]:
    """n unit masses in a circle: one rigid mode, all others double but the last of an even n."""
    matrix = sparse.lil_matrix(sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n)))
    matrix[0, n - 1] = matrix[n - 1, 0] = -1.0
    return matrix.tocsr(), np.sort(4 * np.sin(np.arange(n) * np.pi / n) ** 2)


def spatial(matrix: sparse.csr_matrix, stiffness: tuple[float, float, float]):
    """The same chain in three directions of their own stiffness, three dofs a node."""
    return sparse.kron(matrix, sparse.diags(stiffness), format="csr")
