"""The outer face as a grid of nodes, and how nodal values travel to every process."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.tire.mesh import Lattice


class Gather:
    """Brings values at chosen lattice nodes from their owners to every process, in the order of ids.

    Arguments: the ids of this process's owned nodes, and the ids wanted (ascending, the same on all).
    """

    def __init__(self, comm: MPI.Comm, owned: np.ndarray, wanted: np.ndarray):
        self.comm = comm
        self.ids = wanted
        self.local = np.flatnonzero(np.isin(owned, wanted))  # owned blocks that were asked for
        self.place = np.searchsorted(wanted, owned[self.local])  # where each goes

    def __call__(self, owned: np.ndarray) -> np.ndarray:
        """(nodes, ...) on every process from the values at the owned nodes (owned, ...). Collective."""
        out = np.zeros((len(self.ids), *owned.shape[1:]))
        out[self.place] = owned[self.local]
        self.comm.Allreduce(MPI.IN_PLACE, out)
        return out


def outer_face(lattice: Lattice) -> np.ndarray:
    """Ids of the nodes of the outer face, ascending: around the axle, then bead to bead."""
    around, wall, along = lattice.shape
    i, j = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    return np.ravel_multi_index((i, np.full_like(i, wall - 1), j), lattice.shape).ravel()
