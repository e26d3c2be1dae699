"""The time loop: the tire's motion without the next force, the contact solution, the step.

Steps of equal size, what a moving road imposes (`driven`), and the contact problem solved on the
root or on every process while parts of the next step are computed ahead of the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.patch import Patch
from tireroad.contact.solver.active_set import COMPILED
from tireroad.contact.solver.conditions import Array, ContactSolver, Mask
from tireroad.contact.solver.stick_slip import BrushFriction, CompressedRows
from tireroad.contact.tread.memory import TreadMemory
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.greens.recursion import LoadedColumns, ahead_of_mean

_ROUNDING = 1e-9  # of the number of steps: a duration that is a multiple of the step stays one


@dataclass(frozen=True)
class Steps:
    """`count` equal steps of `size` s from the known state at t = 0 to the last at `duration`."""

    size: float
    count: int

    @property
    def duration(self) -> float:
        """Time of the last step, s; not less than the requested duration."""
        return self.size * self.count


def steps_of(duration: float, size: float) -> Steps:
    """The smallest number of steps of `size` (s) that cover `duration` (s), at least one."""
    check_times(duration, size)
    return Steps(size, max(math.ceil(duration / size * (1.0 - _ROUNDING)), 1))


def equal_steps(duration: float, largest: float) -> Steps:
    """Equal steps no longer than `largest` (s) that end exactly at `duration` (s)."""
    check_times(duration, largest)
    count = steps_of(duration, largest).count
    return Steps(duration / count, count)


def check_times(duration: float, size: float) -> None:
    """InputError for a duration or a step (s) that is not positive and finite."""
    for name, value in (("duration", duration), ("step", size)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"time.{name} = {value:g} s must be positive and finite")


class Solved(NamedTuple):
    """The solution at the contact points, and the residual and `penetration` (m) of it.

    `force` (c,) N, `gap` (c,) m, `horizontal` (2, c) N, or (2, 0) without friction.
    """

    force: Array
    gap: Array
    horizontal: Array
    residual: float
    penetration: float


class Ahead(Protocol):
    """A tire that computes part of the next step ahead of this one's force (greens.recursion)."""

    def look_ahead(self) -> None: ...

    def exchange(self) -> None: ...


class RootSolve:
    """The root process of `comm` solves for `count` points and sends the result to the others.

    Meanwhile the others look `ahead` if the tire can. A single process sends nothing and does not
    look ahead.
    """

    def __init__(self, comm: MPI.Comm, count: int, ahead: Ahead | None) -> None:
        self._comm, self._count, self._ahead = comm, count, ahead

    def __call__(
        self, predict: Callable[[], Array], solve: Callable[[Array], Solved], horizontal: bool
    ) -> tuple[Array, Solved]:
        """The tire's prediction, and the solution that `solve` finds for it on the root process.

        `horizontal`: whether the solution has horizontal forces. A ConvergenceError or InputError on the
        root is raised on all processes. Collective.
        """
        if self._comm.size == 1:
            return (free := predict()), solve(free)
        if self._ahead is None:
            return (free := predict()), self._told(solve, free, horizontal)
        free = predict() if self._comm.rank == 0 else np.empty(0)
        self._ahead.look_ahead()
        found = self._told(solve, free, horizontal)
        self._ahead.exchange()
        return free if self._comm.rank == 0 else predict(), found

    def _told(self, solve: Callable[[Array], Solved], free: Array, horizontal: bool) -> Solved:
        values, failed = np.empty(2 + (4 if horizontal else 2) * self._count), None
        if self._comm.rank == 0:
            try:
                values = _packed(solve(free))
            except (ConvergenceError, InputError) as error:
                values[0], failed = np.nan, error
        self._comm.Bcast(values)
        if np.isnan(values[0]):
            failed = self._comm.bcast(failed)
            assert failed is not None, "what stopped the root process"
            raise failed
        return self._unpacked(values)

    def _unpacked(self, values: Array) -> Solved:
        c = self._count
        force, gap = values[2 : 2 + c], values[2 + c : 2 + 2 * c]
        residual, penetration = values[:2].tolist()
        return Solved(force, gap, values[2 + 2 * c :].reshape(2, -1), residual, penetration)


