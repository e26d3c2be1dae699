"""The time loop: the tire's motion without the next force, the contact solution, the step.

Steps of equal size, what a moving road imposes (`driven`), and the contact problem solved on the
root or on every process while parts of the next step are computed ahead of the force.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from mpi4py import MPI

from tireroad.contact.patch import Patch
from tireroad.contact.solver.conditions import Array, ContactSolver
from tireroad.contact.solver.stick_slip import BrushFriction
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

    `force` (c,) N, `gap` (c,) m, `horizontal` (c, 2) N, or (0, 2) without friction.
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
        return Solved(force, gap, values[2 + 2 * c :].reshape(-1, 2), residual, penetration)


def _packed(found: Solved) -> Array:
    scalars = found.residual, found.penetration
    return np.concatenate([scalars, found.force, found.gap, found.horizontal.ravel()])


# Road heights are computed at once for as many steps as make this many points, to share the
# overhead of a call; and for at most so many steps.
_POINTS_AHEAD, _STEPS_AHEAD = 200_000, 64


class LinearTire(Protocol):
    """A linear tire between the forces and displacements of the patch.

    `Recursion` or `Convolution` of greens.recursion; the processes of `comm` advance it together.
    """

    comm: MPI.Comm
    same_step: np.ndarray

    def start(self, force: np.ndarray) -> None: ...

    def predict(self) -> np.ndarray: ...

    def advance(self, force: np.ndarray) -> None: ...

    def inertia_force(self) -> np.ndarray: ...

    def snapshot(self) -> dict[str, np.ndarray]: ...

    def restore(self, state: dict[str, np.ndarray]) -> None: ...


@runtime_checkable
class IteratedTire(LinearTire, Protocol):
    """A tire whose response is known approximately (fem.nonlinear_transient).

    `settle` returns None if its motion under a force is in balance, else the free displacement for
    which the contact has to be solved again.
    """

    def settle(self, force: np.ndarray) -> np.ndarray | None: ...


class Instant(NamedTuple):
    """The state at the end of a step: (c,) arrays in N and m.

    `force` vertical and `horizontal` (c, 2) N; `axle_force` (3,) N; `penetration` (m) of the deepest point in the
    solution; `change` and `moved`: the tire's forces and displacements relative to the static
    state, all components in which the tire's motion is followed.
    """

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


class RoadNormal:
    """Forces of a road that leans: along its normal, and tangential to it.

    On a slope r = (r_x, r_y) a point with the vertical force f and the bristle's force t bears

        (t - f r,  f + t . r)

    to first order in r. What the slope adds moves the tire like every other force; within the step
    it is predicted from the last step's f and t, so that the contact problem stays as it is.
    Neglected are two terms of second order that belong together, as their work does: the change of
    gap -u . r by the horizontal motion u, and the slope met there instead of at the point.
    """

    def __init__(self, count: int) -> None:
        self._force, self._tangential = np.zeros(count), np.zeros((count, 2))

    def added(self, slope: Array | None) -> Array:
        """What the slope (c, 2) adds to the forces (3 c,) N in z, x and y: the prediction."""
        return self._added(slope, self._force, self._tangential)

    def settle(self, slope: Array | None, force: Array, tangential: Array) -> Array:
        """The same for the forces (c,) and (c, 2) N that the step found."""
        self._force, self._tangential = force, tangential
        return self._added(slope, force, tangential)

    @staticmethod
    def _added(slope: Array | None, force: Array, tangential: Array) -> Array:
        out = np.zeros((3, len(force)))
        if slope is not None:
            out[0] = (tangential * slope).sum(axis=1)
            out[1:] = -force * slope.T
        return out.ravel()

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        return {"normal_force_before": self._force, "normal_tangential": self._tangential}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._force, self._tangential = state["normal_force_before"], state["normal_tangential"]


@dataclass(frozen=True)
class Loop:
    """The parts of a time loop that have a history, which a checkpoint must keep."""

    tire: LinearTire
    solver: ContactSolver
    friction: BrushFriction | None = None
    memory: TreadMemory | None = None
    normal: RoadNormal | None = None

    def roll(
        self,
        patch: Patch,
        drive: Drive,
        step: float,
        steps: int,
        *,
        done: int = 0,
        motion: bool = True,
    ) -> Iterator[Instant]:
        """The instants of `roll` with these parts."""
        parts = self.friction, done, self.memory, motion, self.normal
        return roll(self.tire, self.solver, patch, drive, step, steps, *parts)

    def snapshot(self) -> dict[str, np.ndarray]:
        """Arrays by name, between two steps. Collective when the tire is."""
        friction = self.friction.state() if self.friction else {}
        memory = self.memory.state() if self.memory else {}
        normal = self.normal.state() if self.normal else {}
        return self.tire.snapshot() | self.solver.state() | friction | memory | normal

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue with the same bits as without interruption, on the same number of processes."""
        self.tire.restore(state)
        self.solver.set_state(state)
        if self.friction:
            self.friction.set_state(state)
        if self.memory:
            self.memory.set_state(state)
        if self.normal:
            self.normal.set_state(state)


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
    motion: bool = True,
    normal: RoadNormal | None = None,
) -> Iterator[Instant]:
    """Yield the state after each of `steps` steps of `step` seconds. Collective if the tire is.

    `solver` is made for A + C~. With `friction` or a `normal` the tire's forces are three times as
    many: z, then x, then y of all points; its displacements with `friction`. Without a `normal` the
    road's slope is left out. `memory`: that of a viscoelastic tread, whose
    response within the step is part of the solver. `done` steps have been taken before, and tire,
    solver and friction are as they were then. The root of `tire.comm` solves the contact problem
    and sends the result; solver and friction of other processes stay unchanged, while tire and
    `memory` advance on each. Without `motion` nothing is `moved`, for callers that need only
    forces.
    """
    count = len(patch.points)
    still = np.zeros((count, 2))
    rest = still if patch.pull is None or friction else patch.pull
    # The first step starts from the static contact set, later ones from the solver's last one.
    touching = None if done else patch.force > 0
    answer = LoadedColumns.of(tire.same_step, tire.comm)
    settle = tire.settle if isinstance(tire, IteratedTire) else None
    together = RootSolve(tire.comm, count, looking_ahead(tire))
    for time, road, slope in _roads(drive, patch, step, steps, done, normal is not None):
        predict = tire.predict
        tread = memory.predict() if memory else np.zeros((1, count))
        past = friction.state() if friction and settle else {}
        lifted = answer @ normal.added(slope) if normal else 0.0
        while True:
            solve = partial(_contact, solver, friction, patch, tread, road, touching, lifted)
            free, found = together(predict, solve, friction is not None)
            tangential = found.horizontal if friction else still
            vertical, horizontal = found.force, rest + tangential
            if normal:
                more = normal.settle(slope, found.force, tangential).reshape(3, count)
                vertical, horizontal = vertical + more[0], horizontal + more[1:].T
            change = vertical - patch.force
            if friction or normal:
                change = np.concatenate([change, *(horizontal - rest).T])
            touching = None
            again = settle(change) if settle else None
            if again is None:
                break
            predict = partial(np.asarray, again)
            if friction:
                friction.set_state(past)
        moved = free + answer @ change if motion else free[:0]
        tire.advance(change)
        if memory:
            memory.advance(change)
        axle = -tire.inertia_force()
        axle += patch.resultant(vertical, horizontal)
        yield Instant(
            time,
            vertical,
            horizontal,
            found.gap,
            moved[:count],
            axle,
            found.residual,
            found.penetration,
            int(np.count_nonzero(found.force)),
            change[: len(moved)],
            moved,
        )


