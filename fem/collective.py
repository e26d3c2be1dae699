"""Collective operations on arrays and PETSc objects: sums, gathering, broadcast, release.

Arrays are sent as buffers. Pickling would make two further copies and is limited to 2 GB, the
largest byte count of an MPI message. Messages counted in numbers or rows may hold 16 GB and more;
of an object only the small remainder without its arrays is pickled.

PETSc objects that Python no longer references are released by `collect`. petsc4py does not destroy
them: an object may be distributed, and the garbage collectors of its processes run at different
times. PETSc keeps such objects until all processes of their communicator
call its cleanup. dolfinx gives each mesh a communicator of its own, which is freed with the mesh; a
small vector keeps it alive until the cleanup. Without this, a process that loads one tire after
another, as in a search or a notebook, kept all matrices and factors: 50 MB for each tire of 7,000
unknowns.
"""

from __future__ import annotations

import gc
import weakref
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI
from mpi4py.util import dtlib, pkl5
from petsc4py import PETSc
from scipy import sparse

T = TypeVar("T")
_kept: list[tuple[MPI.Comm, weakref.ref, PETSc.Vec]] = []


def summed(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """Sum of arrays of equal shape over all processes, on all of them. Collective."""
    if comm.size == 1:
        return values
    total = np.array(values, order="C")
    comm.Allreduce(MPI.IN_PLACE, total)
    return total


def allgather_rows(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """The arrays (n, ...) of all processes concatenated, on every process. Collective."""
    if comm.size == 1:
        return values
    rows = np.array(comm.allgather(len(values)))
    each = int(np.prod(values.shape[1:], dtype=int))
    every = np.empty((rows.sum(), *values.shape[1:]), values.dtype)
    row = dtlib.from_numpy_dtype(values.dtype).Create_contiguous(max(each, 1)).Commit()
    try:  # counts are rows: below 2^31 where the number of values is not
        comm.Allgatherv(
            [np.ascontiguousarray(values), row], [every, rows if each else 0 * rows, row]
        )
    finally:
        row.Free()
    return every


def same_on_all(comm: MPI.Comm, value: object) -> bool:
    """Whether a small object is equal on all processes. Collective."""
    return comm.size == 1 or len(set(comm.allgather(value))) == 1


def broadcast(comm: MPI.Comm, value: T, root: int = 0) -> T:
    """The object of `root` on every process; its arrays are sent as buffers. Collective."""
    if comm.size == 1:
        return value
    sent = pkl5.Intracomm(comm).bcast(value, root)
    # Root returns its own object, so that resources reached through it stay open.
    return value if comm.rank == root else sent


def watch(comm: MPI.Comm, owner: object, mesh: Any) -> None:
    """Let `collect(comm)` clean up the mesh's communicator until `owner` is gone. Collective."""
    keeper = PETSc.Vec().createMPI((0, PETSc.DETERMINE), comm=mesh.comm)
    _kept.append((comm, weakref.ref(owner), keeper))


def collect(comm: MPI.Comm) -> None:
    """Destroy the unreferenced PETSc objects of all meshes on `comm`. Collective."""
    gc.collect()
    PETSc.garbage_cleanup(PETSc.COMM_SELF)
    PETSc.garbage_cleanup(comm)
    ours = [kept for kept in _kept if kept[0] == comm]
    for _, _, keeper in ours:
        PETSc.garbage_cleanup(keeper.comm)
    alive = np.array([owner() is not None for _, owner, _ in ours], dtype=np.int8)
    comm.Allreduce(MPI.IN_PLACE, alive, MPI.MAX)
    for owned, lives in zip(ours, alive, strict=True):
        if not lives:
            _kept.remove(owned)
            owned[2].destroy()


def from_local_rows(local: sparse.csr_matrix, sizes: Any, comm: PETSc.Comm | MPI.Comm) -> PETSc.Mat:
    """The matrix with this process's rows `local`, by global columns; `sizes` as PETSc takes them.

    Collective.
    """
    index = (part.astype(PETSc.IntType, copy=False) for part in (local.indptr, local.indices))
    return PETSc.Mat().createAIJ(sizes, csr=(*index, local.data), comm=comm)
