"""Load steps to a state: step control, and secants for a load."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError, LoadingStopped
from tireroad.fem.parallel import on_root
from tireroad.fem.static.equilibrium import Equilibrium, SolveOutcome
from tireroad.fem.static.footprint import TreadSurface
from tireroad.fem.static.restart import pseudo_transient
from tireroad.fem.static.symmetric import (
    AxisymmetricEquilibrium,
    HalfModelEquilibrium,
    looks_the_same,
)
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body

_SMALLEST = 1e-4  # of the first step: smaller load steps are abandoned
# Of a rolling tire: one that needs smaller steps is at its critical speed. At 160 rad/s a radial
# tire (critical at 157) was given up after ten minutes.
_SMALLEST_ROLLING = 2e-2
_LARGEST = 4  # times the first step
_STUCK = 3  # consecutive failures after which a fall is tried, once
_EASY = 6  # tangents up to which the next load step may grow
Attempt = Callable[[float], SolveOutcome]
LOAD_TOLERANCE = 1e-9  # of the requested load; a tenth of the tolerance of other comparisons
_REACH = 2.2  # times the largest deflection so far: limit of the next trial
_NEAR = 0.1  # of a requested load: residual allowed in intermediate states
_CLOSED, _JUMP = 1e-6, 0.01  # of a deflection: bracket, across which that part of a load is a jump


@dataclass(frozen=True)
class Show:
    """The quantity that is stepped, for display: its name, and its value `scale` at 1 in `unit`."""

    what: str
    scale: float
    unit: str


def march(
    attempt: Attempt,
    end: float,
    first: float,
    show: Show,
    start: float = 0.0,
    rescue: Attempt | None = None,
    enough: Callable[[], bool] = lambda: False,
    seen: Callable[[SolveOutcome, float, Show], None] = lambda step, target, show: None,
    smallest: float = _SMALLEST,
) -> None:
    """From a converged `start` to `end` in steps, the first of size `first`. Collective.

    If steps keep failing, `rescue` searches for a state not near the last one. Ends before `end`
    after a converged step that is `enough`. `seen` is told of each step. Raises LoadingStopped if
    steps of the share `smallest` of the first do not converge either.
    """
    done, size, failures = start, first, 0
    while True:
        left = end - done
        target = end if abs(left) <= size * (1 + 1e-12) else done + math.copysign(size, left)
        step = attempt(target)
        seen(step, target, show)
        failures = 0 if step.converged else failures + 1
        if rescue is not None and failures == _STUCK:
            step = rescue(target)
            seen(step, target, show)
        if step.converged:
            done, failures = target, 0
            if done == end or enough():
                return
            size = min(_LARGEST * first, 2 * size) if step.iterations <= _EASY else size
            continue
        size = 0.5 * min(size, abs(target - done))
        if size < smallest * first:
            scale, unit = show.scale, show.unit
            raise LoadingStopped(
                f"static: {show.what} stops at {done * scale:.6g} {unit} of {end * scale:.6g} {unit}; "
                f"a further step of {size * scale:.2g} {unit} does not converge ({step.reason})"
            )


@dataclass(frozen=True)
class _Known:
    """A converged state on the way to a load."""

    deflection: float
    load: float
    displacement: np.ndarray


class LoadPath:
    """Path of a loader's body from a state without a road. All methods are collective."""

    def __init__(self, loader: LoadStepper) -> None:
        self._loader, self._equilibrium, self._body = loader, loader.equilibrium, loader.body
        self._known = [_Known(0.0, 0.0, self._body.u.x.array.copy())]

    def step_to(self, deflection: float) -> None:
        """Raise the road in steps to `deflection` (m) from first touch."""
        self._body.u.x.array[:] = self._known[0].displacement
        self._raise_road(0.0, deflection, 0.0)

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N) by bracketed secants; the deflection (m).

        Intermediate states may have a residual; the state that an error leaves has none.
        """
        try:
            return self._find_load(load, _NEAR * load)
        except ConvergenceError:
            if self._equilibrium.solve(self._equilibrium.road_height).converged:
                raise
            return self._find_load(load, 0.0)

    def _find_load(self, load: float, allowed: float) -> float:
        """Deflection (m) for `load`; intermediate states may have `allowed` (N) of residual."""
        self._known = self._known[:1]
        self._body.u.x.array[:] = self._known[0].displacement
        trial = 0.4 * self._body.ring.thickness
        for _ in range(60):
            self.to(trial, allowed, load)
            last, rounding = self._known[-1], self._equilibrium.rounding
            if not allowed and abs(last.load - load) <= max(LOAD_TOLERANCE * load, rounding):
                return last.deflection
            trial = self._next_deflection(load)
            if trial < 0.99 * _REACH * max(k.deflection for k in self._known):
                if self._solve_for_load(load, trial):
                    return self._loader.deflection
                if allowed:  # from here on the bracket must close
                    self._known, allowed = self._known[:1], 0.0
        raise self._not_met(load, "in 60 trials")

    def _solve_for_load(self, load: float, trial: float) -> bool:
        """Solve for state and road height at the given load, from the estimate at `trial`."""
        self._near(trial)
        step = self._equilibrium.solve(self._loader.touch + trial, load)
        self._loader.newton_steps += step.iterations
        if step.converged:
            self._loader.tell("deflection", self._loader.deflection, "m", step)
        return step.converged

    def _near(self, trial: float) -> bool:
        """Estimate the state at a deflection, by the last tangent or known states; success."""
        return self._equilibrium.predict(self._loader.touch + trial) or self._guess(trial)

    def _guess(self, trial: float) -> bool:
        """Extrapolate from the two known states nearest to a deflection; False without two."""
        near, *others = sorted(self._known, key=lambda k: abs(k.deflection - trial))
        apart = [k for k in others if k.deflection != near.deflection]  # `visit` may repeat one
        if not apart:
            return False
        reach = (trial - near.deflection) / (near.deflection - apart[0].deflection)
        change = near.displacement - apart[0].displacement
        self._body.u.x.array[:] = near.displacement + reach * change
        return True

    def to(self, trial: float, allowed: float = 0.0, load: float = np.inf) -> None:
        """Solve at the trial deflection from the estimate, otherwise in steps, which end early at
        a state with more than `load` (N).

        Converged states, with up to `allowed` (N) of residual, are recorded as known.
        """
        if self._near(trial):
            step = self._equilibrium.solve(self._loader.touch + trial, allowed=allowed)
            self._loader.newton_steps += step.iterations
            if self._learnt(step, trial).converged:
                self._loader.tell("deflection", trial, "m", step)
                return
        below = max((k for k in self._known if k.deflection <= trial), key=lambda k: k.deflection)
        self._body.u.x.array[:] = below.displacement
        self._raise_road(below.deflection, trial, allowed, load)

    def _next_deflection(self, load: float) -> float:
        """Next trial: secant through the two loads nearest to the requested one, kept inside the
        bracket."""
        below, above = self._bracket(load)
        far, near = sorted(self._known, key=lambda k: -abs(k.load - load))[-2:]
        rise, run = near.load - far.load, near.deflection - far.deflection
        slope = rise / run if run else 0.0
        secant = near.deflection + (load - near.load) / slope if slope > 0 else np.inf
        if above:
            low, high = below.deflection, above.deflection
            return secant if low < secant < high else (low + high) / 2
        farthest = self._loader.farthest
        if below.deflection >= farthest:
            raise ConvergenceError(
                f"static: the tire carries {below.load:.4g} N at {below.deflection:.4g} m of deflection, where the "
                f"road reaches the rim; {load:g} N is out of reach{self._fall(load)}. Lower static.load, raise "
                "static.inflation, or give static.deflection instead."
            )
        # Beyond the deflections tried the curve is unknown.
        least, most = np.minimum(np.array([1.01, _REACH]) * below.deflection, farthest)
        return float(np.clip(secant, least, most))

    def _bracket(self, load: float) -> tuple[_Known, _Known | None]:
        """The states around the first crossing: behind a snap, the load may fall below the requested
        one again."""
        deep = sorted(self._known, key=lambda k: k.deflection)
        first = next((place for place, k in enumerate(deep) if k.load > load), None)
        if first is None:
            return deep[-1], None
        below, above = deep[first - 1], deep[first]
        width, jump = above.deflection - below.deflection, above.load - below.load
        if width <= _CLOSED * above.deflection and jump > _JUMP * load:
            raise self._not_met(load, f"at {above.deflection:.6g} m of deflection, where it jumps")
        return below, above

    def _not_met(self, load: float, where: str) -> ConvergenceError:
        nearest = min(self._known, key=lambda k: abs(k.load - load))
        return ConvergenceError(
            f"static: the load of {load:g} N was not met {where}; nearest is {nearest.load:g} N"
            f"{self._fall(load)}. Give static.deflection instead, or refine the mesh."
        )

    def _fall(self, load: float) -> str:
        """Where the load falls most from a known state to the next deeper one, for a message.

        Nothing for a fall that the residual of intermediate states may feign.
        """
        path = sorted(self._known, key=lambda k: k.deflection)
        one, next_ = max(
            zip(path, path[1:], strict=False), key=lambda two: two[0].load - two[1].load
        )
        if one.load - next_.load <= _NEAR * load:
            return ""
        return (
            f"; the load falls with deflection (snap-through), from {one.load:.4g} N at {one.deflection:.4g} m "
            f"to {next_.load:.4g} N at {next_.deflection:.4g} m"
        )

    def _learnt(self, step: SolveOutcome, deflection: float) -> SolveOutcome:
        """The step itself; if it converged, its state is recorded as known. Collective."""
        if step.converged:
            load, field = self._loader.load(), self._body.u.x.array
            self._known.append(_Known(deflection, load, field.copy()))
        return step

    def _raise_road(self, start: float, end: float, allowed: float, load: float = np.inf) -> None:
        """Raise the road in steps, until it carries more than `load` (N), and record each state.

        Steps beyond that load would lead through a snap, to states of no use.
        """

        field, road = self._body.u.x, self._equilibrium.road

        def attempt(deflection: float) -> SolveOutcome:
            height = self._loader.touch + deflection
            before = field.array.copy(), road.snapshot()
            self._equilibrium.predict(height)
            step = self._equilibrium.solve(height, allowed=allowed)
            if not step.converged:  # restore the state before the prediction
                field.array[:] = before[0]
                road.restore(before[1])
            return self._learnt(step, deflection)

        def let_go(deflection: float) -> SolveOutcome:
            height = self._loader.touch + deflection
            return self._learnt(pseudo_transient(self._equilibrium, height, allowed), deflection)

        largest = 0.25 * self._body.ring.thickness
        show = Show("deflection", 1.0, "m")
        # A rolling tire has no such fall: beyond its critical speed each state would be one of a
        # standing wave of its own, found in minutes and of no use.
        falls = None if self._equilibrium.rolling.speed else let_go
        self._loader.march(attempt, end, largest, show, start, falls, lambda: self._above(load))

    def _above(self, load: float) -> bool:
        return self._known[-1].load > load


@dataclass(frozen=True)
class Progress:
    """A completed load step; load (N) and a deflection (m) are along the road's normal."""

    what: str
    value: float
    unit: str
    load: float
    active: int
    step: SolveOutcome