def _packed(found: Solved) -> Array:
    scalars = found.residual, found.penetration
    return np.concatenate([scalars, found.force, found.gap, found.horizontal.ravel()])


# What needs no contact is computed for as many steps at once as make this many points, and for at most so many.
_POINTS_AHEAD, _STEPS_AHEAD = 200_000, 64


def block_size(points: int) -> int:
    """Steps of a block for this many contact points, a power of two."""
    most: int = min(max(_POINTS_AHEAD // points, 1), _STEPS_AHEAD)
    return 1 << (most.bit_length() - 1)


class LinearTire(Protocol):
    """A linear tire between the forces and displacements of the patch.

    `Recursion` or `Convolution` of greens.recursion; the processes of `comm` advance it together.
    """

    comm: MPI.Comm
    same_step: np.ndarray

    def predict(self) -> np.ndarray: ...

    def advance(self, force: np.ndarray) -> None: ...

    def inertia_force(self) -> np.ndarray: ...

    def snapshot(self) -> dict[str, np.ndarray]: ...

    def restore(self, state: dict[str, np.ndarray]) -> None: ...


class PushedTire(LinearTire, Protocol):
    """A tire that may begin with a force that is there at t = 0."""

    def start(self, force: np.ndarray) -> None: ...


@runtime_checkable
class SteadyTire(LinearTire, Protocol):
    """A tire that may begin at rest under a `force` that always was, with a `sudden` one beside it; its displacement, m."""

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray: ...


@runtime_checkable
class IteratedTire(LinearTire, Protocol):
    """A tire whose response is known approximately (fem.nonlinear_transient).

    `settle` returns None if its motion under a force is in balance, else the free displacement for
    which the contact has to be solved again.
    """

    def settle(self, force: np.ndarray) -> np.ndarray | None: ...


@dataclass(frozen=True)
class Block:
    """The states at the ends of n successive steps, for c contact points on p nodes; N, m, s.

    `force` (n, c) vertical and `horizontal` (n, c, 2) on the tire; `axle_force` (n, 3); `penetration` (n,) of the
    deepest point in the solution; `active` (n,) points that touch; `change` (n, k): the forces on the nodes from
    the static state, z of all nodes, then x, then y; `free` (n, r): their displacements without the
    forces of the same step, which `moved` adds; `reading` (n, m) of a tire that is read elsewhere too.
    """

    time: Array
    force: Array
    horizontal: Array
    gap: Array
    axle_force: Array
    residual: Array
    penetration: Array
    active: Array
    change: Array
    free: Array
    reading: Array | None
    problem: ContactProblem

    @cached_property
    def moved(self) -> Array:
        """Displacements (n, r) m of the nodes from the static state, in the components that are followed."""
        loaded = self.change.any(axis=0)
        return self.free + self.change[:, loaded] @ self.problem.answer[loaded]

    @property
    def followed(self) -> Array:
        """Changes (n, r) N of the forces on the nodes in the components whose motion is followed."""
        return self.change[:, : self.free.shape[1]]

    @property
    def displacement(self) -> Array:
        """Vertical displacements (n, c) m of the points from the static state."""
        patch = self.problem.patch
        vertical = self.moved[:, : self.problem.nodes]
        return vertical if patch.weights is None else (patch.weights @ vertical.T).T

    @property
    def total_force(self) -> Array:
        """Sum (n, 3) N of the forces of the road, in the axes in which they are given."""
        return np.column_stack([self.horizontal.sum(axis=1), self.force.sum(axis=1)])

    def instants(self) -> Iterator[Instant]:
        """The steps one by one."""
        displacement = self.displacement
        parts = (
            self.time.tolist(),
            self.force,
            self.horizontal,
            self.gap,
            displacement,
            self.axle_force,
        )
        more = (
            self.residual.tolist(),
            self.penetration.tolist(),
            self.active.tolist(),
            self.followed,
            self.moved,
        )
        for values in zip(*parts, *more, strict=True):
            yield Instant(*values)


class Instant(NamedTuple):
    """The state at the end of a step: as in `Block`, (c,) for each point."""

    time: float
    force: np.ndarray
    horizontal: np.ndarray
    gap: np.ndarray
    displacement: np.ndarray
    axle_force: np.ndarray
    residual: float
    penetration: float
    active: int
    change: np.ndarray
    moved: np.ndarray


def no_motion(time: float) -> float:
    """A road that does not move, m."""
    return 0.0


@dataclass(frozen=True)
class Drive:
    """The road's approach: `height(x, y)` m over the static plane, pointwise for any shape.

    `motion(t)` m is its vertical motion, `speed` in m/s. `slope(x, y)` (..., 2): derivatives of that
    height along x and y; None for a level road.
    """

    height: Callable[[np.ndarray, np.ndarray], np.ndarray]
    motion: Callable[[float], float]
    speed: float
    slope: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None


class ContactProblem:
    """The contact of a step between the `patch`'s points and the road: normal, or with `friction` too.

    `same_step` (r, k) m/N: displacements at the end of a step of the nodes under forces on them, in z, then x, then
    y: as many displacements as are followed, as many forces as act. `solver` is made for the normal
    compliance A + C~. Where forces have three components a road with a slope `leans`.

    On a slope r = (r_x, r_y) a point with the vertical force f and the bristle's force t bears

        (t - f r,  f + t . r)

    to first order in r. What the slope adds moves the tire like every other force; within the step
    it is predicted from the last step's f and t, so that the contact problem stays as it is.
    Neglected are two terms of second order that belong together, as their work does: the change of
    gap -u . r by the horizontal motion u, and the slope met there instead of at the point.

    After `solve` and `commit`: `vertical` (c,), `horizontal` (2, c) N on the tire, `change` (k,) N on the nodes from the
    static state, `resultant` (3,) N. Compiled (contact/solver/contact.c). Not collective.
    """

    def __init__(
        self,
        patch: Patch,
        same_step: Array,
        solver: ContactSolver,
        friction: BrushFriction | None = None,
    ) -> None:
        self.patch, self._solver, self._friction = patch, solver, friction
        c = len(patch.points)
        p = c if patch.weights is None else patch.weights.shape[1]
        self.components = 3 if friction else 1
        followed, pushed = (count // p for count in same_step.shape)
        self.nodes, self.leans = p, pushed == 3
        self.answer = np.ascontiguousarray(same_step.T)  # (k, r)
        weights = sparse.identity(p, format="csr") if patch.weights is None else patch.weights
        up, down = CompressedRows(weights), CompressedRows(weights.T)
        self._q, self._free = np.zeros(c), np.zeros((2, c))
        self._touching: Mask | None = patch.force > 0
        self.vertical, self.horizontal, self.resultant = np.zeros(c), np.zeros((2, c)), np.zeros(3)
        # Changes of the forces from the static state, on the nodes and on the points.
        self.change, self.at_points = np.zeros(pushed * p), np.zeros(pushed * c)
        self._force, self._tangential = np.zeros(c), np.zeros((2, c))
        doubles = {
            "gap0": np.ascontiguousarray(patch.gap), "at_rest": np.ascontiguousarray(patch.force), "q": self._q,
            "free": self._free, "vertical": self.vertical, "horizontal": self.horizontal, "change": self.at_points,
            "nodal": self.change, "resultant": self.resultant, "answer": self.answer, "normal_force": self._force,
            "tangential": self._tangential, "lifted": np.empty(same_step.shape[0]), "added": np.empty(3 * c),
            "value": np.empty(3 * p),
        }  # fmt: skip
        self._at_rest = doubles["at_rest"]
        if patch.pull is not None and friction is None:
            doubles["rest"] = np.ascontiguousarray(patch.pull.T)
        self._held: dict[str, Any] = {
            name: COMPILED.doubles(values) for name, values in doubles.items()
        }
        self._held |= {
            "points": c, "nodes": p, "seen": 3 if friction and followed == 3 else 1, "pushed": pushed,
            "leans": self.leans, "answer_rows": same_step.shape[0], "which": COMPILED.ints(np.empty(3 * p, np.int32)),
            "w_begin": up.begin, "w_column": up.column, "w_value": up.value,
            "t_begin": down.begin, "t_column": down.column, "t_value": down.value,
        }  # fmt: skip
        self._compiled = COMPILED.ffi.new("meeting *", self._held)

    def solve(self, road: Array, slope: Array | None, tread: Array | None, free: Array) -> Solved:
        """The forces for displacements `free` (r,) m of the nodes without those of the step.

        `road` (c,) m under the points, `slope` (c, 2) of it, `tread` (1 or 3, c) m: displacements of a tread that
        creeps due to its past.
        """
        given = COMPILED.doubles(free), COMPILED.doubles(road), _pointer(slope), _pointer(tread)
        COMPILED.lib.meeting_prepare(self._compiled, *given)
        solver, touching = self._solver, self._touching
        if self._friction is None:
            force, tangential = solver.solve(self._q, touching, reference=self._at_rest), _NO_FORCE
        else:
            force, plane = self._friction.solve(
                solver, self._q, touching, self._at_rest, self._free
            )
            tangential = plane.T
        return Solved(force, solver.gap, tangential, solver.residual, solver.penetration)

    def commit(self, solved: Solved, slope: Array | None) -> Array:
        """Set the solution of the step; returns the change (k,) N of the forces on the nodes."""
        tangential = _pointer(solved.horizontal if self._friction else None)
        force = COMPILED.doubles(solved.force)
        COMPILED.lib.meeting_conclude(self._compiled, force, tangential, _pointer(slope))
        self._touching = None
        return self.change

    def creep(self, slip: Array) -> None:
        """Set the slip (s_x, s_y), or (c, 2) at the points, of the steps to come (contact.tread.brush); with friction only."""
        assert self._friction is not None, "slip needs friction"
        self._friction.creep(slip)

    @property
    def factorisations(self) -> int:
        """Number of matrices that the solver has factorised."""
        return self._solver.factorisations

    @property
    def lagging(self) -> int:
        """Number of steps so far whose normal and horizontal forces were found in turn only (BrushFriction.lagging)."""
        return self._friction.lagging if self._friction else 0

    @property
    def largest_unique(self) -> float | None:
        """Friction coefficient up to which the points that touch at rest have one solution; None without friction."""
        return (
            self._friction.largest_unique(self.patch.force > 0, self._solver)
            if self._friction
            else None
        )

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        kept = self._solver.state() | (self._friction.state() if self._friction else {})
        if self.leans:
            kept |= {
                "normal_force_before": self._force.copy(),
                "normal_tangential": self._tangential.T.copy(),
            }
        return kept

    def set_state(self, state: dict[str, Array]) -> None:
        """Restore the state; what follows is bitwise that of an uninterrupted run."""
        self._touching = None
        self._solver.set_state(state)
        if self._friction:
            self._friction.set_state(state)
        if self.leans:
            self._force[:], self._tangential[:] = (
                state["normal_force_before"],
                state["normal_tangential"].T,
            )


_NO_FORCE = np.zeros((2, 0))


def _pointer(values: Array | None) -> Any:
    return COMPILED.ffi.NULL if values is None else COMPILED.doubles(values)


@dataclass(frozen=True)
class Loop:
    """The parts of a time loop that have a history, which a checkpoint must keep.

    `begun`: changes (k,) N of the forces and displacements (r,) m of the nodes at t = 0, from the static state; None: none.
    """

    tire: LinearTire
    contact: ContactProblem
    memory: TreadMemory | None = None
    begun: tuple[Array, Array] | None = None

    def roll(
        self, drive: Drive, step: float, steps: int, *, done: int = 0, at_once: int = _STEPS_AHEAD
    ) -> Iterator[Block]:
        """Yield the states after each of `steps` steps of `step` s, in blocks. Collective if the tire is.

        A step predicts the tire's motion without its forces, solves the contact and advances the tire.
        `done` steps have been taken before, and all parts are as they were then. The root of
        `tire.comm` solves the contact problem and sends the result; solver and friction of other processes
        stay unchanged, while tire and `memory` (of a viscoelastic tread, whose response within the step is part of
        the solver) advance on each. A block has at most `at_once` steps; 1: the parts are read after each step.
        """
        leans, patch = self.contact.leans, self.contact.patch
        for times, roads, slopes in _roads(drive, patch, step, steps, done, leans):
            for k in range(0, len(times), at_once):
                some = slice(k, k + at_once)
                yield self._block(
                    times[some], roads[some], None if slopes is None else slopes[some]
                )

    def _block(self, times: Array, roads: Array, slopes: Array | None) -> Block:
        tire, contact, memory = self.tire, self.contact, self.memory
        n, count = roads.shape
        force, gap, axle = np.empty((n, count)), np.empty((n, count)), np.empty((n, 3))
        horizontal, change = np.empty((n, 2, count)), np.empty((n, len(contact.change)))
        free_all = np.empty((n, contact.answer.shape[1]))
        residual, penetration, active = np.empty((3, n))
        together = RootSolve(tire.comm, count, looking_ahead(tire))
        iterated = tire if isinstance(tire, IteratedTire) else None
        frames, readings = contact.patch.frames, []
        for k in range(n):
            slope = None if slopes is None else slopes[k]
            tread = memory.predict() if memory else None
            predict, past = tire.predict, contact.state() if iterated else {}
            while True:
                solve = partial(contact.solve, roads[k], slope, tread)
                free, solved = together(predict, solve, contact.components == 3)
                pushed = contact.commit(solved, slope)
                again = iterated.settle(pushed) if iterated else None
                if again is None:
                    break
                contact.set_state(past)
                predict = partial(np.asarray, again)
            free_all[k], change[k] = free, pushed
            tire.advance(pushed)
            if memory:
                memory.advance(contact.at_points)
            force[k], horizontal[k], gap[k] = contact.vertical, contact.horizontal, solved.gap
            residual[k], penetration[k] = solved.residual, solved.penetration
            active[k] = np.count_nonzero(solved.force)
            axle[k] = contact.resultant - tire.inertia_force()
            if frames is not None:
                axle[k] += contact.patch.resultant(force[k], horizontal[k].T) - contact.resultant
            if isinstance(tire, DrivenTire):
                readings.append(tire.reading)
        return Block(
            times, force, horizontal.transpose(0, 2, 1), gap, axle, residual, penetration, active.astype(int),
            change, free_all, np.array(readings) if readings else None, contact,
        )  # fmt: skip

    def begun_at(self, state: dict[str, np.ndarray], change: Array) -> Loop:
        """Begin in a `state` of the contact, with the tire at rest under the changes (k,) N of its forces.

        Collective when the tire looks ahead.
        """
        assert isinstance(self.tire, SteadyTire), f"{type(self.tire).__name__} begins at rest only"
        self.contact.set_state(state)
        return replace(self, begun=(change, self.tire.start_steady(change)))

    def snapshot(self) -> dict[str, np.ndarray]:
        """Arrays by name, between two steps. Collective when the tire is."""
        memory = self.memory.state() if self.memory else {}
        return self.tire.snapshot() | self.contact.state() | memory

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue with the same bits as without interruption, on the same number of processes."""
        self.tire.restore(state)
        self.contact.set_state(state)
        if self.memory:
            self.memory.set_state(state)


def roll(
    tire: LinearTire,
    solver: ContactSolver,
    patch: Patch,
    drive: Drive,
    step: float,
    steps: int,
    friction: BrushFriction | None = None,
    done: int = 0,
    memory: TreadMemory | None = None,
) -> Iterator[Instant]:
    """Yield the state after each of `steps` steps of `step` s of a loop of these parts, which are then as after that step.

    See Loop.roll. Collective if the tire is.
    """
    loop = Loop(tire, ContactProblem(patch, tire.same_step, solver, friction), memory)
    for block in loop.roll(drive, step, steps, done=done, at_once=1):
        yield from block.instants()


def looking_ahead(tire: object) -> Ahead | None:
    """The tire's part that looks ahead, if it has one."""
    found: Ahead | None = getattr(tire, "ahead", None)
    return found


def _roads(
    drive: Drive, patch: Patch, step: float, steps: int, done: int, leans: bool
) -> Iterator[tuple[Any, Any, Any]]:
    """Times (n,) s, road (n, c) m under the points and, if it `leans`, its slope (n, c, 2), for the steps
    after `done`, block by block.

    Blocks of steps are counted from the first step on, so that a restarted loop finds the same
    bits.
    """
    x, y = patch.points[:, 0], patch.points[:, 1]
    block = block_size(len(x))
    for first in range(done - done % block, steps, block):
        times = step * np.arange(first + 1.0, min(first + block, steps) + 1.0)
        along = x + drive.speed * times[:, None]
        across = np.broadcast_to(y, along.shape)
        heights = drive.height(along, across)
        heights = heights + np.array([drive.motion(time) for time in times.tolist()])[:, None]
        slopes = drive.slope(along, across) if leans and drive.slope else None
        skipped = max(done - first, 0)
        if slopes is not None:
            slopes = np.ascontiguousarray(slopes[skipped:], dtype=float)
        yield times[skipped:], np.ascontiguousarray(heights[skipped:], dtype=float), slopes


class DrivenTire:
    """The tire as the contact sees it, including its motion under prescribed forces.

    `seen`: displacements that the contact follows, by default as many as its forces.
    `history` (n + 1, k) N at the steps from t = 0 on; `directions` (k, 3) of unit length. After
    each `advance`: `reading` (r,) m; `work` (J) of the prescribed forces so far (trapezoidal rule);
    `lead`, the additional work of the mean forces that the `scheme` applies during the steps
    (greens.recursion.ahead_of_mean).
    """

    def __init__(
        self,
        tire: PushedTire,
        history: np.ndarray,
        directions: np.ndarray,
        scheme: str = "linear",
        seen: int | None = None,
    ) -> None:
        self._tire, self._history, self._directions = tire, history, directions
        self._forced = history.shape[1] > 0
        self._count = tire.same_step.shape[1] - history.shape[1]
        self._seen = self._count if seen is None else seen
        self._same = tire.same_step
        self.same_step, self.comm = self._same[: self._seen, : self._count], tire.comm
        self.ahead = looking_ahead(tire)
        self._beside = LoadedColumns(self._same[self._seen :])
        # The force that `history` begins with was there before.
        self._ahead = ahead_of_mean(scheme, np.concatenate([history[:1], history]))
        self._step = 0
        self._along = np.zeros(history.shape[1])
        self.work = self.lead = 0.0
        tire.start(np.concatenate([np.zeros(self._count), history[0]]))

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray:
        """Begin at rest under contact forces (c,) N that always were, and `sudden` ones; the displacement (r,) m."""
        assert isinstance(self._tire, SteadyTire), "a convolution begins at rest only"
        none = np.zeros_like(force) if sudden is None else sudden
        always = np.concatenate([force, np.zeros_like(self._history[0])])
        moved = self._tire.start_steady(always, np.concatenate([none, self._history[0]]))
        self._along = moved[self._seen :][: len(self._along)]
        return moved[: self._seen]

    def predict(self) -> np.ndarray:
        """Displacement (c,) m at the end of the step without new contact forces. Collective."""
        self._step += 1
        self._free = self._tire.predict()
        if not self._forced:
            return self._free[: self._seen]
        pushed = self._same[: self._seen, self._count :] @ self._history[self._step]
        return self._free[: self._seen] + pushed

    def advance(self, force: np.ndarray) -> None:
        """Set the contact forces (c,) N at the end of the step."""
        if not self._forced:
            self._tire.advance(force)
            self.reading = self._free[self._seen :] + self._beside @ force
            return
        before, now = self._history[self._step - 1], self._history[self._step]
        acting = np.concatenate([force, now])
        self._tire.advance(acting)
        moved = self._free[self._seen :] + self._beside @ acting
        along, self.reading = np.split(moved, [len(now)])
        self.work += float(0.5 * (before + now) @ (along - self._along))
        self.lead += float(self._ahead[self._step - 1] @ (along - self._along))
        self._along = along

    def inertia_force(self) -> np.ndarray:
        """What axle and contact balance (3,), N: rate of momentum less prescribed forces."""
        rate = self._tire.inertia_force()
        return rate - self._history[self._step] @ self._directions if self._forced else rate

    def snapshot(self) -> dict[str, np.ndarray]:
        """The tire's snapshot and that of the prescribed forces. Collective if the tire's is."""
        own = {
            "driven_step": self._step,
            "driven_along": self._along,
            "driven_work": [self.work, self.lead],
        }
        return self._tire.snapshot() | {name: np.array(value) for name, value in own.items()}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot."""
        self._step = int(state["driven_step"])
        self.work, self.lead = state["driven_work"].tolist()
        self._along = state["driven_along"]
        self._tire.restore(state)
