"""Distributed sparse matrices from the rows of each process."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse


def from_local_rows(local: sparse.csr_matrix, sizes: Any, comm: PETSc.Comm | MPI.Comm) -> PETSc.Mat:
    """The matrix with this process's rows `local`, by global columns; `sizes` as PETSc takes them.

    Collective.
    """
    index = (part.astype(PETSc.IntType, copy=False) for part in (local.indptr, local.indices))
    return PETSc.Mat().createAIJ(sizes, csr=(*index, local.data), comm=comm)
