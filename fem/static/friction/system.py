"""The linearised equilibrium of a tire with stick and slip: the counterpart of `HeldSystem`.

    (L K + S) P dv = L (- out) - springs,     du = P dv:

L adds to the horizontal rows of slipping nodes -mu n times the part of their rows that is the
normal force; S are the springs across their path; P moves sticking nodes with the free node ahead
of them on their streamline. None of these is symmetric.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.matrices.local_rows import from_local_rows
from tireroad.fem.static.friction.road import RubbingRoad
from tireroad.fem.static.held_system import HeldSystem, Moved
from tireroad.fem.timing import Timing

Array = np.ndarray


class RubbingSystem:
    """Uses the `road`'s sets at the time of each `take`. All methods are collective."""

    def __init__(self, comm: MPI.Comm, matrix: PETSc.Mat, timing: Timing, road: RubbingRoad):
        self._comm, self._timing, self._road = comm, timing, road
        self._inner = HeldSystem(comm, matrix, "lu", timing)
        self._carried: PETSc.Mat | None = None

    @property
    def closing(self) -> Moved:
        """As in HeldSystem, in dv."""
        return self._inner.closing

    @property
    def raising(self) -> Moved:
        """As in HeldSystem, in dv."""
        return self._inner.raising

    def take(self, matrix: PETSc.Mat, held: Array, closing: Array, raising: Array) -> bool:
        """Factorise; `matrix` must not be used afterwards."""
        with self._timing("road"):
            system = self._joined(matrix)
        found = self._inner.take(system, held, closing, raising)
        if system is not matrix:
            system.destroy()
        return found

    def solve(self, right: Array, moved: Moved | None = None) -> tuple[Array, Array]:
        """du (m) of the owned dofs, forces (N) at held ones; `right` already includes L."""
        change, force = self._inner.solve(right, moved)
        if self._carried is None:
            return change, force
        before, after = self._carried.createVecs()
        before.array[:] = change
        self._carried.mult(before, after)
        change = after.array_r.copy()
        before.destroy()
        after.destroy()
        return change, force

    def _joined(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """(L K + S) P."""
        self._road.linearise()
        same = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        rows, springs = self._rows_and_springs(matrix)
        added = rows.matMult(matrix)
        matrix.axpy(1.0, added, same)
        matrix.axpy(1.0, springs, same)
        for part in (rows, springs, added):
            part.destroy()
        if self._carried is not None:
            self._carried.destroy()
        self._carried = self._along(matrix)
        return matrix if self._carried is None else matrix.matMult(self._carried)

    def _rows_and_springs(self, matrix: PETSc.Mat) -> tuple[PETSc.Mat, PETSc.Mat]:
        first = matrix.getOwnershipRange()[0]
        given = self._road.couplings()
        unknowns, springs, ahead = given.unknowns, given.springs, given.ahead
        rows = _sparse(
            matrix,
            np.broadcast_to(unknowns[:, :, None], given.shares.shape),
            np.broadcast_to(given.sources[:, None, :] + first, given.shares.shape),
            given.shares,
        )
        row = np.broadcast_to(unknowns[:, :, None], springs.shape)
        own = np.broadcast_to(unknowns[:, None, :] + first, springs.shape)
        far = np.broadcast_to((3 * ahead[:, None] + np.arange(2))[:, None, :], springs.shape)
        led = np.broadcast_to((ahead >= 0)[:, None, None], springs.shape)
        return rows, _sparse(
            matrix,
            np.concatenate([row.ravel(), row[led]]),
            np.concatenate([own.ravel(), far[led]]),
            np.concatenate([given.own.ravel(), -springs[led]]),
        )

    def _along(self, matrix: PETSc.Mat) -> PETSc.Mat | None:
        """P; None if no process has a node that moves with another."""
        road, first = self._road, matrix.getOwnershipRange()[0]
        members, lead, _ = road.sliding.led(road.sticks)
        if not self._comm.allreduce(len(members)):
            return None
        count = matrix.getLocalSize()[0]
        own = road.dofs[members, None] - [2, 1]
        rows = np.concatenate([np.arange(count), own.ravel()])
        columns = np.concatenate(
            [np.arange(count) + first, (3 * lead[:, None] + np.arange(2)).ravel()]
        )
        return _sparse(matrix, rows, columns, np.ones(len(rows)))


def _sparse(matrix: PETSc.Mat, rows: Array, columns: Array, values: Array) -> PETSc.Mat:
    """A matrix shaped like another, from local rows and global columns; duplicates add up."""
    (count, whole), _ = matrix.getSizes()
    entries = np.ravel(values), (np.ravel(rows), np.ravel(columns))
    local = sparse.csr_matrix(entries, shape=(count, whole))
    return from_local_rows(local, matrix.getSizes(), matrix.comm)
