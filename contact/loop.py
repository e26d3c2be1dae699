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
from tireroad.contact.solver.conditions import Array, ContactSolver, Mask, Mixed
from tireroad.contact.solver.grid_newton import GridNewton
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.solver.stick_slip import BrushFriction, CompressedRows
from tireroad.contact.tread.memory import TreadMemory
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.greens.recursion import LoadedColumns, Yields
from tireroad.greens.schemes import SCHEMES

_ROUNDING = 1e-9  # of the number of steps: a duration that is a multiple of the step stays one

# The road is met at places that change gaps by this share of the points' deflections under their own forces, both in the mean
# square. On rough asphalt (points of 3 mm, 22 m/s) axle forces are then 1.3 % of their deviation off, at 1 % 0.7 %.
MEETING = 3e-2
MEETINGS = 20  # solutions of a step, at most
# Slopes up to which points are followed wholly, and from which on they are not.
GENTLE, STEEP = 0.5, 1.0
ASTRAY = 10.0  # times the size of a patch: motions in the plane that are none of a tire

# What needs no contact is computed for as many steps at once as make this many points, and for at most so many.
_POINTS_AHEAD, STEPS_AHEAD = 200_000, 64
_NO_FORCE, _NULL = np.zeros((2, 0)), COMPILED.ffi.NULL


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

    `force` (c,) N, `gap` (c,) m, `horizontal` (2, c) N, or (2, 0) without friction, `slope` (c, 2) of the road that
    the points meet, None where it is level.
    """

    force: Array
    gap: Array
    horizontal: Array
    residual: float
    penetration: float
    slope: Array | None = None


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
        self,
        predict: Callable[[], Array],
        solve: Callable[[Array], Solved],
        horizontal: bool,
        leans: bool,
    ) -> tuple[Array, Solved]:
        """The tire's prediction, and the solution that `solve` finds for it on the root process.

        `horizontal`: whether the solution has horizontal forces; `leans`: whether it has slopes. A ConvergenceError or
        InputError on the root is raised on all processes. Collective.
        """
        if self._comm.size == 1:
            return (free := predict()), solve(free)
        if self._ahead is None:
            return (free := predict()), self._told(solve, free, horizontal, leans)
        free = predict() if self._comm.rank == 0 else np.empty(0)
        self._ahead.look_ahead()
        found = self._told(solve, free, horizontal, leans)
        self._ahead.exchange()
        return free if self._comm.rank == 0 else predict(), found

    def _told(
        self, solve: Callable[[Array], Solved], free: Array, horizontal: bool, leans: bool
    ) -> Solved:
        numbers = 2 + 2 * horizontal + 2 * leans  # of each point
        values, failed = np.empty(2 + numbers * self._count), None
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
        return self._unpacked(values, leans)

    def _unpacked(self, values: Array, leans: bool) -> Solved:
        c = self._count
        residual, penetration = values[:2].tolist()
        force, gap, plane = values[2 : 2 + c], values[2 + c : 2 + 2 * c], values[2 + 2 * c :]
        slope = plane[len(plane) - 2 * c :].reshape(c, 2) if leans else None
        horizontal = plane[: len(plane) - 2 * c * leans].reshape(2, -1)
        return Solved(force, gap, horizontal, residual, penetration, slope)


def _packed(found: Solved) -> Array:
    scalars = found.residual, found.penetration
    slope = () if found.slope is None else found.slope.ravel()
    return np.concatenate([scalars, found.force, found.gap, found.horizontal.ravel(), slope])


def block_size(points: int) -> int:
    """Steps of a block for this many contact points, a power of two."""
    most: int = min(max(_POINTS_AHEAD // points, 1), STEPS_AHEAD)
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


class Turning(Protocol):
    """A wheel that does not turn at a given rate (contact.free_wheel): its `slip` along the road by the rate that it has."""

    @property
    def slip(self) -> float: ...


@runtime_checkable
class IteratedTire(LinearTire, Protocol):
    """A tire whose response is known approximately (fem.nonlinear_transient).

    `settle` returns None if its motion under a force is in balance, else the free displacement for
    which the contact has to be solved again. `yields`: how forces follow displacements (ContactProblem.yields).
    """

    def settle(self, force: np.ndarray, yields: Yields | None = None) -> np.ndarray | None: ...


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
    height along x and y; None for a level road. `relief(x, y)` m: what the tread lacks in height, which moves with it.
    """

    height: Callable[[np.ndarray, np.ndarray], np.ndarray]
    motion: Callable[[float], float]
    speed: float
    slope: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    relief: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None

    def after(self, way: float) -> Drive:
        """The same road, begun with when a `way` (m) of it has passed; its own motion and the relief begin anew."""
        height, slope = self.height, self.slope
        return replace(
            self,
            height=lambda x, y: height(x + way, y),
            slope=None if slope is None else lambda x, y: slope(x + way, y),
        )

    def roads(
        self, patch: Patch, step: float, steps: int, done: int, moving: bool
    ) -> Iterator[tuple[Array, list[RoadMet]]]:
        """Times (n,) s and the road met at each, for the steps of `step` s after `done`, block by block.

        `moving`: whether the points are followed in the plane, so that a road with a slope is read at their places. Blocks
        of steps are counted from the first step on, so that a restarted loop finds the same bits.
        """
        x, y = patch.points[:, 0], patch.points[:, 1]
        block = block_size(len(x))
        for first in range(done - done % block, steps, block):
            times: Array = np.float64(step) * np.arange(
                first + 1.0, min(first + block, steps) + 1.0
            )
            along = x + self.speed * times[:, None]
            across = np.broadcast_to(y, along.shape)
            known = np.zeros(along.shape) + [[self.motion(time)] for time in times.tolist()]
            if self.relief:
                known = known - self.relief(along, across)
            leans = moving and self.slope is not None
            if not leans:
                known = known + self.height(along, across)
            follows = self._follows(along, across, patch) if leans else np.ones(along.shape)
            road = self if leans else None
            farthest = ASTRAY * _widest(patch)
            met = [
                RoadMet(road, along[k], y, known[k], follows[k], farthest)
                for k in range(len(times))
            ]
            skipped = max(done - first, 0)
            yield times[skipped:], met[skipped:]

    def _follows(self, along: Array, across: Array, patch: Patch) -> Array:
        """Shares (n, c) of their motion with which points are followed: 1 where no flank one point before or behind or nearer
        is steeper than GENTLE, 0 from STEEP on."""
        assert self.slope is not None, "a road that leans"
        apart = np.multiply.outer((-1.0, -0.5, 0.0, 0.5, 1.0), 2.0 * patch.half_sizes[:, 0])
        x = (along + apart[:, None]).reshape(-1, along.shape[1])
        slope = self.slope(x, np.tile(across, (len(apart), 1)))
        steepest = np.sqrt((slope**2).sum(axis=-1)).reshape(len(apart), *along.shape).max(axis=0)
        way: Array = np.clip((STEEP - steepest) / (STEEP - GENTLE), 0.0, 1.0)
        return way * way * (3.0 - 2.0 * way)


