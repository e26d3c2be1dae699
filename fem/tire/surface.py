"""Gathering of nodal values on every process."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI


class Gather:
    """Gathers values at chosen lattice nodes on every process, in the order of `wanted`.

    `owned`: ids of this process's owned nodes; `wanted`: ids to gather, the same on all
    processes.
    """

    def __init__(self, comm: MPI.Comm, owned: np.ndarray, wanted: np.ndarray) -> None:
        self.comm = comm
        self.ids = wanted
        self.local = np.flatnonzero(np.isin(owned, wanted))  # owned blocks that are wanted
        order = np.argsort(wanted, kind="stable")
        # Their indices in `wanted`.
        self.place = order[np.searchsorted(wanted, owned[self.local], sorter=order)]

    def __call__(self, owned: np.ndarray) -> np.ndarray:
        """Values (nodes, ...) on every process from those at the owned nodes (owned, ...).
        Collective."""
        out = np.zeros((len(self.ids), *owned.shape[1:]))
        out[self.place] = owned[self.local]
        self.comm.Allreduce(MPI.IN_PLACE, out)
        return out
