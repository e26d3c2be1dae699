"""Stored results of a long computation, so that an interrupted one resumes bit for bit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from mpi4py import MPI

Entry = Mapping[str, np.ndarray]


def _nothing(number: int, entry: Entry) -> None: ...


class Journal:
    """This process's own results of the steps of a computation, in order.

    `entries`: those of an earlier attempt, which need not be repeated; new ones are passed to
    `keep(number, entry)`."""

    def __init__(
        self, entries: Sequence[Entry] = (), keep: Callable[[int, Entry], None] = _nothing
    ) -> None:
        self.found = list(entries)
        self._keep, self._next = keep, 0

    def agreed(self, comm: MPI.Comm) -> int:
        """Number of steps that all processes have found; later ones are dropped. Collective."""
        del self.found[comm.allreduce(len(self.found), MPI.MIN) :]
        return len(self.found)

    def next(self, comm: MPI.Comm, serves: Callable[[Entry], bool] | None = None) -> Entry | None:
        """The next step's stored result, if all processes have it and `serves` accepts it.

        Otherwise None: the result must be passed to `add`, and the remaining stored ones are
        dropped. Collective on comm."""
        here = self._next < len(self.found)
        if here and serves is not None:
            here = serves(self.found[self._next])
        if not comm.allreduce(here, MPI.LAND):
            del self.found[self._next :]
            return None
        self._next += 1
        return self.found[self._next - 1]

    def add(self, entry: Entry) -> None:
        """Store the next step's result."""
        self._keep(self._next, entry)
        self._next += 1

    @property
    def done(self) -> int:
        """Number of steps computed or found so far."""
        return self._next

    def step(self, comm: MPI.Comm, compute: Callable[[], Entry]) -> Entry:
        """Stored result of the next step, or that of `compute`. Collective on comm."""
        entry = self.next(comm)
        if entry is None:
            entry = compute()
            self.add(entry)
        return entry
