"""Path to a load or a deflection: known states and the choice of the next trial."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.path.snap import fall
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.path.stepping import Show

if TYPE_CHECKING:
    from tireroad.fem.static.path.loading import Loader

LOAD_TOLERANCE = 1e-9  # of the requested load; a tenth of the tolerance of other comparisons
_REACH = 2.2  # times the largest deflection so far: limit of the next trial
_NEAR = 0.1  # of a requested load: residual allowed in intermediate states
_CLOSED, _JUMP = 1e-6, 0.01  # of a deflection: bracket, across which that part of a load is a jump


@dataclass(frozen=True)
class _Known:
    """A converged state on the way to a load."""

    deflection: float
    load: float
    displacement: np.ndarray


class Way:
    """Path of a loader's body from a state without a road. All methods are collective."""

    def __init__(self, loader: Loader) -> None:
        self._loader, self._equilibrium, self._body = loader, loader.equilibrium, loader.body
        self._known = [_Known(0.0, 0.0, self._body.u.x.array.copy())]

    def climb(self, deflection: float) -> None:
        """Raise the road in steps to `deflection` (m) from first touch."""
        self._body.u.x.array[:] = self._known[0].displacement
        self._raise_road(0.0, deflection, 0.0)

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N) by bracketed secants; the deflection (m).

        Intermediate states may have a residual; the state that an error leaves has none.
        """
        try:
            return self._seek(load, _NEAR * load)
        except ConvergenceError:
            if self._equilibrium.solve(self._equilibrium.road_height).converged:
                raise
            return self._seek(load, 0.0)

    def _seek(self, load: float, allowed: float) -> float:
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
                if self._meet(load, trial):
                    return self._loader.deflection
                if allowed:  # from here on the bracket must close
                    self._known, allowed = self._known[:1], 0.0
        raise self._not_met(load, "in 60 trials")

    def _meet(self, load: float, trial: float) -> bool:
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

    def _learnt(self, step: Step, deflection: float) -> Step:
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

        def attempt(deflection: float) -> Step:
            height = self._loader.touch + deflection
            kept = field.array.copy(), road.kept()
            self._equilibrium.predict(height)
            step = self._equilibrium.solve(height, allowed=allowed)
            if not step.converged:  # restore the state before the prediction
                field.array[:] = kept[0]
                road.put_back(kept[1])
            return self._learnt(step, deflection)

        def let_go(deflection: float) -> Step:
            height = self._loader.touch + deflection
            return self._learnt(fall(self._equilibrium, height, allowed), deflection)

        largest = 0.25 * self._body.ring.thickness
        show = Show("deflection", 1.0, "m")
        self._loader.march(attempt, end, largest, show, start, let_go, lambda: self._above(load))

    def _above(self, load: float) -> bool:
        return self._known[-1].load > load
