"""The linearised equilibrium of half a ring with coupled cut faces."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.fem.static.held_system import HeldSystem, Moved
from tireroad.fem.static.symmetry.cut import Cut
from tireroad.fem.timing import Timing


class FoldedSystem:
    """P^T K P: a `HeldSystem` of half a ring. Followers keep a unit diagonal row."""

    def __init__(
        self, comm: MPI.Comm, matrix: PETSc.Mat, kind: str, timing: Timing, cut: Cut
    ) -> None:
        self._cut, self._timing = cut, timing
        self._folding = _Folding(matrix, cut)
        self._inner = HeldSystem(comm, self._folding.matrix, kind, timing)

    @property
    def closing(self) -> Moved:
        return self._inner.closing

    @property
    def raising(self) -> Moved:
        return self._inner.raising

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, closing: np.ndarray, raising: np.ndarray
    ) -> bool:
        """Fold and factorise; `matrix` stays unchanged. Collective."""
        with self._timing("assembly"):
            self._folding.fill(matrix)
        return self._inner.take(self._folding.matrix, held, closing, raising)

    def solve(self, right: np.ndarray, moved: Moved | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of owned dofs under folded forces (N), force (N) at held ones. Collective."""
        change, force = self._inner.solve(right, moved)
        self._cut.unfold(change)
        return change, force

    def columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """As in HeldSystem, without the motion of followers. Collective."""
        return self._inner.columns(numbers, dofs, count)

    def spread(self, motion: np.ndarray) -> np.ndarray:
        """Add the motion of the followers, in place. Collective."""
        self._cut.unfold(motion)
        return motion


class _Folding:
    """`matrix` P^T K P, its pattern made once and its values summed from K in `fill`."""

    def __init__(self, matrix: PETSc.Mat, cut: Cut) -> None:
        comm, size = matrix.comm.tompi4py(), matrix.getSize()[0]
        first, last = matrix.getOwnershipRange()
        begin, column, _ = matrix.getValuesCSR()
        row = np.repeat(np.arange(first, last), np.diff(begin))
        sign, to = cut.sign[row] * cut.sign[column], cut.lead[column]
        self._comm = comm
        self._stays = np.flatnonzero((cut.lead[row] == row) & (to >= 0))
        self._goes = np.flatnonzero((cut.lead[row] != row) & (cut.lead[row] >= 0) & (to >= 0))
        self._sign, self._sent_sign = sign[self._stays], sign[self._goes]
        sent = np.stack([cut.lead[row[self._goes]], to[self._goes]])
        come = np.concatenate(comm.allgather(sent), axis=1)
        self._comes = np.flatnonzero((come[0] >= first) & (come[0] < last))
        own = np.arange(first, last)
        alone = own[cut.lead[first:last] != own]
        rows = np.concatenate([row[self._stays], come[0, self._comes], alone])
        columns = np.concatenate([to[self._stays], come[1, self._comes], alone])
        key = (rows - first) * size + columns
        order = np.argsort(key, kind="stable")
        new = np.append(True, np.diff(key[order]) > 0)
        self._place = np.empty(len(key), np.intp)
        self._place[order] = np.cumsum(new) - 1
        kept = key[order][new]
        self._columns = (kept % size).astype(PETSc.IntType)
        counts = np.bincount(kept // size, minlength=last - first)
        self._begin = np.append(0, np.cumsum(counts)).astype(PETSc.IntType)
        self._ones = np.ones(len(alone))
        csr = self._begin, self._columns, np.zeros(len(kept))
        self.matrix = PETSc.Mat().createAIJ(matrix.getSizes(), csr=csr, comm=comm)

    def fill(self, matrix: PETSc.Mat) -> None:
        """Set the values from K. Collective."""
        values = matrix.getValuesCSR()[2]
        come = np.concatenate(self._comm.allgather(self._sent_sign * values[self._goes]))
        given = np.concatenate([self._sign * values[self._stays], come[self._comes], self._ones])
        summed = np.bincount(self._place, weights=given, minlength=len(self._columns))
        self.matrix.setValuesCSR(self._begin, self._columns, summed)
        self.matrix.assemble()
