"""Decides when a time loop stops and when it writes a checkpoint."""

from __future__ import annotations

import time

from mpi4py import MPI

_TOGETHER = 8  # steps between two agreements of several processes on whether to stop


class Watch:
    """Whether to stop, and whether a checkpoint is due; the same answer on every process.

    `every` (s, wall-clock time): interval between checkpoints.
    """

    def __init__(self, comm: MPI.Comm, every: float) -> None:
        self._comm, self._every = comm, every
        self._last = time.monotonic()
        self._count = 0

    def __call__(self, asked: str) -> tuple[str, bool]:
        """Stop signal ("" if none), and whether a checkpoint is due. Collective at some steps."""
        self._count += 1
        if self._comm.size > 1 and self._count % _TOGETHER:
            return "", False
        due = time.monotonic() - self._last > self._every
        if self._comm.size > 1:
            answers = self._comm.allgather((asked, due))
            asked = max(name for name, _ in answers)
            due = answers[0][1]
        if due:
            self._last = time.monotonic()
        return asked, due
