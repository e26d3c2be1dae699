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
            self.to(trial, allowed)
            rounding = self._equilibrium.rounding
            if not allowed and abs(self._known[-1].load - load) <= max(
                LOAD_TOLERANCE * load, rounding
            ):
                return trial
            trial = self._next_deflection(load)
            if trial < 0.99 * _REACH * max(k.deflection for k in self._known):
                if self._meet(load, trial):
                    return self._loader.deflection
                if allowed:  # from here on the bracket must close
                    self._known, allowed = self._known[:1], 0.0
        nearest = min(self._known, key=lambda k: abs(k.load - load))
        raise ConvergenceError(
            f"static: the load of {load:g} N was not met in 60 trials; nearest is {nearest.load:g} N. "
            "Give static.deflection instead, or refine the mesh."
        )

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
        near = sorted(self._known, key=lambda k: abs(k.deflection - trial))[:2]
        if len(near) < 2:
            return False
        reach = (trial - near[0].deflection) / (near[0].deflection - near[1].deflection)
        change = near[0].displacement - near[1].displacement
        self._body.u.x.array[:] = near[0].displacement + reach * change
        return True

    def to(self, trial: float, allowed: float = 0.0) -> None:
        """Solve at the trial deflection from the estimate, otherwise in steps.

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
        self._raise_road(below.deflection, trial, allowed)

    def _next_deflection(self, load: float) -> float:
        """Next trial: secant through the two loads nearest to the requested one, kept inside the
        bracket."""
        below = max((k for k in self._known if k.load <= load), key=lambda k: k.deflection)
        above = [k.deflection for k in self._known if k.load > load]
        far, near = sorted(self._known, key=lambda k: -abs(k.load - load))[-2:]
        rise, run = near.load - far.load, near.deflection - far.deflection
        slope = rise / run if run else 0.0
        secant = near.deflection + (load - near.load) / slope if slope > 0 else np.inf
        if above:
            low, high = below.deflection, min(above)
            return secant if low < secant < high else (low + high) / 2
        farthest = self._loader.farthest
        if below.deflection >= farthest:
            raise ConvergenceError(
                f"static: the tire carries {below.load:.4g} N at {below.deflection:.4g} m of deflection, where the "
                f"road reaches the rim; {load:g} N is out of reach. Lower static.load or raise static.inflation."
            )
        # Beyond the deflections tried the curve is unknown.
        least, most = np.minimum(np.array([1.01, _REACH]) * below.deflection, farthest)
        return float(np.clip(secant, least, most))

    def _learnt(self, step: Step, deflection: float) -> Step:
        """The step itself; if it converged, its state is recorded as known. Collective."""
        if step.converged:
            load, field = self._loader.load(), self._body.u.x.array
            self._known.append(_Known(deflection, load, field.copy()))
        return step

    def _raise_road(self, start: float, end: float, allowed: float) -> None:
        """Raise the road in steps and record each state."""

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
        self._loader.march(attempt, end, largest, Show("deflection", 1.0, "m"), start, let_go)