def looking_ahead(tire: object) -> Ahead | None:
    """The tire's part that looks ahead, if it has one."""
    found: Ahead | None = getattr(tire, "ahead", None)
    return found


def _contact(
    solver: ContactSolver,
    friction: BrushFriction | None,
    patch: Patch,
    tread: np.ndarray,
    road: np.ndarray,
    touching: np.ndarray | None,
    lifted: np.ndarray | float,
    free: np.ndarray,
) -> Solved:
    """The contact in one step; `free` (tire) and `tread` are the motions due to past forces, m, and
    `lifted` the tire's due to what the slope adds in this step."""
    count, free = len(road), free + lifted
    q = patch.gap + free[:count] + tread[0] - road
    if friction is None:
        force, horizontal = solver.solve(q, touching, reference=patch.force), np.zeros((0, 2))
    else:
        beside = tread[1:].ravel() if len(tread) > 1 else 0.0
        given = q, touching, patch.force, free[count:] + beside
        force, horizontal = friction.solve(solver, *given)
    return Solved(force, solver.gap, horizontal, solver.residual, solver.penetration)


def _roads(
    drive: Drive, patch: Patch, step: float, steps: int, done: int, leans: bool
) -> Iterator[tuple[float, np.ndarray, np.ndarray | None]]:
    """Time (s), road (c,) m under the points and, if it `leans`, its slope (c, 2), for each step
    after `done`.

    Blocks of steps are counted from the first step on, so that a restarted loop finds the same
    bits.
    """
    x, y = patch.points[:, 0], patch.points[:, 1]
    block = min(max(_POINTS_AHEAD // len(x), 1), _STEPS_AHEAD)
    for first in range(done - done % block, steps, block):
        times = step * np.arange(first + 1, min(first + block, steps) + 1)
        along = x + drive.speed * times[:, None]
        across = np.broadcast_to(y, along.shape)
        heights = drive.height(along, across)
        slopes = drive.slope(along, across) if leans and drive.slope else None
        for k, time in enumerate(times.tolist(), first):
            if k >= done:
                slope = None if slopes is None else slopes[k - first]
                yield time, heights[k - first] + drive.motion(time), slope


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
        tire: LinearTire,
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