@dataclass(frozen=True)
class RoadMet:
    """The road under the points at the end of a step: `known` (c,) m on a level road, and on one that is `driven` over to be
    added to its height at the places of the points, `along` and `across` (c,) m of their own. `follows` (c,): share of
    their motion with which the points are followed; `farthest` m that they may have moved."""

    driven: Drive | None
    along: Array
    across: Array
    known: Array
    follows: Array
    farthest: float = np.inf

    @staticmethod
    def level(patch: Patch) -> RoadMet:
        """A level road at rest."""
        x, y, _ = patch.points.T
        return RoadMet(None, x, y, np.zeros(len(x)), np.ones(len(x)))

    @property
    def leans(self) -> bool:
        """Whether the road has a slope, and is met where the points have moved to."""
        return self.driven is not None

    def at(self, place: Array) -> tuple[Array, Array]:
        """Height (c,) m and slope (c, 2) of a road that leans, for points at a `place` (2, c) m beside their own.

        ConvergenceError beyond the `farthest`: heights are kept of all of the road between the points, and would take all memory.
        """
        if not (moved := float(np.abs(place).max(initial=0.0))) <= self.farthest:
            raise ConvergenceError(
                f"contact: points have moved by {moved:.3g} m in the plane, {ASTRAY:g} times as far as they lie apart: the motion has grown "
                'without bound; take a smaller [time] step or scheme = "constant"'
            )
        assert self.driven is not None and self.driven.slope is not None, "a road that leans"
        x, y = (self.along + place[0])[None], (self.across + place[1])[None]
        slope = np.ascontiguousarray(self.driven.slope(x, y)[0], dtype=float)
        return self.driven.height(x, y)[0] + self.known, slope


