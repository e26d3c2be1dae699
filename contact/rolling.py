"""The time loop: a linear tire, its tread, and a road that moves under it.

Each step finds the total contact forces f >= 0 with gaps g >= 0, f . g = 0,

    g = g_static + u_free - r(x + v t, y, t) + (A + C~)(f - f_static),

where u_free is the tire's motion due to past forces, A its response within the step, and C~ the
compliance of the tread.
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
from tireroad.greens.recursion import LoadedColumns

# Road heights are computed at once for as many steps as make this many points, to share the
# overhead of a call; and for at most so many steps.
_POINTS_AHEAD, _STEPS_AHEAD = 200_000, 64


class Tire(Protocol):
    """A linear tire between the forces and displacements of the patch.

    greens.recursion or greens.convolution; the processes of `comm` advance it together.
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
    """A tire that may look ahead; `ahead` is None if it does not."""

    ahead: Ahead | None


@runtime_checkable
class NonlinearTire(Tire, Protocol):
    """A tire whose response is known approximately (fem.nonlinear_transient).

    `settle` returns None if its motion under a force is in balance, else the free displacement for
    which the contact has to be solved again.
    """

    def settle(self, force: np.ndarray) -> np.ndarray | None: ...


class Instant(NamedTuple):
    """The state at the end of a step: (c,) arrays in N and m.

    `horizontal` (c, 2) N; `axle_force` (3,) N; `penetration` (m) of the deepest point in the
    solution; `change` and `moved`: the tire's forces and displacements relative to the static
    state, all components.
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
    """The road's approach: `height(x, y)` m over the static plane, pointwise for any shape.

    `motion(t)` m is its vertical motion, `speed` in m/s.
    """

    height: Callable[[np.ndarray, np.ndarray], np.ndarray]
    motion: Callable[[float], float]
    speed: float


@dataclass(frozen=True)
class Loop:
    """The parts of a time loop that have a history, which a checkpoint must keep."""

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
        """Continue with the same bits as without interruption, on the same number of processes."""
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
    """Yield the state after each of `steps` steps of `step` seconds. Collective if the tire is.

    `solver` is made for A + C~. With `friction`, the tire's forces and displacements are three
    times as many: z, then x, then y of all points. `memory`: that of a viscoelastic tread, whose
    response within the step is part of the solver. `done` steps have been taken before, and tire,
    solver and friction are as they were then. The root of `tire.comm` solves the contact problem
    and sends the result; solver and friction of other processes stay unchanged, while tire and
    `memory` advance on each. Without `motion` nothing is `moved`, for callers that need only
    forces.
    """
    count = len(patch.points)
    horizontal = np.zeros((count, 2)) if patch.pull is None else patch.pull
    # The first step starts from the static contact set, later ones from the solver's last one.
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
    """The tire's part that looks ahead, if it has one."""
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
    """The contact in one step; `free` (tire) and `tread` are the motions due to past forces, m."""
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

    Blocks of steps are counted from the first step on, so that a restarted loop finds the same
    bits.
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
