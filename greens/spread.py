"""Distribution of the states of a shared loop over the processes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import joined


@dataclass(frozen=True)
class Spread:
    """States dealt in turn to the processes of `comm`, except the first `idle` ones."""

    comm: MPI.Comm
    idle: int

    def mine(self, every: np.ndarray) -> np.ndarray:
        """This process's share of all states (q, ...), a view."""
        return self._of(self.comm.rank, every)

    def everywhere(self, own: np.ndarray) -> np.ndarray:
        """All states (q, ...) from those of each process. Collective."""
        if self.comm.size == 1:
            return own
        every = joined(self.comm, np.ascontiguousarray(own))
        out, first = np.empty_like(every), 0
        for rank in range(self.comm.size):
            share = self._of(rank, out)
            share[:] = every[first : first + len(share)]
            first += len(share)
        return out

    def _of(self, rank: int, every: np.ndarray) -> np.ndarray:
        owners = self.comm.size - self.idle
        return every[rank - self.idle :: owners] if rank >= self.idle else every[:0]