@dataclass(frozen=True)
class _Half:
    """Half of the ring of a loader's body."""

    loader: LoadStepper
    equilibrium: HalfModelEquilibrium


class LoadStepper:
    """Brings one problem to the requested state. Collective. `inflated`: `u` without the road."""

    def __init__(self, equilibrium: Equilibrium, report: Callable[[Progress], None]) -> None:
        self.equilibrium = equilibrium
        self.body = equilibrium.body
        self.report = report
        self.newton_steps, self.inflated = 0, self.body.u.x.array.copy()
        self._touch: float | None = None
        self._half_ring: _Half | None = None

    def inflate(self, pressure: float, near: np.ndarray | None = None) -> None:
        """Inflate to `pressure` (Pa) without a road, then let it roll at its speed.

        From a `u` that is `near`, else from 0: with cords from the axisymmetric shape of one
        section; in steps if that is not close enough.
        """
        self.body.u.x.array[:] = 0.0 if near is None else near
        if near is not None:
            begun = self._begin(pressure)
        else:
            begun = bool(self.body.plies.cords) and self._start_round(pressure)
        if not begun:
            self._inflate_in_steps(pressure)
        self.inflated, self._touch = self.body.u.x.array.copy(), self.lowest()

    def _start_round(self, pressure: float) -> bool:
        """Solve from the axisymmetric shape; on failure False and the old state. Collective."""

        def shape() -> np.ndarray:
            section = AxisymmetricEquilibrium(self.body, self.equilibrium.rolling)
            LoadStepper(section, self.report)._inflate_in_steps(pressure)
            return section.on(self.body.lattice)

        before = self.body.u.x.array.copy()
        self.body.set_displacement(on_root(self.body.comm, shape))
        half = self._half()
        if half is not None:  # elements of unequal length are axisymmetric only approximately
            half.loader.newton_steps += half.loader._solve_at(
                half.equilibrium.pressure, pressure
            ).iterations
            self._count(half)
            self.body.set_displacement(half.equilibrium.on(self.body.lattice)[0])
        begun = self._begin(pressure)
        if not begun:
            self.body.u.x.array[:] = before
        return begun

    def _begin(self, pressure: float) -> bool:
        """Whether the present shape leads to that at the pressure in one solution. Collective."""
        step = self._solve_at(self.equilibrium.pressure, pressure)
        self.newton_steps += step.iterations
        if step.converged:
            self.tell("inflation", pressure, "Pa", step)
        return step.converged

    def begin_at(self, other: LoadStepper) -> None:
        """Take over another loader's height of first touch and its step count."""
        self._touch, self.newton_steps = other.touch, other.newton_steps

    def _inflate_in_steps(self, pressure: float) -> None:
        """To the pressure at rest, then to the speed: cords without tension give way under centrifugal
        forces. The radial tire's section turning at 71.9 rad/s stopped at 13 Pa."""
        problem = self.equilibrium
        if problem.rolling.speed:
            problem.rolls.value = 0.0
        inflated = partial(self._solve_at, problem.pressure, pressure)
        self.march(inflated, 1.0, 1.0, Show("inflation", pressure, "Pa"))
        if problem.rolling.speed:
            show = Show("speed", problem.rolling.speed, "rad/s")
            self.march(lambda part: self._solve_at(problem.rolls, 1.0, part**2), 1.0, 1.0, show)

    def _solve_at(self, constant: fem.Constant, whole: float, part: float = 1.0) -> SolveOutcome:
        """Solve with a constant of the problem at a `part` of its `whole` value; it stays there if
        that converges."""
        before = float(constant.value)
        constant.value = part * whole
        step = self.equilibrium.solve()
        if not step.converged:
            constant.value = before  # as the displacement is restored
        return step

    @property
    def touch(self) -> float:
        """Height of a road that just touches the inflated tire, m."""
        assert self._touch is not None, "inflate() comes before the road"
        return self._touch

    @property
    def deflection(self) -> float:
        """Rise of the road from first touch, m."""
        assert self.equilibrium.road_height is not None, "there is no road"
        return self.equilibrium.road_height - self.touch

    def lowest(self) -> float:
        """Height of the lowest point of the outer face over the road's shape, m. Collective."""
        lattice = self.body.lattice
        moved = self.body.surface(self.body.owned(self.body.u.x.array))
        places = lattice.points(lattice.face) + moved
        places[:, 2] -= self.equilibrium.shape.height(*places[:, :2].T)
        return TreadSurface(lattice, places).lowest()

    @property
    def farthest(self) -> float:
        """Deflection at which the road reaches the outer face's edge on the rim, m. Collective."""
        places = self.body.space.tabulate_dof_coordinates()[self.body.beads]
        height = places[:, 2] - self.equilibrium.shape.height(*places[:, :2].T)
        lowest = self.body.comm.allreduce(float(height.min(initial=np.inf)), op=MPI.MIN)
        return lowest - self.touch

    def _check_reach(self, deflection: float) -> None:
        if deflection > self.farthest:
            raise ConvergenceError(
                f"static: {deflection:.4g} m of deflection are out of reach: at {self.farthest:.4g} m the road is at "
                "the rim"
            )

    def deflect(self, deflection: float) -> None:
        """Raise the road by `deflection` (m) from first touch of the inflated tire."""
        self._check_reach(deflection)
        if not self._by_half(lambda half: LoadPath(half).step_to(deflection)):
            LoadPath(self).step_to(deflection)

    def visit(self, deflections: Sequence[float]) -> Iterator[float]:
        """Raise the road to ascending deflections (m), extrapolating from the last two states."""
        half, own = self._half(), LoadPath(self)
        way = None if half is None else LoadPath(half.loader)
        for deflection in deflections:
            self._check_reach(deflection)
            if half is None or way is None:
                own.to(deflection)
            else:
                way.to(deflection)
                if not self._taken_over(half):
                    half = None
                    own.to(deflection)
            yield deflection

    def _half(self) -> _Half | None:
        """Half ring in the present state; None if a half turn changes tire or loads. Collective."""
        rolling = self.equilibrium.rolling
        if not (self.equilibrium.shape.flat and looks_the_same(self.body.ring, rolling)):
            return None
        if self._half_ring is None:
            equilibrium = HalfModelEquilibrium(self.body, rolling)
            equilibrium.history = self.equilibrium.history
            self._half_ring = _Half(LoadStepper(equilibrium, self.report), equilibrium)
        self._half_ring.equilibrium.start(self.equilibrium)
        self._half_ring.loader._touch = self._touch
        return self._half_ring

    @property
    def halved(self) -> HalfModelEquilibrium | None:
        """The half-ring problem, if one was used; its state may differ from that of the whole."""
        return None if self._half_ring is None else self._half_ring.equilibrium

    def _taken_over(self, half: _Half) -> bool:
        """Transfer the half ring's state; whether it is in equilibrium on the whole. Collective."""
        self._count(half)
        other = half.equilibrium
        return self.equilibrium.resume(*other.on(self.body.lattice), other.road_height).converged

    def _count(self, half: _Half) -> None:
        """Add the tangents and seconds of the half ring to the totals."""
        self.newton_steps += half.loader.newton_steps
        half.loader.newton_steps = 0
        self.equilibrium.cost.take(half.equilibrium.cost)

    def _by_half(self, press: Callable[[LoadStepper], object]) -> bool:
        """Press half of the ring if symmetry allows; whether that solved the whole. Collective.
        After an error the whole is left in the half's last state."""
        half, start = self._half(), self.body.u.x.array.copy()
        if half is None:
            return False
        try:
            press(half.loader)
        except ConvergenceError:
            self._taken_over(half)
            raise
        half_way = self._taken_over(half)
        if not half_way:
            self.body.u.x.array[:] = start
        return half_way

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N) by bracketed secants; the deflection (m).

        Intermediate states may have a residual; the state that an error leaves has none."""
        if load <= 0:
            raise InputError(f"static.load = {load:g} N: a road carries a positive load")
        if not self._by_half(lambda half: LoadPath(half).carry(load)):
            LoadPath(self).carry(load)
        return self.deflection

    def load(self) -> float:
        """Total vertical force of the road, N. Collective."""
        return self.equilibrium.load()

    @property
    def march(self) -> Callable[..., None]:
        """`march` that counts all steps and reports the converged ones."""
        smallest = _SMALLEST_ROLLING if self.equilibrium.rolling.speed else _SMALLEST
        return partial(march, seen=self._seen, smallest=smallest)

    def _seen(self, step: SolveOutcome, target: float, show: Show) -> None:
        self.newton_steps += step.iterations
        if step.converged:
            self.tell(show.what, target * show.scale, show.unit, step)

    def tell(self, what: str, value: float, unit: str, step: SolveOutcome) -> None:
        upright = self.equilibrium.shape.upright  # told along the road's normal, as in the results
        value *= upright if unit == "m" else 1.0
        loads = self.equilibrium.load() / upright, self.equilibrium.points()
        self.report(Progress(what, value, unit, *loads, step))


def with_cause(
    error: ConvergenceError,
    loader: LoadStepper,
    rolling: Rolling,
    press: Callable[[LoadStepper], object],
) -> ConvergenceError:
    """The error, with the cause added if that is the speed of rotation. Collective.

    `press` inflates and loads a tire. It is repeated at rest on a separate body; if that converges,
    the speed is the cause. Takes no longer than the state at rest.
    """
    if rolling.speed == 0 or not isinstance(error, LoadingStopped):
        return error
    old = loader.body
    body = Body(old.comm, old.ring, old.materials, cords=old.plies.cords)
    try:
        press(LoadStepper(Equilibrium(body, AT_REST), lambda progress: None))
    except ConvergenceError:
        return error
    return ConvergenceError(
        f"static: no steady rolling shape at rotation.speed = {rolling.speed:g} rad/s: it is probably "
        f"above the critical speed, since the tire at rest converges ({error.fact.removeprefix('static: ')}). "
        "The rolling shape has the moduli at rest and no losses, which carry a real tire further. Lower the speed, raise the inflation or stiffen the material; static.steady_rolling = false takes the "
        "shape at rest, whose rotating stage reports the critical speed."
    )
