"""How nodal values travel to every process."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI


class Gather:
    """Brings values at chosen lattice nodes from their owners to every process, in the order of ids.

    Arguments: the ids of this process's owned nodes, and the ids wanted (the same on all).
    """

    def __init__(self, comm: MPI.Comm, owned: np.ndarray, wanted: np.ndarray) -> None:
        self.comm = comm
        self.ids = wanted
        self.local = np.flatnonzero(np.isin(owned, wanted))  # owned blocks that were asked for
        order = np.argsort(wanted, kind="stable")
        # Where each of them goes.
        self.place = order[np.searchsorted(wanted, owned[self.local], sorter=order)]

    def __call__(self, owned: np.ndarray) -> np.ndarray:
        """(nodes, ...) on every process from the values at the owned nodes (owned, ...). Collective."""
        out = np.zeros((len(self.ids), *owned.shape[1:]))
        out[self.place] = owned[self.local]
        self.comm.Allreduce(MPI.IN_PLACE, out)
        return out
