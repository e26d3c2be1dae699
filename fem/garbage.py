"""Release of PETSc objects that Python no longer references.

petsc4py does not destroy them: an object may be distributed, and the garbage collectors of its
processes run at different times. PETSc keeps such objects until all processes of their communicator
call its cleanup. dolfinx gives each mesh a communicator of its own, which is freed with the mesh; a
small vector keeps it alive until the cleanup. Without this, a process that loads one tire after
another, as in a search or a notebook, kept all matrices and factors: 50 MB for each tire of 7,000
unknowns.
"""

from __future__ import annotations

import gc
import weakref
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

_kept: list[tuple[MPI.Comm, weakref.ref, PETSc.Vec]] = []


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
    for one, lives in zip(ours, alive, strict=True):
        if not lives:
            _kept.remove(one)
            one[2].destroy()
