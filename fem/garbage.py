"""Memory of PETSc objects that nobody holds any more.

petsc4py does not destroy what Python lets go of: such an object may be spread over processes, whose collectors run
at different times. PETSc keeps it until all processes of its communicator ask together. dolfinx gives each mesh a
communicator of its own, which goes with the mesh, so a small vector keeps each for that. Without this a process
that loads one tire after the other, in a search or a notebook, grew by all their matrices and factors: 50 MB for
each of 7,000 unknowns.
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
    """From now on `collect(comm)` frees what is left on the communicator of the mesh, until `owner` has gone too.
    Collective on comm."""
    keeper = PETSc.Vec().createMPI((0, PETSc.DETERMINE), comm=mesh.comm)
    _kept.append((comm, weakref.ref(owner), keeper))


def collect(comm: MPI.Comm) -> None:
    """Destroy the PETSc objects of all meshes on `comm` that no process holds any more. Collective."""
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
