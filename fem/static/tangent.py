"""The tangent with nodes held by the road, and the contact of a linearised step.

That contact is a linear complementarity problem on the tread nodes. K du = right is solved with the nodes held that were held when K was factorised. Each node held
since then adds a force, each node released since then a motion, both times a column of K's inverse:

    gap = gap_0 + C z + gap_l rise,    force = force_0 + D z + force_l rise,

with z such that gap = 0 at held nodes and force = 0 at free ones, and rise such that the road
carries the load. As in `Equilibrium.solve` a node is held if force > c gap; the sets are updated
until they stay the same. Columns are solved for together, at a seventh of the cost of a solve
each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.road import RoadContact
from tireroad.fem.timing import Timing

_CHUNK = 64  # right-hand sides per solve
_SINGULAR = (-6, -10)  # MUMPS's INFOG(1): structurally, numerically
_ROUNDS = 10  # updates of the sets in one step
_MOST = 400  # columns per factorisation
_OFF = 1e-12  # m from the road: rounding leaves less
Array = np.ndarray


@dataclass(frozen=True)
class PrescribedMotion:
    """A prescribed motion (m) of the owned dofs, nonzero at held ones only, and the force K change
    (N) it causes at all dofs."""

    change: np.ndarray
    force: np.ndarray


class System(Protocol):
    """The linearised equilibrium as Newton's method uses it; see `ConstrainedSystem`."""

    @property
    def gap_closure(self) -> PrescribedMotion: ...

    @property
    def road_rise(self) -> PrescribedMotion: ...

    def take(
        self, matrix: PETSc.Mat, held: np.ndarray, gap_closure: np.ndarray, road_rise: np.ndarray
    ) -> bool:
        """Factorise; False if the matrix is singular. Collective."""
        ...

    def solve(
        self, right: np.ndarray, moved: PrescribedMotion | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of the owned dofs under forces (N), force (N) at held ones. Collective."""
        ...


class ContactColumns(System, Protocol):
    """A system whose factorisation remains usable when other dofs are held."""

    def columns(
        self, numbers: np.ndarray, dofs: np.ndarray, count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `ConstrainedSystem`. Collective."""
        ...

    def spread(self, motion: np.ndarray) -> np.ndarray:
        """The motion of all owned dofs, including dependent ones. Collective."""
        ...


class ConstrainedSystem:
    """K du = right, with du prescribed at the held dofs. All methods are collective.

    `take` factorises; each `solve` then costs two triangular solves. The factorisation is usable
    while the tangent changes little and the same dofs are held. `gap_closure` and `road_rise` are the
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
        self, matrix: PETSc.Mat, held: np.ndarray, gap_closure: np.ndarray, road_rise: np.ndarray
    ) -> bool:
        """Factorise `matrix` with the owned dofs `held`, which move by `gap_closure` (m) in the next
        step and by `road_rise` (m per m) as the road rises.

        Returns False if it is singular; raises ConvergenceError if the factorisation fails
        otherwise. `matrix` is modified and must not be used afterwards.
        """
        rows = (held + matrix.getOwnershipRange()[0]).astype(PETSc.IntType)
        self._held = held
        with self._timing("road"):
            self._keep_reaction(matrix, rows)
            self.gap_closure = self._moved(matrix, gap_closure)
            self.road_rise = self._moved(matrix, road_rise)
            matrix.zeroRowsColumns(rows, 1.0)
        with self._timing("factorisation"):
            self._ksp.setOperators(
                matrix
            )  # may differ from the first one (fem.static.friction_road)
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

    def _moved(self, matrix: PETSc.Mat, at_held: np.ndarray) -> PrescribedMotion:
        self._x.set(0.0)
        self._x.array[self._held] = at_held
        matrix.mult(self._x, self._right)
        return PrescribedMotion(self._x.array_r.copy(), self._right.array_r.copy())

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

    def solve(
        self, right: np.ndarray, moved: PrescribedMotion | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of the owned dofs under forces (N), and the force (N) needed at the held dofs.

        The held dofs move as in `moved` (`gap_closure` or `road_rise`), or stay.
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
        columns = x.getDenseArray().copy(), forces.getDenseArray().copy()
        for part in (right, x, forces):
            part.destroy()
        return columns

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


def held_step(
    comm: MPI.Comm,
    system: System,
    road: RoadContact,
    given: tuple[Array, PrescribedMotion | None, float | None],
) -> tuple[Array, Array] | None:
    """One linearised step: motion (m) of owned dofs, reactions (N) at held ones. Collective.

    `given`: residual forces (N), the prescribed motion of the held dofs, and a load (N) or None;
    with a load the road is raised to carry it. Returns None if nothing resists the road. The road's
    force is the reaction of the linearised problem: a residual is no force of the road (otherwise
    held dofs were seen to be released and held again forever).
    """
    out, gap_closure, load = given
    change, force = system.solve(-out, gap_closure)
    force += out[road.held]
    if load is None:
        return change, force
    further, more = system.solve(np.zeros_like(out), system.road_rise)
    sums = np.array([road.vertical_force(part) for part in (force, more)])
    total, rate = comm.allreduce(sums)
    if not rate > 0:
        return None
    rise = (load - total) / rate
    road.height += rise
    return change + rise * further, force + rise * more


@dataclass(frozen=True)
class _Found:
    """z at the `nodes` and rise; the nodes that should be held, and the road's force (N) on all."""

    nodes: Array
    parts: tuple[Array, float]
    wanted: Array
    force: Array


@dataclass
class _Answer:
    """Motion (m) of the owned dofs; gap (m) and force (N) of the tread nodes of all processes."""

    motion: Array
    gap: Array
    force: Array

    def plus(self, times: float, other: _Answer) -> _Answer:
        """This answer plus `times` the other."""
        return _Answer(
            self.motion + times * other.motion,
            self.gap + times * other.gap,
            self.force + times * other.force,
        )


class LinearContact:
    """The contact problem for the current factorisation of a system. All methods are collective."""

    def __init__(self, comm: MPI.Comm, system: System, road: RoadContact) -> None:
        self._comm, self._system, self._road = comm, cast(ContactColumns, system), road
        counts = comm.allgather(len(road.dofs))
        first = sum(counts[: comm.rank])
        self._own = slice(first, first + len(road.dofs))
        self._stiffness = self._gathered(road.stiffness)
        self._base = self._gathered(road.active)  # held in the factorisation
        self._number = np.full(len(self._base), -1)  # column number of each node
        none = np.empty((len(self._base), 0))
        self._columns = _Answer(np.empty((system.gap_closure.change.size, 0)), none, none)
        self._lift: _Answer | None = None
        self.changed = False  # whether the held nodes differ from those of the factorisation

    def step(
        self,
        out: Array,
        gap_closure: PrescribedMotion | None,
        load: float | None,
        given: float | None = None,
    ) -> tuple[Array, Array] | None:
        """`held_step` that first settles the active set; the road may rise by a `given` m."""
        road = self._road
        free = self._answer(*self._system.solve(-out, gap_closure), out)
        free.gap += self._gathered(road.gap())
        if given:
            free = free.plus(given, self._lifted())
        lift = self._lifted() if load is not None else None
        if lift is not None and not lift.force.sum() > 0:
            return None
        held = self._gathered(road.active)
        solved_step = self._solved(free, lift, held, load)
        if (
            gap_closure is not None or given is not None
        ):  # near equilibrium the sets of a reused tangent are unreliable
            held, solved_step = self._settled(
                held, solved_step, lambda held: self._solved(free, lift, held, load)
            )
        z, rise = solved_step.parts
        self.changed = bool((held != self._base).any())
        motion = free.motion + self._columns.motion[:, self._number[solved_step.nodes]] @ z
        road.height += rise + (given or 0.0)
        road.active, road.force = held[self._own].copy(), np.zeros(len(road.dofs))
        motion = motion if lift is None else motion + rise * lift.motion
        return self._system.spread(motion), solved_step.force[self._own][road.active]

    def _settled(
        self, held: Array, solution: _Found, solved: Callable[[Array], _Found]
    ) -> tuple[Array, _Found]:
        """The first held set that no longer changes, with its solution; else the given ones."""
        first = held, solution
        for _ in range(_ROUNDS):
            if (solution.wanted == held).all():
                return held, solution
            if np.count_nonzero(solution.wanted ^ self._base) > _MOST:
                break
            held = solution.wanted
            solution = solved(held)
        return first

    def _solved(
        self, free: _Answer, lift: _Answer | None, held: Array, load: float | None
    ) -> _Found:
        """z, rise, gaps and forces of the tread nodes for the set `held`."""
        off = (
            held & self._base & (np.abs(free.gap) > _OFF)
        )  # released since the factorisation, and held again
        changed = np.flatnonzero((held ^ self._base) | off)
        self._add_columns(changed)
        use = self._number[changed]
        gap, force = self._columns.gap[:, use], self._columns.force[:, use]
        rest = free.gap, free.force
        if lift is not None:
            gap, force = (np.column_stack(p) for p in ((gap, lift.gap), (force, lift.force)))
        on, own = held[changed], self._stiffness[changed]
        rows = np.where(on[:, None], own[:, None] * gap[changed], force[changed])
        right = -np.where(on, own * rest[0][changed], rest[1][changed])
        unit = np.where(self._base[changed], 1 / own, 1.0)  # scales all to N
        if lift is not None:
            rows, right = (
                np.vstack([rows, force.sum(axis=0)]),
                np.append(right, load - rest[1].sum()),
            )
            unit = np.append(unit, 1 / self._stiffness.max())
        z = unit * np.linalg.lstsq(rows * unit, right, rcond=None)[0] if len(right) else right
        parts = z[: len(changed)], float(z[-1]) if lift is not None else 0.0
        gaps = np.where(held, 0.0, rest[0] + gap @ z)
        return _Found(
            changed,
            parts,
            np.where(held, rest[1] + force @ z, 0.0) > self._stiffness * gaps,
            np.where(held, rest[1] + force @ z, 0.0),
        )

    def _add_columns(self, nodes: Array) -> None:
        """Compute the columns of nodes that have none yet."""
        new = nodes[self._number[nodes] < 0]
        if not len(new):
            return
        mine = new[(new >= self._own.start) & (new < self._own.stop)] - self._own.start
        dofs = self._road.dofs[mine]
        order = np.flatnonzero((new >= self._own.start) & (new < self._own.stop))
        motion, reaction = self._system.columns(order, dofs, len(new))
        force = np.zeros((len(self._road.dofs), len(new)))
        force[self._base[self._own]] = reaction
        pressed = ~self._base[self._own][mine]
        force[mine[pressed], order[pressed]] = 1.0
        added = motion, self._gathered(motion[self._road.dofs]), self._gathered(force)
        columns = self._columns
        parts = zip((columns.motion, columns.gap, columns.force), added, strict=True)
        self._columns = _Answer(*(np.hstack(pair) for pair in parts))
        self._number[new] = np.arange(len(new)) + (self._number.max() + 1)

    def _lifted(self) -> _Answer:
        """Response to a unit rise of the road with its nodes held."""
        if self._lift is None:
            nothing = np.zeros_like(self._system.gap_closure.force)
            self._lift = self._answer(*self._system.solve(nothing, self._system.road_rise), nothing)
            self._lift.gap -= 1.0
        return self._lift

    def _answer(self, motion: Array, reaction: Array, out: Array) -> _Answer:
        held = self._road.dofs[self._base[self._own]]
        force = np.zeros(len(self._road.dofs))
        force[self._base[self._own]] = reaction + out[held]
        return _Answer(motion, self._gathered(motion[self._road.dofs]), self._gathered(force))

    def _gathered(self, values: Array) -> Array:
        return np.concatenate(self._comm.allgather(values))
