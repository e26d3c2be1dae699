"""The linearised equilibrium with some dofs held: one factorisation, any number of solves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.timing import Timing

_CHUNK = 64  # right-hand sides per solve
_SINGULAR = (-6, -10)  # MUMPS's INFOG(1): structurally, numerically


@dataclass(frozen=True)
class Moved:
    """A prescribed motion (m) of the owned dofs, nonzero at held ones only, and the force K change
    (N) it causes at all dofs."""

    change: np.ndarray
    force: np.ndarray


class System(Protocol):
    """The linearised equilibrium as Newton's method uses it; see `HeldSystem`."""

    @property
    def closing(self) -> Moved: ...

    @property
    def raising(self) -> Moved: ...

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, closing: np.ndarray, raising: np.ndarray
    ) -> bool:
        """Factorise; False if the matrix is singular. Collective."""
        ...

    def solve(self, right: np.ndarray, moved: Moved | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of the owned dofs under forces (N), force (N) at held ones. Collective."""
        ...


class Columns(System, Protocol):
    """A system whose factorisation remains usable when other dofs are held."""

    def columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `HeldSystem`. Collective."""
        ...

    def spread(self, motion: np.ndarray) -> np.ndarray:
        """The motion of all owned dofs, including dependent ones. Collective."""
        ...


class HeldSystem:
    """K du = right, with du prescribed at the held dofs. All methods are collective.

    `take` factorises; each `solve` then costs two triangular solves. The factorisation is usable
    while the tangent changes little and the same dofs are held. `closing` and `raising` are the
    motions given to `take`.
    """

    def __init__(
        self, comm: MPI.Comm, matrix: PETSc.Mat, factorisation: str, timing: Timing
    ) -> None:
        self._comm, self._timing = comm, timing
        self._ksp = _solver(comm, matrix, factorisation)
        self._right, self._x = matrix.createVecs()
        self._reaction: PETSc.Mat | None = None  # rows of the held dofs; _pull: their columns
        self._pull: PETSc.Mat | None = None

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, closing: np.ndarray, raising: np.ndarray
    ) -> bool:
        """Factorise `matrix` with the owned dofs `held`, which move by `closing` (m) in the next
        step and by `raising` (m per m) as the road rises.

        Returns False if it is singular; raises ConvergenceError if the factorisation fails
        otherwise. `matrix` is modified and must not be used afterwards.
        """
        rows = (held + matrix.getOwnershipRange()[0]).astype(PETSc.IntType)
        self._held = held
        with self._timing("road"):
            self._keep_reaction(matrix, rows)
            self.closing = self._moved(matrix, closing)
            self.raising = self._moved(matrix, raising)
            matrix.zeroRowsColumns(rows, 1.0)
        with self._timing("factorisation"):
            self._ksp.setOperators(matrix)  # may differ from the first one (fem.static.friction)
            self._ksp.getPC().setUp()
        return self._checked()

    def _keep_reaction(self, matrix: PETSc.Mat, rows: np.ndarray) -> None:
        for part in (self._reaction, self._pull):
            if part is not None:
                part.destroy()
        first, last = matrix.getOwnershipRange()
        every = PETSc.IS().createStride(last - first, first, 1, comm=self._comm)
        own = PETSc.IS().createGeneral(rows, comm=self._comm)
        self._reaction = matrix.createSubMatrix(own, every)
        self._pull = matrix.createSubMatrix(every, own)
        every.destroy()
        own.destroy()

    def _moved(self, matrix: PETSc.Mat, at_held: np.ndarray) -> Moved:
        self._x.set(0.0)
        self._x.array[self._held] = at_held
        matrix.mult(self._x, self._right)
        return Moved(self._x.array_r.copy(), self._right.array_r.copy())

    def _checked(self) -> bool:
        factors = self._ksp.getPC().getFactorMatrix()
        code, detail = factors.getMumpsInfog(1), factors.getMumpsInfog(2)
        factors.destroy()  # release this reference, which petsc4py would keep forever
        if code < 0 and code not in _SINGULAR:
            raise ConvergenceError(
                f"static: MUMPS could not factorise the tangent, INFOG(1) = {code}, INFOG(2) = "
                f"{detail}. INFOG(1) = -8 or -9: its workspace is too small, add -- -static_mat_mumps_icntl_14 400. "
                "-13: out of memory, take more processes or fewer elements. Other codes: see the users' guide of "
                "MUMPS."
            )
        return code >= 0

    def solve(self, right: np.ndarray, moved: Moved | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of the owned dofs under forces (N), and the force (N) needed at the held dofs.

        The held dofs move as in `moved` (`closing` or `raising`), or stay.
        """
        with self._timing("solve"):
            self._right.array[:] = right if moved is None else right - moved.force
            self._right.array[self._held] = 0.0
            self._ksp.solve(self._right, self._x)
        change = self._x.array_r.copy()
        if moved is not None:
            change += moved.change
            self._x.array[:] = change
        assert self._reaction is not None, "solve() before take()"
        force = self._reaction.createVecLeft()
        self._reaction.mult(self._x, force)
        at_held = force.array_r.copy()
        force.destroy()
        return change, at_held

    def columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Responses to a unit force on each of some free dofs, or a unit motion of held ones.

        Returns the motion (m) of the owned dofs (owned, count) and the force (N) at the held ones
        (held, count). `numbers` (k,) are the column numbers, among all `count`, of this process's
        `dofs` (k,).
        """
        motion = np.empty((self._x.getLocalSize(), count))
        force = np.empty((len(self._held), count))
        with self._timing("columns"):
            for start in range(0, count, _CHUNK):
                stop = min(start + _CHUNK, count)
                some = (numbers >= start) & (numbers < stop)
                found = self._columns(numbers[some] - start, dofs[some], stop - start)
                motion[:, start:stop], force[:, start:stop] = found
        return motion, force

    def _columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """One block of `columns`, small enough for memory."""
        assert self._reaction is not None, "columns() before take()"
        right, x = self._dense(count), self._dense(count)
        self._fill(right, numbers, dofs)
        factors = self._ksp.getPC().getFactorMatrix()
        factors.matSolve(right, x)
        factors.destroy()
        held = np.isin(dofs, self._held)
        x.getDenseArray()[dofs[held], numbers[held]] = 1.0
        forces = self._reaction.matMult(x)
        found = x.getDenseArray().copy(), forces.getDenseArray().copy()
        for part in (right, x, forces):
            part.destroy()
        return found

    def _fill(self, right: PETSc.Mat, numbers: np.ndarray, dofs: np.ndarray) -> None:
        """Unit forces at free dofs; for held ones the forces of a unit motion on the free ones."""
        assert self._pull is not None, "columns() before take()"
        held = np.isin(dofs, self._held)
        count = right.getSize()[1]
        # Sparse: PETSc 3.25 crashes in the product with a dense matrix that has no row on a process.
        at = np.searchsorted(self._held, dofs[held]), numbers[held]
        shape = len(self._held), count
        unit = sparse.csr_matrix((np.full(len(at[0]), -1.0), at), shape)
        sizes = self._pull.getSizes()[1], (None, count)
        csr = unit.indptr, unit.indices, unit.data
        moved = PETSc.Mat().createAIJ(sizes, csr=csr, comm=self._comm)
        forces = self._pull.matMult(moved)
        indptr, indices, values = forces.getValuesCSR()
        dense = right.getDenseArray()
        dense[:] = sparse.csr_matrix((values, indices, indptr), dense.shape).toarray()
        right.getDenseArray()[self._held] = 0.0
        right.getDenseArray()[dofs[~held], numbers[~held]] = 1.0
        right.assemble()
        moved.destroy()
        forces.destroy()

    def spread(self, motion: np.ndarray) -> np.ndarray:
        """The motion of all owned dofs, including dependent ones: here there are none."""
        return motion

    def _dense(self, count: int) -> PETSc.Mat:
        matrix = PETSc.Mat().createDense((self._x.getSizes(), (None, count)), comm=self._comm)
        matrix.setUp()
        return matrix


def _solver(comm: MPI.Comm, matrix: PETSc.Mat, factorisation: str) -> PETSc.KSP:
    ksp = PETSc.KSP().create(comm)
    ksp.setOptionsPrefix("static_")
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(factorisation)
    pc.setFactorSolverType("mumps")
    # Workspace for pivoting beyond MUMPS's estimate: the tangent of a rotating tire is unsymmetric.
    room = PETSc.Options("static_")
    if not room.hasName("mat_mumps_icntl_14"):
        room["mat_mumps_icntl_14"] = 100
    ksp.setFromOptions()
    return ksp
