"""The time loop: a linear tire, its tread, and a road that moves under it.

Each step finds the total contact forces f >= 0 with gaps g >= 0, f . g = 0,

    g = g_static + u_free - r(x + v t, y, t) + (A + C~)(f - f_static),

u_free the tire's motion from past forces, A its answer within the step, C~ the tread's compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from mpi4py import MPI

from tireroad.contact.patch import Patch
from tireroad.contact.solver.conditions import ContactSolver
from tireroad.contact.solver.friction import Friction
from tireroad.contact.solver.together import Ahead, Solved, Together
from tireroad.contact.tread.creep import TreadMemory
from tireroad.greens.residual.sparse_columns import LoadedColumns

# Road heights that are found at once: as many steps as make this many points, so that what a call
# costs is shared; and at most so many steps.
_POINTS_AHEAD, _STEPS_AHEAD = 200_000, 64


class Tire(Protocol):
    """A linear tire between the patch's forces and displacements (greens.recursion, .convolution), taken over the
    steps by the processes of `comm` together.
    """

    comm: MPI.Comm
    same_step: np.ndarray

    def start(self, force: np.ndarray) -> None: ...

    def predict(self) -> np.ndarray: ...

    def advance(self, force: np.ndarray) -> None: ...

    def inertia_force(self) -> np.ndarray: ...

    def snapshot(self) -> dict[str, np.ndarray]: ...

    def restore(self, kept: dict[str, np.ndarray]) -> None: ...


@runtime_checkable
class AheadTire(Tire, Protocol):
    """A tire that may look ahead: None where it does not."""

    ahead: Ahead | None


@runtime_checkable
class NonlinearTire(Tire, Protocol):
    """A tire whose answer is known in approximation (fem.nonlinear_transient): `settle` gives None when
    its motion under a force balances, else the free displacement to solve the contact for again.
    """

    def settle(self, force: np.ndarray) -> np.ndarray | None: ...


class Instant(NamedTuple):
    """The state at the end of a step: (c,) arrays in N and m, `horizontal` (c, 2) N, `axle_force`
    (3,) N; `penetration` (m) of the deepest point as it was solved; `change` and `moved`, what the tire feels and does beyond the static state, all
    components.
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


@dataclass(frozen=True)
class Drive:
    """How the road comes: `height(x, y)` m over the static plane, point by point for arrays of any
    shape, `motion(t)` m, `speed` in m/s.
    """

    height: Callable[[np.ndarray, np.ndarray], np.ndarray]
    motion: Callable[[float], float]
    speed: float


@dataclass(frozen=True)
class Loop:
    """The parts of a time loop that have a past: what a checkpoint has to keep."""

    tire: Tire
    solver: ContactSolver
    friction: Friction | None = None
    memory: TreadMemory | None = None

    def snapshot(self) -> dict[str, np.ndarray]:
        """Arrays by name, between two steps. Collective when the tire is."""
        friction = self.friction.state() if self.friction else {}
        memory = self.memory.state() if self.memory else {}
        return self.tire.snapshot() | self.solver.state() | friction | memory

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on as if nothing had happened: the same bits on the same number of processes."""
        self.tire.restore(kept)
        self.solver.set_state(kept)
        if self.friction:
            self.friction.set_state(kept)
        if self.memory:
            self.memory.set_state(kept)


def roll(
    tire: Tire,
    solver: ContactSolver,
    patch: Patch,
    drive: Drive,
    step: float,
    steps: int,
    friction: Friction | None = None,
    done: int = 0,
    memory: TreadMemory | None = None,
    motion: bool = True,
) -> Iterator[Instant]:
    """Yield the state after each of `steps` steps of `step` seconds. Collective when the tire is.

    `done` of them were taken before, and tire, solver and friction are as they were then.

    The solver was made for A + C~. Of the processes of `tire.comm` the root solves the contact problem, and all have its
    answer; solver and friction of the others stay as they were, the tire and `memory` go on in each. With `friction`, the tire's forces and
    displacements are three times as many: z, then x, then y of all points. `memory`: of a tread that creeps,
    whose part within the step the solver knows. Without `motion` nothing is `moved`, for callers that want forces alone.
    """
    count = len(patch.points)
    horizontal = np.zeros((count, 2)) if patch.pull is None else patch.pull
    # The first step starts from the static contact set, the others from the solver's last one.
    touching = None if done else patch.force > 0
    answer = LoadedColumns.of(tire.same_step, tire.comm)
    settle = tire.settle if isinstance(tire, NonlinearTire) else None
    together = Together(tire.comm, count, looking_ahead(tire))
    for time, road in _roads(drive, patch, step, steps, done):
        predict = tire.predict
        tread = memory.predict() if memory else np.zeros((1, count))
        past = friction.state() if friction and settle else {}
        while True:
            solve = partial(_contact, solver, friction, patch, tread, road, touching)
            free, found = together(predict, solve, friction is not None)
            change = found.force - patch.force
            if friction:
                horizontal = found.horizontal
                change = np.concatenate([change, *horizontal.T])
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
        axle += patch.resultant(found.force, horizontal)
        yield Instant(
            time,
            found.force,
            horizontal,
            found.gap,
            moved[:count],
            axle,
            found.residual,
            found.penetration,
            int(np.count_nonzero(found.force)),
            change,
            moved,
        )


def looking_ahead(tire: Tire) -> Ahead | None:
    """What knows part of a step ahead, where there is such a thing."""
    return tire.ahead if isinstance(tire, AheadTire) else None


def _contact(
    solver: ContactSolver,
    friction: Friction | None,
    patch: Patch,
    tread: np.ndarray,
    road: np.ndarray,
    touching: np.ndarray | None,
    free: np.ndarray,
) -> Solved:
    """The contact of a step: the tire's motion `free` and the tread's `tread` from past forces, m."""
    count = len(road)
    q = patch.gap + free[:count] + tread[0] - road
    if friction is None:
        force, horizontal = solver.solve(q, touching, reference=patch.force), np.zeros((0, 2))
    else:
        beside = tread[1:].ravel() if len(tread) > 1 else 0.0
        given = q, touching, patch.force, free[count:] + beside
        force, horizontal = friction.solve(solver, *given)
    return Solved(force, solver.gap, horizontal, solver.residual, solver.penetration)


def _roads(
    drive: Drive, patch: Patch, step: float, steps: int, done: int
) -> Iterator[tuple[float, np.ndarray]]:
    """Time (s) and road (c,) m under the points for each step after `done`.

    Blocks of steps are counted from the first step on: a loop that goes on finds the same bits.
    """
    x, y = patch.points[:, 0], patch.points[:, 1]
    block = min(max(_POINTS_AHEAD // len(x), 1), _STEPS_AHEAD)
    for first in range(done - done % block, steps, block):
        times = step * np.arange(first + 1, min(first + block, steps) + 1)
        along = x + drive.speed * times[:, None]
        heights = drive.height(along, np.broadcast_to(y, along.shape))
        for k, time in enumerate(times.tolist(), first):
            if k >= done:
                yield time, heights[k - first] + drive.motion(time)
