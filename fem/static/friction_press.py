"""Pressing a tire on a road with friction, and sliding it there."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.optimize import root_scalar

from tireroad.fem.collective import from_local_rows
from tireroad.fem.errors import ConvergenceError, InputError, LoadingStopped
from tireroad.fem.static.equilibrium import Equilibrium, SolveOutcome
from tireroad.fem.static.friction_road import Passing, RubbingRoad, Sliding, StandingFriction
from tireroad.fem.static.load_steps import LoadStepper, Show, march
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.tangent import ConstrainedSystem, PrescribedMotion
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body

Array = np.ndarray
_NUDGE = 1e-5  # of the last point of a curve: step of the tangent's difference quotient
_NEAR, _CLOSE = 1e-4, 1e-8  # of the travel: first offset tried, and tolerance of the secant method
_MOST = 40  # secant iterations
_ADVICE = (
    "Take a smaller static.friction or slip, smaller elements at the footprint (tire.footprint_size), or more "
    "static.friction_steps"
)


class RubbingSystem:
    """Uses the `road`'s sets at the time of each `take`. All methods are collective.

        (L K + S) P dv = L (- out) - springs,     du = P dv:

    L adds to the horizontal rows of slipping nodes -mu n times the part of their rows that is the
    normal force; S are the springs across their path; P moves sticking nodes with the free node
    ahead of them on their streamline. None of these is symmetric.
    """

    def __init__(self, comm: MPI.Comm, matrix: PETSc.Mat, timing: Timing, road: RubbingRoad):
        self._comm, self._timing, self._road = comm, timing, road
        self._inner = ConstrainedSystem(comm, matrix, "lu", timing)
        self._carried: PETSc.Mat | None = None

    @property
    def gap_closure(self) -> PrescribedMotion:
        """As in ConstrainedSystem, in dv."""
        return self._inner.gap_closure

    @property
    def road_rise(self) -> PrescribedMotion:
        """As in ConstrainedSystem, in dv."""
        return self._inner.road_rise

    def take(self, matrix: PETSc.Mat, held: Array, gap_closure: Array, road_rise: Array) -> bool:
        """Factorise; `matrix` must not be used afterwards."""
        with self._timing("road"):
            system = self._joined(matrix)
        step = self._inner.take(system, held, gap_closure, road_rise)
        if system is not matrix:
            system.destroy()
        return step

    def solve(self, right: Array, moved: PrescribedMotion | None = None) -> tuple[Array, Array]:
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
        couplings = self._road.couplings()
        unknowns, springs, ahead = couplings.unknowns, couplings.springs, couplings.ahead
        rows = _sparse(
            matrix,
            np.broadcast_to(unknowns[:, :, None], couplings.shares.shape),
            np.broadcast_to(couplings.sources[:, None, :] + first, couplings.shares.shape),
            couplings.shares,
        )
        row = np.broadcast_to(unknowns[:, :, None], springs.shape)
        own = np.broadcast_to(unknowns[:, None, :] + first, springs.shape)
        far = np.broadcast_to((3 * ahead[:, None] + np.arange(2))[:, None, :], springs.shape)
        led = np.broadcast_to((ahead >= 0)[:, None, None], springs.shape)
        return rows, _sparse(
            matrix,
            np.concatenate([row.ravel(), row[led]]),
            np.concatenate([own.ravel(), far[led]]),
            np.concatenate([couplings.own.ravel(), -springs[led]]),
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


class RubbingEquilibrium(Equilibrium):
    """`Equilibrium` with coefficient `friction` and slip as in `sliding`. Collective."""

    road: RubbingRoad

    def __init__(self, body: Body, rolling: Rolling, friction: float, sliding: Sliding) -> None:
        self._given = friction, sliding
        super().__init__(body, rolling, sliding.shape)

    def _make_road(self) -> RubbingRoad:
        return RubbingRoad(self.body, *self._given)

    def _make_system(self, kind: str) -> RubbingSystem:
        return RubbingSystem(self.body.comm, self.matrix, self.cost, self.road)

    def _make_contact(self) -> None:
        """None: the tangent is unsymmetric."""

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> SolveOutcome:
        """As without friction."""
        self.road.search()
        return super().solve(road_height, load, allowed)

    def nudged(self, load: float) -> np.ndarray:
        """Sum (2,) N of the forces along and across the road after one step under `load` (N).

        The stick and slip sets are kept, and the state is restored. Raises ConvergenceError for a
        singular tangent. Collective."""
        field = self.body.u.x
        before, self._before.x.array[:] = (field.array.copy(), self.road.snapshot()), field.array
        self._residual()
        if not self._take_tangent() or self._move(self._system.gap_closure, load):
            raise ConvergenceError("static: the tangent of a state with friction is singular")
        for _ in range(1, self.correction_steps):  # what an incomplete tangent left
            self._residual()
            self._move(None, load)
        pulled = self.body.comm.allreduce(self.road.pull.sum(axis=0))
        field.array[:] = before[0]
        self.road.restore(before[1])
        return pulled


@dataclass(frozen=True)
class Slid:
    """State at `moved` (m of the road, or slip of a rolling wheel).

    `force` N in that direction; `tangent` N/m (rolling: N), its derivative with the stick and slip
    sets kept; `moment` N m of the road's forces about the vertical through the axle's centre;
    `sticks`: share of the load on sticking nodes."""

    moved: float
    force: float
    tangent: float
    moment: float
    sticks: float


class Slide:
    """Sliding from a `state` with friction, to which the body is set; `axis` 0 along the road, 1
    across it. All methods are collective.

    Under a standing tire the road moves along or across by d at constant load; each step starts
    from the stick and slip of the last. A rolling wheel is given slip instead, s_x = s (driving) or
    s_y = -s (drifting to the right), at constant travel per radian; each state is steady. The force
    is that of the road on the tire in the direction of motion; its limit is mu times the normal
    force.
    """

    def __init__(self, body: Body, state: StaticState, friction: float, axis: int) -> None:
        if state.pull is None or state.road_height is None:
            raise InputError("slide: a static state with friction on a road is needed")
        self._axis, self._height = axis, state.road_height
        self._load = state.load * state.road.upright
        rolls = state.travel is not None
        sliding = (
            Passing(body, state.travel, shape=state.road)
            if state.travel is not None
            else StandingFriction(body, state.road)
        )
        self._sliding, self.rolls = sliding, rolls
        body.u.x.array[:] = 0.0  # the force scale is that of the undeformed body
        self.problem = RubbingEquilibrium(body, state.rolling, friction, sliding)
        self.problem.pressure.value = state.inflation
        body.set_displacement(state.displacement)
        face, force, pull = body.surface, np.zeros(body.nodes), np.zeros((body.nodes, 2))
        force[face.local], pull[face.local] = state.force[face.place], state.pull[face.place]
        self.problem.road.resume(force, pull, self._height)
        self._sliding.commit()

    def start(self, slip: tuple[float, float]) -> float:
        """Go to the start of the curve, where the wheel's slip along the axis is zero.

        Returns the slope of the force there, N/m, for a rolling wheel N. Raises ConvergenceError if
        the state is not recovered."""
        sliding, own = self._sliding, slip[self._axis]
        if isinstance(sliding, Passing):
            sliding.slip = slip
        step = self.problem.solve(self._height, self._load)
        if not step.converged:
            raise ConvergenceError(
                f"static: the state with friction is not found again ({step.reason})"
            )
        if own:
            shift = self._shift(own if self._axis == 0 else -own)
            self._to(1.0, 0.0, lambda part: shift(-part * own if self._axis == 0 else part * own))
        return self._rate(self._shift(0.0), 1e-6)

    def _shift(self, moved: float) -> Callable[[float], None]:
        """Function that sets the road to `more` beyond `moved`."""
        sliding, axis = self._sliding, self._axis

        def shift(more: float) -> None:
            value = moved + more
            if isinstance(sliding, Passing):
                along, across = sliding.slip
                sliding.slip = (value, across) if axis == 0 else (along, -value)
            else:
                sliding.place[axis] = value

        return shift

    def curve(self, ends: Sequence[float]) -> Iterator[Slid]:
        """The states at ascending `ends`. Raises ConvergenceError if no equilibrium is found."""
        done = 0.0
        for end in ends:
            self._to(end, done, self._shift(0.0))
            done = end
            yield self._found(end, _NUDGE * ends[-1])

    def _to(self, end: float, start: float, put: Callable[[float], None]) -> None:
        at, begins = start, True

        def attempt(target: float) -> SolveOutcome:
            """Each part starts from the last stick and slip; new contacts have slid since then."""
            nonlocal at, begins
            if begins:
                self._sliding.commit()
            put(target)
            step = self.problem.solve(self.problem.road.height, self._load)
            begins = step.converged
            at = target if begins else at
            put(at)
            return step

        show = (
            Show("slip of the wheel", 1.0, "") if self.rolls else Show("way of the road", 1.0, "m")
        )
        try:
            march(attempt, end, end - start, show, start)
        except LoadingStopped as error:
            raise ConvergenceError(
                f"{error}. Take more stiffness.slide_steps, or smaller elements at the footprint (tire.footprint_size)"
            ) from None

    def _force(self) -> float:
        pull = self.problem.road.pull[:, self._axis].sum()
        return self.problem.body.comm.allreduce(float(pull))

    def _rate(self, shift: Callable[[float], None], size: float) -> float:
        before = self._force()
        shift(size)
        after = self.problem.nudged(self._load)[self._axis]
        shift(0.0)
        return (after - before) / size

    def _found(self, moved: float, size: float) -> Slid:
        state, road = static_state(self.problem, 0.0), self.problem.road
        pressing = road.pressing()
        sums = np.array([pressing[road.sticks].sum(), pressing.sum()])
        stuck, whole = self.problem.body.comm.allreduce(sums)
        rate = self._rate(self._shift(moved), size)
        return Slid(moved, self._force(), rate, float(state.moment[2]), float(stuck / whole))


@dataclass(frozen=True, kw_only=True)
class Friction:
    """`coefficient` mu; `steps` in which a standing tire is pressed on the road. For a rolling
    tire: `slip` (s_x, s_y), > 0 driving and drifting towards +y, and `radius` (m), its travel per
    radian without slip; None: that at which no horizontal drag acts.
    """

    coefficient: float
    steps: int = 10
    radius: float | None = None
    slip: tuple[float, float] = (0.0, 0.0)


def with_friction(
    loader: LoadStepper, inflated: np.ndarray, load: float | None, friction: Friction
) -> LoadStepper:
    """The `loader`'s state on the road, with friction. Collective.

    `inflated`: `u` of the body before it met the road; `load` (N) of the road along its normal
    under the axle, None: its height is kept.

    Stick and slip under a standing tire depend on the load path: the inflated tire is pressed on
    the road again in equal steps. Under a steadily rolling tire they do not: Newton's method starts
    from the frictionless state, and the travel per radian at which a free-rolling wheel has no
    horizontal force is found by the secant method.
    """
    equilibrium = loader.equilibrium
    if load is not None:
        load *= equilibrium.shape.upright
    if equilibrium.rolling.speed:
        return _rolling(loader, load, friction)
    return _pressed(loader, inflated, load, friction)


def _on(
    loader: LoadStepper, sliding: StandingFriction | Passing, friction: Friction
) -> tuple[LoadStepper, RubbingEquilibrium]:
    old = loader.equilibrium
    equilibrium = RubbingEquilibrium(loader.body, old.rolling, friction.coefficient, sliding)
    equilibrium.pressure.value = float(old.pressure.value)
    other = LoadStepper(equilibrium, loader.report)
    other.begin_at(loader)
    return other, equilibrium


def _pressed(
    loader: LoadStepper, inflated: np.ndarray, load: float | None, friction: Friction
) -> LoadStepper:
    """Standing: each step slips relative to the last one; the last one carries the load."""
    deflection, body = loader.deflection, loader.body
    body.u.x.array[:] = inflated
    sliding = StandingFriction(body, loader.equilibrium.shape)
    rubbing, _ = _on(loader, sliding, friction)
    size, done = deflection / friction.steps, 0.0

    def attempt(reached: float) -> SolveOutcome:
        return rubbing.equilibrium.solve(rubbing.touch + reached)

    for number in range(1, friction.steps + 1):
        sliding.commit()
        further = deflection * number / friction.steps
        rubbing.march(attempt, further, size, Show("deflection with friction", 1.0, "m"), done)
        done = further
    if load is not None:
        _checked(rubbing, rubbing.equilibrium.solve(rubbing.touch + deflection, load))
    return rubbing


def _rolling(loader: LoadStepper, load: float | None, friction: Friction) -> LoadStepper:
    radius = friction.radius
    if radius is None:
        radius = static_state(loader.equilibrium, loader.touch).rolling_radius()
    sliding = Passing(loader.body, radius, shape=loader.equilibrium.shape)
    height, force = loader.equilibrium.road_height, loader.equilibrium.contact_force()
    rubbing, problem = _on(loader, sliding, friction)
    road = problem.road
    assert height is not None, "there is no road"
    road.take(force, height)

    def attempt(friction_so_far: float) -> SolveOutcome:
        road.friction = friction_so_far
        return problem.solve(problem.road_height or height, load)

    def drag(trial: float) -> float:
        sliding.radius = trial
        _checked(rubbing, problem.solve(problem.road_height, load))
        return rubbing.body.comm.allreduce(road.forward())

    _march(rubbing, attempt, friction.coefficient, Show("static.friction", 1.0, ""))
    if friction.radius is None:
        sliding.radius = _free(drag, radius, rubbing.load())
    if any(friction.slip):

        def slide(part: float) -> SolveOutcome:
            sliding.slip = part * friction.slip[0], part * friction.slip[1]
            return problem.solve(problem.road_height, load)

        size = float(np.hypot(*friction.slip))
        _march(rubbing, slide, 1.0, Show("slip with friction", size, ""))
    return rubbing


def _march(
    rubbing: LoadStepper, attempt: Callable[[float], SolveOutcome], end: float, show: Show
) -> None:
    """From zero to `end` at once, or in as many steps as needed. Collective."""
    try:
        rubbing.march(attempt, end, end, show)
    except LoadingStopped as error:
        raise ConvergenceError(f"{error}. {_ADVICE}") from None


def _free(drag: Callable[[float], float], radius: float, load: float) -> float:
    """Travel per radian (m) at which `drag` (N) vanishes."""
    near = radius * (1 - _NEAR)
    root = root_scalar(
        drag, method="secant", x0=radius, x1=near, xtol=_CLOSE * radius, maxiter=_MOST
    )
    left = drag(root.root)
    if not (root.converged and abs(left) < 1e-4 * load):
        raise ConvergenceError(
            f"static: no free rolling with friction: at a travel of {root.root:.6g} m per radian {left:.3g} N of drag remain. "
            "Give rotation.rolling_radius (m), or a smaller static.friction"
        )
    return float(root.root)


def _checked(rubbing: LoadStepper, step: SolveOutcome) -> None:
    rubbing.newton_steps += step.iterations
    if not step.converged:
        raise ConvergenceError(
            f"static: no equilibrium with friction was found ({step.reason}). {_ADVICE}"
        )
    rubbing.tell("deflection with friction", rubbing.deflection, "m", step)
