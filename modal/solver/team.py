"""Teams of processes, each of which factorises one matrix together.

A team holds the rows of a part, its factor and its vectors distributed. As many teams work side by
side as there is memory for factors: many small teams need no messages inside a solve, a single team
of all processes needs the least memory on each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.collective import summed


@dataclass(frozen=True)
class Team:
    """The team of this process.

    `comm`: its processes; `number`: its number; `roots`: the rank, among all processes, of the
    first process of each team. Methods on arrays take and return this process's rows, and are
    collective in the team.
    """

    comm: MPI.Comm
    number: int
    roots: tuple[int, ...]

    @classmethod
    def of(cls, comm: MPI.Comm, teams: int) -> Team:
        """The team of this process when all are divided into `teams` of about equal size.

        Collective over all of `comm`.
        """
        number = comm.rank * teams // comm.size
        roots = tuple(-(-k * comm.size // teams) for k in range(teams))
        own = MPI.COMM_SELF if teams == comm.size else comm.Split(number, comm.rank)
        return cls(own, number, roots)

    @property
    def alone(self) -> bool:
        """Whether the team is a single process."""
        return self.comm.size == 1

    def disband(self) -> None:
        """Free the communicator, once nothing uses it any more. Collective."""
        if not self.alone:
            self.comm.Free()

    def own(self, size: int) -> slice:
        """This process's rows of `size` of the team, distributed as PETSc does."""
        each, more = divmod(size, self.comm.size)
        start = self.comm.rank * each + min(self.comm.rank, more)
        return slice(start, start + each + (self.comm.rank < more))

    def inner(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """left^T right."""
        return summed(self.comm, left.T @ right)

    def lengths(self, vectors: np.ndarray) -> np.ndarray:
        """Length of each column."""
        return np.sqrt(summed(self.comm, (vectors**2).sum(axis=0)))

    def orthonormal(self, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q (rows, b) and R (b, b) of the vectors: QR of each process's rows, then of all R."""
        q, r = np.linalg.qr(vectors)
        if self.alone:
            return q, r
        every = self.comm.allgather(r)
        start = sum(len(one) for one in every[: self.comm.rank])
        turn, r = np.linalg.qr(np.vstack(every))
        return q @ turn[start : start + q.shape[1]], r

    def random(self, seed: int) -> np.random.Generator:
        """A generator whose numbers differ from process to process."""
        return np.random.default_rng(seed if self.alone else [seed, self.comm.rank])

    def whole(self, rows: sparse.csr_matrix) -> sparse.csr_matrix:
        """A small matrix, whole on every process of the team, from its rows."""
        return rows if self.alone else sparse.vstack(self.comm.allgather(rows), format="csr")

    def at_root(self, rows: np.ndarray) -> np.ndarray | None:
        """All rows (n, k) on the first process of the team; None on the others."""
        if self.alone:
            return rows
        counts = np.array(self.comm.allgather(rows.size))
        every = None
        if self.comm.rank == 0:
            every = np.empty((counts.sum() // rows.shape[1], rows.shape[1]))
        received = None if every is None else [every, counts, MPI.DOUBLE]
        self.comm.Gatherv(np.ascontiguousarray(rows), received)
        return every


ALONE = Team(MPI.COMM_SELF, 0, (0,))


def how_many(comm: MPI.Comm, needed: float, room: float) -> int:
    """Number of teams for a part that takes `needed` bytes, the same on every process. Collective.

    `room`: bytes that this process's machine has for all its processes. As many teams as fit, at
    least one.
    """
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = room / machine.size
    machine.Free()
    least = comm.size * comm.allreduce(share, MPI.MIN) / max(needed, 1.0)
    return comm.size if math.isinf(least) else int(np.clip(least, 1, comm.size))
