"""Load steps to a requested state: inflation, then the road by height, deflection or load."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.parallel import on_root
from tireroad.fem.static.equilibrium import Equilibrium, Step
from tireroad.fem.static.path.stepping import Attempt, Show, march
from tireroad.fem.static.path.way import Way
from tireroad.fem.static.symmetry.half_turn import HalfTurnEquilibrium, looks_the_same
from tireroad.fem.static.symmetry.round import RoundEquilibrium, inflated
from tireroad.fem.static.tread_surface import TreadSurface


@dataclass(frozen=True)
class Progress:
    """A completed load step; load (N) and a deflection (m) are along the road's normal."""

    what: str
    value: float
    unit: str
    load: float
    active: int
    step: Step


@dataclass(frozen=True)
class _Half:
    """Half of the ring of a loader's body."""

    loader: Loader
    equilibrium: HalfTurnEquilibrium


class Loader:
    """Brings one problem to the requested state. Collective. `inflated`: `u` without the road."""

    def __init__(self, equilibrium: Equilibrium, report: Callable[[Progress], None]) -> None:
        self.equilibrium = equilibrium
        self.body = equilibrium.body
        self.report = report
        self.newton_steps, self.inflated = 0, self.body.u.x.array.copy()
        self._touch: float | None = None
        self._half_ring: _Half | None = None

    def inflate(self, pressure: float, near: np.ndarray | None = None) -> None:
        """Inflate to `pressure` (Pa) without a road, with the steady-rolling loads.

        From a `u` that is `near`, else from 0: with cords from the axisymmetric shape of one
        section if close enough, otherwise in steps.
        """
        if near is not None:
            self.body.u.x.array[:] = near
        if near is not None or not (self.body.plies.cords and self._start_round(pressure)):
            self._inflate_in_steps(pressure)
        self.inflated, self._touch = self.body.u.x.array.copy(), self.lowest()

    def _start_round(self, pressure: float) -> bool:
        """Solve from the axisymmetric shape; on failure False and the old state. Collective."""

        def inflate(section: RoundEquilibrium) -> None:
            Loader(section, self.report)._inflate_in_steps(pressure)

        def shape() -> np.ndarray:
            return inflated(self.body, self.equilibrium.rolling, inflate).on(self.body.lattice)

        before = self.body.u.x.array.copy()
        self.body.set_displacement(on_root(self.body.comm, shape))
        half = self._half()
        if half is not None:  # elements of unequal length are axisymmetric only approximately
            half.loader.newton_steps += half.loader._solve_at(pressure).iterations
            self._count(half)
            self.body.set_displacement(half.equilibrium.on(self.body.lattice)[0])
        step = self._solve_at(pressure)
        self.newton_steps += step.iterations
        if step.converged:
            self.tell("inflation", pressure, "Pa", step)
        else:
            self.body.u.x.array[:] = before
        return step.converged

    def begin_at(self, other: Loader) -> None:
        """Take over another loader's height of first touch and its step count."""
        self._touch, self.newton_steps = other.touch, other.newton_steps

    def _inflate_in_steps(self, pressure: float) -> None:
        show = Show("inflation", pressure, "Pa")
        self.march(lambda part: self._solve_at(part * pressure), 1.0, 1.0, show)

    def _solve_at(self, pressure: float) -> Step:
        before = float(self.equilibrium.pressure.value)
        self.equilibrium.pressure.value = pressure
        step = self.equilibrium.solve()
        if not step.converged:
            self.equilibrium.pressure.value = before  # as the displacement is restored
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
        if not self._by_half(lambda half: Way(half).climb(deflection)):
            Way(self).climb(deflection)

    def visit(self, deflections: Sequence[float]) -> Iterator[float]:
        """Raise the road to ascending deflections (m), extrapolating from the last two states."""
        half, own = self._half(), Way(self)
        way = None if half is None else Way(half.loader)
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
            equilibrium = HalfTurnEquilibrium(self.body, rolling)
            equilibrium.history = self.equilibrium.history
            self._half_ring = _Half(Loader(equilibrium, self.report), equilibrium)
        self._half_ring.equilibrium.start(self.equilibrium)
        self._half_ring.loader._touch = self._touch
        return self._half_ring

    @property
    def halved(self) -> HalfTurnEquilibrium | None:
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

    def _by_half(self, press: Callable[[Loader], object]) -> bool:
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
        found = self._taken_over(half)
        if not found:
            self.body.u.x.array[:] = start
        return found

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N) by bracketed secants; the deflection (m).

        Intermediate states may have a residual; the state that an error leaves has none."""
        if load <= 0:
            raise InputError(f"static.load = {load:g} N: a road carries a positive load")
        if not self._by_half(lambda half: Way(half).carry(load)):
            Way(self).carry(load)
        return self.deflection

    def load(self) -> float:
        """Total vertical force of the road, N. Collective."""
        return self.equilibrium.load()

    def march(
        self,
        attempt: Attempt,
        end: float,
        first: float,
        show: Show,
        start: float = 0.0,
        fall: Attempt | None = None,
        enough: Callable[[], bool] = lambda: False,
    ) -> None:
        """`path.stepping.march` that counts all steps and reports the converged ones."""

        def seen(attempt: Attempt) -> Attempt:
            def tried(target: float) -> Step:
                step = attempt(target)
                self.newton_steps += step.iterations
                if step.converged:
                    self.tell(show.what, target * show.scale, show.unit, step)
                return step

            return tried

        march(seen(attempt), start, end, first, show, fall and seen(fall), enough)

    def tell(self, what: str, value: float, unit: str, step: Step) -> None:
        upright = self.equilibrium.shape.upright  # told along the road's normal, as in the results
        value *= upright if unit == "m" else 1.0
        loads = self.equilibrium.load() / upright, self.equilibrium.points()
        self.report(Progress(what, value, unit, *loads, step))
