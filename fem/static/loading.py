"""Load steps to a wanted state: inflation, then the road by height, deflection or load."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.parallel import on_root
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.round import RoundEquilibrium
from tireroad.fem.static.stepping import Attempt, Show, Step, march
from tireroad.fem.static.tread_surface import TreadSurface

LOAD_TOLERANCE = 1e-9  # of the wanted load; a tenth of what other quantities are compared to
_REACH = 1.9  # times the largest deflection so far: a load is sought no further away
_NEAR = 0.1  # of a wanted load: what may be out of balance on the way to it (12 tangents in place of 21)


@dataclass(frozen=True)
class Progress:
    """One load step done: what was stepped to, and the road's total force (N) on how many points."""

    what: str
    value: float
    unit: str
    load: float
    active: int
    step: Step


@dataclass(frozen=True)
class _Known:
    """A converged state on the way to a load."""

    deflection: float
    load: float
    displacement: np.ndarray


class Loader:
    """Brings the body of one equilibrium to the wanted state, all along the wheel's z. All methods are collective."""

    def __init__(self, equilibrium: Equilibrium, report: Callable[[Progress], None]) -> None:
        self.equilibrium, self.body, self.report = equilibrium, equilibrium.body, report
        self.newton_steps = 0
        self._touch: float | None = None

    def inflate(self, pressure: float) -> None:
        """Inflation from 0 to `pressure` (Pa), without a road; also the steady-rolling loads alone.

        By the round shape of one section, where that is near enough for Newton; else in steps.
        """
        if not (self.body.plies.cords and self._start_round(pressure)):
            self._inflate_in_steps(pressure)
        self._touch = self.lowest()

    def _start_round(self, pressure: float) -> bool:
        """Whether equilibrium is found from the round shape. Collective."""

        def shape() -> np.ndarray:
            section = RoundEquilibrium(self.body, self.equilibrium.rolling)
            Loader(section, self.report)._inflate_in_steps(pressure)
            return section.on(self.body.lattice)

        before = self.body.u.x.array.copy()
        self.body.set_displacement(on_root(self.body.comm, shape))
        step = self._solve_at(pressure)
        self.newton_steps += step.iterations
        if step.converged:
            self._report("inflation", pressure, "Pa", step)
        else:
            self.body.u.x.array[:] = before
        return step.converged

    def _inflate_in_steps(self, pressure: float) -> None:
        self._march(
            lambda part: self._solve_at(part * pressure),
            1.0,
            1.0,
            Show("inflation", pressure, "Pa"),
        )

    def _solve_at(self, pressure: float) -> Step:
        before = float(self.equilibrium.pressure.value)
        self.equilibrium.pressure.value = pressure
        step = self.equilibrium.solve()
        if not step.converged:
            self.equilibrium.pressure.value = before  # as the displacement is put back
        return step

    @property
    def touch(self) -> float:
        """Height of a road that just touches the inflated tire, m."""
        assert self._touch is not None, "inflate() comes before the road"
        return self._touch

    @property
    def deflection(self) -> float:
        """How far the road has been raised from first touch, m."""
        assert self.equilibrium.road_height is not None, "there is no road"
        return self.equilibrium.road_height - self.touch

    def lowest(self) -> float:
        """Height of the lowest point of the outer face over the road's shape, m. Collective."""
        lattice = self.body.lattice
        moved = self.body.surface(self.body.owned(self.body.u.x.array))
        places = lattice.points(lattice.face) + moved
        places[:, 2] -= self.equilibrium.road.height(*places[:, :2].T)
        return TreadSurface(lattice, places).lowest()

    def deflect(self, deflection: float) -> None:
        """Raise the road by `deflection` (m) from first touch of the inflated tire."""
        self._raise_road(0.0, deflection, [])

    def visit(self, deflections: Sequence[float]) -> Iterator[float]:
        """Raise the road to ascending deflections (m) in turn, from a line through the last two states."""
        known = [_Known(0.0, 0.0, self.body.u.x.array.copy())]
        for deflection in deflections:
            self._try_deflection(deflection, known)
            yield deflection

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N); the deflection (m). Secant within a bracket.

        States on the way may be out of balance; the one that an error leaves is not.
        """
        if load <= 0:
            raise InputError(f"static.load = {load:g} N: a road carries a positive load")
        start = self.body.u.x.array.copy()
        try:
            return self._seek(load, _NEAR * load)
        except ConvergenceError:
            if self.equilibrium.solve(self.equilibrium.road_height).converged:
                raise
            self.body.u.x.array[:] = start
            return self._seek(load, 0.0)

    def _seek(self, load: float, allowed: float) -> float:
        """That deflection, with states on the way `allowed` (N) out of balance."""
        known = [_Known(0.0, 0.0, self.body.u.x.array.copy())]
        trial = 0.1 * self.body.ring.thickness
        for _ in range(60):
            self._try_deflection(trial, known, allowed)
            rounding = self.equilibrium.rounding
            if not allowed and abs(known[-1].load - load) <= max(LOAD_TOLERANCE * load, rounding):
                return trial
            trial = self._next_deflection(known, load)
            if trial < _REACH * max(k.deflection for k in known):
                if self._meet(load, trial, known):
                    return self.deflection
                if allowed:  # from here on a bracket has to close
                    known, allowed = known[:1], 0.0
        nearest = min(known, key=lambda k: abs(k.load - load))
        raise ConvergenceError(
            f"static: the load of {load:g} N was not met in 60 trials; nearest is {nearest.load:g} N. "
            "Give static.deflection instead, or refine the mesh."
        )

    def _meet(self, load: float, trial: float, known: list[_Known]) -> bool:
        """Solve for the load and the road's height at once, from the state guessed at a deflection."""
        self._guess(trial, known)
        step = self.equilibrium.solve(self.touch + trial, load)
        self.newton_steps += step.iterations
        if step.converged:
            self._report("deflection", self.deflection, "m", step)
        return step.converged

    def _guess(self, trial: float, known: list[_Known]) -> bool:
        """Put the body on a line through the two states nearest to a deflection, if there are two."""
        near = sorted(known, key=lambda k: abs(k.deflection - trial))[:2]
        if len(near) < 2:
            return False
        reach = (trial - near[0].deflection) / (near[0].deflection - near[1].deflection)
        change = near[0].displacement - near[1].displacement
        self.body.u.x.array[:] = near[0].displacement + reach * change
        return True

    def _try_deflection(self, trial: float, known: list[_Known], allowed: float = 0.0) -> None:
        """Solve at the trial deflection from a line through the two nearest states, else by steps.

        What converges on the way is known from then on, `allowed` (N) out of balance.
        """
        if self._guess(trial, known):
            step = self.equilibrium.solve(self.touch + trial, allowed=allowed)
            self.newton_steps += step.iterations
            if step.converged:
                self._report("deflection", trial, "m", step)
                known.append(_Known(trial, self.load(), self.body.u.x.array.copy()))
                return
        below = max((k for k in known if k.deflection <= trial), key=lambda k: k.deflection)
        self.body.u.x.array[:] = below.displacement
        self._raise_road(below.deflection, trial, known, allowed)

    def _next_deflection(self, known: list[_Known], load: float) -> float:
        """Secant through the two loads nearest to the wanted one, kept inside the bracket."""
        below = max((k for k in known if k.load <= load), key=lambda k: k.deflection)
        above = [k.deflection for k in known if k.load > load]
        far, near = sorted(known, key=lambda k: -abs(k.load - load))[-2:]
        rise, run = near.load - far.load, near.deflection - far.deflection
        slope = rise / run if run else 0.0
        secant = near.deflection + (load - near.load) / slope if slope > 0 else np.inf
        if above:
            low, high = below.deflection, min(above)
            return secant if low < secant < high else (low + high) / 2
        if below.deflection > self.body.ring.height:
            raise ConvergenceError(
                f"static: the tire carries {below.load:.4g} N at {below.deflection:.4g} m of "
                f"deflection, beyond its section; {load:g} N is out of reach. Lower static.load or "
                "raise static.inflation."
            )
        # Beyond what was tried the curve is not known: at most double the deflection.
        return float(np.clip(secant, 1.01 * below.deflection, 2 * below.deflection))

    def load(self) -> float:
        """Total vertical force of the road, N. Collective."""
        return self.body.comm.allreduce(self.equilibrium.contact_force().sum())

    def _raise_road(
        self, start: float, end: float, known: list[_Known], allowed: float = 0.0
    ) -> None:
        """In steps, each of which is entered in `known`."""

        def attempt(deflection: float) -> Step:
            step = self.equilibrium.solve(self.touch + deflection, allowed=allowed)
            if step.converged:
                known.append(_Known(deflection, self.load(), self.body.u.x.array.copy()))
            return step

        largest = 0.25 * self.body.ring.thickness
        self._march(attempt, end, largest, Show("deflection", 1.0, "m"), start)

    def _march(
        self, attempt: Attempt, end: float, first: float, show: Show, start: float = 0.0
    ) -> None:
        def tried(target: float) -> Step:
            step = attempt(target)
            self.newton_steps += step.iterations
            if step.converged:
                self._report(show.what, target * show.scale, show.unit, step)
            return step

        march(tried, start, end, first, show)

    def _report(self, what: str, value: float, unit: str, step: Step) -> None:
        touching = int((self.equilibrium.contact_force() > 0).sum())
        active = self.body.comm.allreduce(touching)
        self.report(Progress(what, value, unit, self.load(), active, step))