class ContactProblem:
    """The contact of a step between the `patch`'s points and the road: normal, or with `friction` too.

    `same_step` (k, k) m/N: displacements at the end of a step of the nodes under forces on them, in z, or in z, then x,
    then y. `solver` is made for the normal compliance A + C~. `of_nodes`: the same where the nodes move more than the contact
    counts of it, because they have a part of the tread (contact.tread.between_nodes).

    A point meets the road where it lies, at its place x + u, y + v of the same instant (near flanks steeper than GENTLE only in
    part, near those of STEEP at its place at rest: on them a point has several places to rest at), and on a slope r = (r_x, r_y)
    there a point with the vertical force f and the bristle's force t bears

        (t - f r,  f + t . r),

    so that the work of the force is that of the gap's change, -r . (u, v). Both are found by solving the contact again with
    the road met at the places found and with what the slope added there, until the mean square of what either changes of the gaps
    is `tolerance` of that of the points' deflections under their own forces. The first solution is at the places and forces
    extrapolated from the last two steps; with friction it is rough (one turn), so that each step has a second. A place is approached by 1 / (1 + r . r B/A)
    of the way, A and B the compliances of the point normal to the road and in its plane, and by Anderson's acceleration (J. ACM 12
    (1965) 547). Where the motion in the plane is not followed (one component) the points stay, on a level road.

    After `solve` and `commit`: `vertical` (c,), `horizontal` (2, c) N on the tire, `change` (k,) N on the nodes from the
    static state, `resultant` (3,) N. Compiled (contact/solver/contact.c). Not collective.
    """

    def __init__(
        self,
        patch: Patch,
        same_step: Array,
        solver: ContactSolver,
        friction: BrushFriction | None = None,
        tolerance: float = MEETING,
        of_nodes: Array | None = None,
    ) -> None:
        self.patch, self._solver, self._friction = patch, solver, friction
        self._tolerance = tolerance
        c = len(patch.points)
        p = c if patch.weights is None else patch.weights.shape[1]
        self.nodes, self.components = p, len(same_step) // p
        self._felt = np.ascontiguousarray(same_step.T)  # (k, k)
        self.answer = self._felt if of_nodes is None else np.ascontiguousarray(of_nodes.T)
        weights = sparse.identity(p, format="csr") if patch.weights is None else patch.weights
        self._weights: sparse.csr_matrix = weights.tocsr()
        self._slope: Array | None = None
        up, down = CompressedRows(weights), CompressedRows(weights.T)
        self._q, self._free = np.zeros(c), np.zeros((2, c))
        self._touching: Mask | None = patch.force > 0
        self.vertical, self.horizontal, self.resultant = np.zeros(c), np.zeros((2, c)), np.zeros(3)
        # Changes of the forces from the static state, on the nodes and on the points.
        self.change, self.at_points = np.zeros(len(same_step)), np.zeros(self.components * c)
        # Normal forces, bristles' forces and shifts in the plane of the last solution, and as they were a step before.
        self._solution = np.zeros((5, c))
        self._before = np.zeros((5, c))
        self._force, self._tangential, self._shift = (
            self._solution[part] for part in (0, slice(1, 3), slice(3, 5))
        )
        self.solutions = self.unsettled = 0
        self._at_once: GridNewton | None = None
        if friction is not None and isinstance(solver, ProjectedCG) and solver.tread is not None:
            self._at_once, self._at_zero = (
                GridNewton(solver, friction, same_step, patch),
                np.zeros(c),
            )
        if self.components == 3:
            self._in_plane = _in_plane(same_step, weights, p)
        doubles = {
            "gap0": np.ascontiguousarray(patch.gap), "at_rest": np.ascontiguousarray(patch.force), "q": self._q,
            "free": self._free, "vertical": self.vertical, "horizontal": self.horizontal, "change": self.at_points,
            "nodal": self.change, "resultant": self.resultant, "answer": self._felt, "normal_force": self._force,
            "tangential": self._tangential, "shift": self._shift, "lifted": np.empty(len(same_step)),
            "added": np.empty(3 * c), "value": np.empty(3 * p),
        }  # fmt: skip
        self._at_rest = doubles["at_rest"]
        if patch.pull is not None and friction is None:
            doubles["rest"] = np.ascontiguousarray(patch.pull.T)
        self._held: dict[str, Any] = {
            name: COMPILED.doubles(values) for name, values in doubles.items()
        }
        self._held |= {
            "points": c, "nodes": p, "components": self.components, "which": COMPILED.ints(np.empty(3 * p, np.int32)),
        } | up.named("w_") | down.named("t_")  # fmt: skip
        self._compiled = COMPILED.ffi.new("meeting *", self._held)

    @property
    def has_friction(self) -> bool:
        """Whether bristles carry horizontal forces."""
        return self._friction is not None

    def solve(self, road: RoadMet, tread: Array | None, free: Array, again: bool = False) -> Solved:
        """The forces on the `road` for displacements `free` (k,) m of the nodes without those of the step.

        `tread` (1 or 3, c) m: displacements of a tread that creeps due to its past. `again`: the same step once more for
        other displacements, from its last solution.
        """
        if self._at_once:
            return self._solve_at_once(self._at_once, road, tread, free, again)
        if not road.leans:
            return self._solve_at(road.known, None, tread, free, again)
        nodes, tips = COMPILED.doubles(free), self._friction.compiled if self._friction else _NULL
        place, found, mixed = np.empty((2, len(self._q))), np.empty((2, len(self._q))), Mixed()
        if not again:
            last = self._solution.copy()
            self._solution += last - self._before
            self._before = last
        COMPILED.lib.meeting_place(self._compiled, nodes, COMPILED.doubles(place))
        place *= road.follows
        for turn in range(MEETINGS):
            height, slope = road.at(place)
            force, pulled = self._force.copy(), self._tangential.copy()
            self.solutions += 1
            first = turn == 0 and not again
            solved = self._solve_at(height, slope, tread, free, again=not first, rough=first)
            self.commit(solved)
            COMPILED.lib.meeting_shift(self._compiled, nodes, tips)
            COMPILED.lib.meeting_place(self._compiled, nodes, COMPILED.doubles(found))
            rest = road.follows * found - place
            settled = self._settled(solved, rest, self._force - force, self._tangential - pulled)
            if settled and not (first and self.has_friction):
                return solved
            steep = (slope * slope).sum(axis=1)
            way = np.where(
                self._force > 0.0, 1.0 / (1.0 + steep * self._in_plane / self._solver.diagonal), 1.0
            )
            place = mixed.next(place, way * rest, np.where(self._force > 0.0, slope.T, 0.0))
        self.unsettled += 1
        return solved

    def _solve_at_once(
        self, solver: GridNewton, road: RoadMet, tread: Array | None, free: Array, again: bool
    ) -> Solved:
        """As `solve`, the road read in each Newton step."""
        given = COMPILED.doubles(free), COMPILED.doubles(self._at_zero), _NULL, _pointer(tread)
        COMPILED.lib.meeting_prepare(self._compiled, *given)

        def read(place: Array) -> tuple[Array, Array]:
            return road.at(road.follows * place)

        reading = read if road.leans else None
        found = solver.solve(self._q, self._free, reading, road.known, self._tolerance, again)
        self.solutions += found.turns
        self.unsettled += found.astray
        slope = found.slope if road.leans else None
        return Solved(
            found.force[0], found.gap, found.force[1:], found.residual, found.penetration, slope
        )

    def _settled(self, solved: Solved, rest: Array, force: Array, pulled: Array) -> bool:
        """Whether places that are off by `rest` (2, c) m and a slope's forces of a solution that has changed by `force` (c,)
        and `pulled` (2, c) N since change gaps by no more than the tolerance, among them those that would close."""
        assert solved.slope is not None, "of a road that leans"
        own, r, touches = self._solver.diagonal, solved.slope.T, self._force > 0.0
        read = np.abs((r * rest).sum(axis=0))
        leant = own * np.abs((r * pulled).sum(axis=0))
        leant += (r * r).sum(axis=0) * self._in_plane * np.abs(force)
        changed = np.where(touches, read + leant, np.maximum(read + leant - solved.gap, 0.0))
        limit = self._tolerance * np.linalg.norm(own * self._force)
        return bool(np.linalg.norm(changed) <= limit)

    def _solve_at(
        self,
        road: Array,
        slope: Array | None,
        tread: Array | None,
        free: Array,
        again: bool = False,
        rough: bool = False,
    ) -> Solved:
        """The forces on a road of heights (c,) m and `slope` (c, 2) under the points, `again` for the same step."""
        given = COMPILED.doubles(free), COMPILED.doubles(road), _pointer(slope), _pointer(tread)
        COMPILED.lib.meeting_prepare(self._compiled, *given)
        solver, touching = self._solver, self._force > 0.0 if again else self._touching
        if self._friction is None:
            force, tangential = solver.solve(self._q, touching, reference=self._at_rest), _NO_FORCE
        else:
            force, plane = self._friction.solve(
                solver, self._q, touching, self._at_rest, self._free, again, rough
            )
            tangential = plane.T
        return Solved(force, solver.gap, tangential, solver.residual, solver.penetration, slope)

    def commit(self, solved: Solved) -> Array:
        """Set the solution of the step; returns the change (k,) N of the forces on the nodes."""
        self._slope = solved.slope
        tangential = _pointer(solved.horizontal if self._friction else None)
        force = COMPILED.doubles(solved.force)
        COMPILED.lib.meeting_conclude(self._compiled, force, tangential, _pointer(solved.slope))
        self._touching = None
        return self.change

    @property
    def touching(self) -> Array:
        """Where points touch, (c, 3): 1 or 0, and the slope (r_x, r_y) of the road that they meet, after `commit`."""
        slope = np.zeros((len(self._force), 2)) if self._slope is None else self._slope
        return np.column_stack([self._force > 0.0, slope])

    def bearing(self, touching: Array) -> tuple[sparse.csr_matrix, Array]:
        """n (t, k) between points that are `touching` and the nodes' components, (1, -r_x, -r_y) in z, x, y; C (t, t) m/N of
        the tread there beyond what the nodes have of it."""
        index, p = np.flatnonzero(touching[:, 0]), self.nodes
        weights = self._weights[index]
        normal = [weights]
        if self.components == 3:
            normal += [sparse.diags(-r) @ weights for r in touching[index, 1:].T]
        lean = sparse.hstack(normal, format="csr")
        level = (weights @ (weights @ self._felt.T[:p, :p]).T).T
        resolved = (lean @ (lean @ (self.answer - self._felt).T).T).T
        return lean, self._solver.block(index) - level - resolved

    def total(self, nodal: Array) -> Array:
        """Sum (3,) N of forces (k,) on the nodes."""
        z, *plane = nodal.reshape(self.components, self.nodes).sum(axis=1)
        return np.array([*(plane or (0.0, 0.0)), z])

    def yields(self, moved: Array) -> Array:
        """Changes (k, m) N of the forces on the nodes by further displacements (r, m) m of them, after `commit`: of normal forces,
        while the same points touch the road where they do.

            f' = -n^T (n A n^T + C)^-1 n w,   n and C of `bearing`, A that of the nodes within a step.
        """
        lean, tread = self.bearing(self.touching)
        whole = (lean @ (lean @ self.answer.T).T).T
        return -(lean.T @ np.linalg.solve(whole + tread, lean @ moved[: lean.shape[1]]))

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
        kept = (self._at_once or self._solver).state() | (
            self._friction.state() if self._friction else {}
        )
        if self.components == 3:
            kept |= {
                "met": np.stack([self._solution, self._before]),
                "meetings": np.array([self.solutions, self.unsettled]),
            }
        return kept

    def set_state(self, state: dict[str, Array]) -> None:
        """Restore the state; what follows is bitwise that of an uninterrupted run."""
        self._touching = None
        (self._at_once or self._solver).set_state(state)
        if self._friction:
            self._friction.set_state(state)
        if self.components == 3:
            self._solution[:], self._before[:] = state["met"]
            self.solutions, self.unsettled = (int(count) for count in state["meetings"])


