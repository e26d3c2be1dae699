"""What a long computation has found so far, so that one that was stopped goes on from there to the same bits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from mpi4py import MPI

Entry = Mapping[str, np.ndarray]


def _nothing(number: int, entry: Entry) -> None: ...


class Journal:
    """This process's own results of the steps of a computation, in their order: those `found` by an attempt before, which
    need not be taken again, and those that are handed to `keep(number, entry)` as they come."""

    def __init__(
        self, found: Sequence[Entry] = (), keep: Callable[[int, Entry], None] = _nothing
    ) -> None:
        self.found = list(found)
        self._keep, self._next = keep, 0

    def agreed(self, comm: MPI.Comm) -> int:
        """How many steps all processes have found; no more count from then on. Collective."""
        del self.found[comm.allreduce(len(self.found), MPI.MIN) :]
        return len(self.found)

    def next(self, comm: MPI.Comm, serves: Callable[[Entry], bool] | None = None) -> Entry | None:
        """The next step's result where all processes of `comm` have it, and it `serves` them all; else None, it is to be
        `add`ed, and nothing that was found counts any more. Collective on comm."""
        here = self._next < len(self.found)
        if here and serves is not None:
            here = serves(self.found[self._next])
        if not comm.allreduce(here, MPI.LAND):
            del self.found[self._next :]
            return None
        self._next += 1
        return self.found[self._next - 1]

    def add(self, entry: Entry) -> None:
        """The next step's result."""
        self._keep(self._next, entry)
        self._next += 1

    @property
    def done(self) -> int:
        """Steps taken, or found, so far."""
        return self._next

    def step(self, comm: MPI.Comm, compute: Callable[[], Entry]) -> Entry:
        """What the next step's `compute` gives, or has given before. Collective on comm."""
        entry = self.next(comm)
        if entry is None:
            entry = compute()
            self.add(entry)
        return entry