def _widest(patch: Patch) -> float:
    """Size (m) of the rectangle that a patch's points lie in, along or across, the larger one."""
    x0, x1, y0, y1 = patch.extent
    return float(np.max([x1 - x0, y1 - y0] + 2.0 * patch.half_sizes.max(axis=0)))


def _in_plane(same_step: Array, weights: sparse.csr_matrix, p: int) -> Array:
    """Compliance (c,) m/N in the plane of each point of the tire under its own force, the mean of both directions."""
    blocks = (same_step[d * p : (d + 1) * p, d * p : (d + 1) * p] for d in (1, 2))
    x, y = (np.asarray(weights.multiply(weights @ block).sum(axis=1)).ravel() for block in blocks)
    return 0.5 * (x + y)


def _pointer(values: Array | None) -> Any:
    return _NULL if values is None else COMPILED.doubles(values)


@dataclass(frozen=True)
class Loop:
    """The parts of a time loop that have a history, which a checkpoint must keep.

    `begun`: changes (k,) N of the forces and displacements (r,) m of the nodes at t = 0, from the static state; None: none.
    `slips`: (2,) or (c, 2) at a given rate, to which that of a wheel that turns freely is added; None: its rate is held.
    """

    tire: LinearTire
    contact: ContactProblem
    memory: TreadMemory | None = None
    begun: tuple[Array, Array] | None = None
    slips: Array | None = None

    def roll(
        self, drive: Drive, step: float, steps: int, *, done: int = 0, at_once: int = STEPS_AHEAD
    ) -> Iterator[Block]:
        """Yield the states after each of `steps` steps of `step` s, in blocks. Collective if the tire is.

        A step predicts the tire's motion without its forces, solves the contact and advances the tire.
        `done` steps have been taken before, and all parts are as they were then. The root of
        `tire.comm` solves the contact problem and sends the result; solver and friction of other processes
        stay unchanged, while tire and `memory` (of a viscoelastic tread, whose response within the step is part of
        the solver) advance on each. A block has at most `at_once` steps; 1: the parts are read after each step.
        """
        moving, patch = self.contact.components == 3, self.contact.patch
        for times, roads in drive.roads(patch, step, steps, done, moving):
            for k in range(0, len(times), at_once):
                some = slice(k, k + at_once)
                yield self._block(times[some], roads[some])

    def _block(self, times: Array, roads: list[RoadMet]) -> Block:
        tire, contact, memory = self.tire, self.contact, self.memory
        n, count = len(times), len(contact.vertical)
        force, gap, axle = np.empty((n, count)), np.empty((n, count)), np.empty((n, 3))
        horizontal, change = np.empty((n, 2, count)), np.empty((n, len(contact.change)))
        free_all = np.empty((n, contact.answer.shape[1]))
        residual, penetration, active = np.empty((3, n))
        together = RootSolve(tire.comm, count, looking_ahead(tire))
        iterated = tire if isinstance(tire, IteratedTire) else None
        frames, readings = contact.patch.frames, []
        for k in range(n):
            tread = memory.predict() if memory else None
            solve, predict = partial(contact.solve, roads[k], tread), tire.predict
            while True:
                free, solved = together(predict, solve, contact.has_friction, roads[k].leans)
                pushed = contact.commit(solved)
                moved = iterated.settle(pushed, contact.yields) if iterated else None
                if moved is None:
                    break
                solve, predict = partial(solve, again=True), partial(np.asarray, moved)
            free_all[k], change[k] = free, pushed
            tire.advance(pushed)
            self._slip()
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

    def _slip(self) -> None:
        """Let bristles slip as the wheel turns now."""
        if (wheel := turning(self.tire)) is not None and self.slips is not None:
            self.contact.creep(self.slips + np.array([wheel.slip, 0.0]))

    def begun_at(self, state: dict[str, np.ndarray], change: Array) -> Loop:
        """Begin in a `state` of the contact, with the tire at rest under the changes (k,) N of its forces.

        Collective when the tire looks ahead.
        """
        assert isinstance(self.tire, SteadyTire), f"{type(self.tire).__name__} begins at rest only"
        self.contact.set_state(state)
        if self.memory:
            self.memory.set_state(state)
        return replace(self, begun=(change, self.tire.start_steady(change)))

    def snapshot(self) -> dict[str, np.ndarray]:
        """Arrays by name, between two steps. Collective when the tire is."""
        memory = self.memory.state() if self.memory else {}
        return self.tire.snapshot() | self.contact.state() | memory

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Restore the state; results are bitwise those of an uninterrupted run on as many processes."""
        self.tire.restore(state)
        self.contact.set_state(state)
        self._slip()
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


def turning(tire: object) -> Turning | None:
    """The wheel of a tire, if its rate is not given."""
    found: Turning | None = getattr(tire, "turning", None)
    return found


class DrivenTire:
    """The tire as the contact sees it, including its motion under prescribed forces.

    `seen`: displacements that the contact follows, by default as many as its forces.
    `history` (n + 1, k) N at the steps from t = 0 on; `directions` (k, 3) of unit length. After
    each `advance`: `reading` (r,) m; `work` (J) of the prescribed forces so far (trapezoidal rule);
    `lead`, the additional work of the mean forces that the `scheme` applies during the steps
    (greens.schemes.Scheme.ahead_of_mean).
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
        self._ahead = SCHEMES[scheme].ahead_of_mean(np.concatenate([history[:1], history]))
        self._step = 0
        self._along = np.zeros(history.shape[1])
        self.work = self.lead = 0.0
        if isinstance(tire, IteratedTire):
            self._iterated, self.settle = tire, self._settled
        self.turning = turning(tire)
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
        return self._pushed(self._tire.predict())

    def _pushed(self, free: np.ndarray) -> np.ndarray:
        """Displacements (c,) m along the contact's components, of motions (r,) m without the forces of the step."""
        self._free = free
        if not self._forced:
            return free[: self._seen]
        pushed = self._same[: self._seen, self._count :] @ self._history[self._step]
        seen: np.ndarray = free[: self._seen] + pushed
        return seen

    def _settled(self, force: np.ndarray, yields: Yields | None = None) -> np.ndarray | None:
        """IteratedTire.settle, of a tire that is iterated."""

        def all_yield(moved: np.ndarray) -> np.ndarray:
            assert yields is not None, "how the contact yields"
            given = np.zeros((self._history.shape[1], moved.shape[1]))
            return np.concatenate([yields(moved[: self._seen]), given])

        acting = np.concatenate([force, self._history[self._step]])
        again = self._iterated.settle(acting, all_yield if yields else None)
        return None if again is None else self._pushed(again)

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
        """Inertia force (3,) N that axle and contact balance: rate of momentum less prescribed forces."""
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
