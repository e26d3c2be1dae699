"""Load steps to a wanted state: inflation, then the road by height, deflection or load.

Steps are cut back when Newton fails and grow again when it is easy; a step that cannot be made
small enough is an error that names the last good state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mpi4py import MPI

from fem.equilibrium import Equilibrium, Step
from fem.errors import ConvergenceError, InputError

LOAD_TOLERANCE = 1e-9  # of the wanted load; a tenth of what other quantities are compared to
_SMALLEST = 1e-4  # of the first step: below it a load step is hopeless
_EASY = 8  # Newton steps up to which the next load step may grow


@dataclass(frozen=True)
class Progress:
    """One load step done: what was stepped to, and the road's total force (N) on how many points."""

    what: str
    value: float
    unit: str
    load: float
    active: int
    step: Step


class Loader:
    """Brings the body of one equilibrium problem to the wanted state. All methods are collective."""

    def __init__(self, equilibrium: Equilibrium, report: Callable[[Progress], None]):
        self.equilibrium = equilibrium
        self.body = equilibrium.body
        self.report = report
        self.newton_steps = 0
        self.touch: float | None = None

    def inflate(self, pressure: float) -> None:
        """Inflation from 0 to `pressure` (Pa), without a road; also the steady-rolling loads alone."""

        def attempt(fraction: float) -> Step:
            self.equilibrium.pressure.value = fraction * pressure
            return self.equilibrium.solve()

        self._march(attempt, 0.0, 1.0, 1.0, "inflation", pressure, "Pa")
        # Through comm.allreduce every process has the same bits, so all take the same steps.
        lowest = self.equilibrium.tread_height().min(initial=float("inf"))
        self.touch = self.body.comm.allreduce(lowest, op=MPI.MIN)

    def deflect(self, deflection: float) -> None:
        """Raise the road by `deflection` (m) from first touch of the inflated tire."""
        self._raise_road(0.0, deflection)

    def carry(self, load: float) -> float:
        """Raise the road until it carries `load` (N); the deflection (m). Secant within a bracket."""
        if load <= 0:
            raise InputError(f"static.load = {load:g} N: a road carries a positive load")
        known = [(0.0, 0.0)]  # (deflection, load), by deflection
        trial = 0.1 * self.body.tire.section.thickness
        for _ in range(60):
            below = max((k for k in known if k[1] <= load), key=lambda k: k[0])
            self._raise_road(below[0] if trial > below[0] else trial, trial)
            known = sorted([*known, (trial, self.load())])
            if abs(self.load() - load) <= LOAD_TOLERANCE * load:
                return trial
            trial = _next_deflection(known, load, self.body.tire.section.minor_radius)
        raise ConvergenceError(
            f"static: the load of {load:g} N was not met in 60 trials; nearest is "
            f"{min((k[1] for k in known), key=lambda f: abs(f - load)):g} N. "
            "Give static.deflection instead, or refine the mesh."
        )

    def load(self) -> float:
        """Total vertical force of the road, N. Collective."""
        return self.body.comm.allreduce(self.equilibrium.contact_force().sum())

    def _raise_road(self, start: float, end: float) -> None:
        def attempt(deflection: float) -> Step:
            return self.equilibrium.solve(self.touch + deflection)

        largest = 0.25 * self.body.tire.section.thickness
        self._march(attempt, start, end, largest, "deflection", 1.0, "m")

    def _march(self, attempt, start, end, first, what, scale, unit) -> None:
        """From a converged `start` to `end` in steps of at most `first`, cut back on failure."""
        done, size = start, first
        while True:
            target = end if abs(end - done) <= size * (1 + 1e-12) else done + size
            step = attempt(target)
            self.newton_steps += step.iterations
            if step.converged:
                force, active = self._contact()
                self.report(Progress(what, target * scale, unit, force, active, step))
                done = target
                if done == end:
                    return
                size = min(first, 2 * size) if step.iterations <= _EASY else size
                continue
            size = 0.5 * min(size, abs(target - done))
            if size < _SMALLEST * first:
                raise ConvergenceError(
                    f"static: {what} stops at {done * scale:.6g} {unit} of {end * scale:.6g} {unit}; "
                    f"a further step of {size * scale:.2g} {unit} does not converge "
                    f"({step.reason}). The tire may fold or buckle here: lower the load or raise "
                    "the inflation, stiffen the material or refine the mesh around the footprint."
                )

    def _contact(self) -> tuple[float, int]:
        force = self.equilibrium.contact_force()
        return self.body.comm.allreduce(force.sum()), self.body.comm.allreduce(
            int((force > 0).sum())
        )


def _next_deflection(known: list[tuple[float, float]], load: float, largest: float) -> float:
    """Secant through the two loads nearest to the wanted one, kept inside the bracket."""
    below = [k for k in known if k[1] <= load]
    above = [k for k in known if k[1] > load]
    (d0, f0), (d1, f1) = sorted(known, key=lambda k: abs(k[1] - load))[:2]
    secant = d1 + (load - f1) * (d1 - d0) / (f1 - f0) if f1 != f0 else d1 + (d1 - d0)
    if above:
        low, high = below[-1][0], above[0][0]
        return secant if low < secant < high else (low + high) / 2
    if below[-1][0] > largest:
        raise ConvergenceError(
            f"static: the tire carries {below[-1][1]:.4g} N at {below[-1][0]:.4g} m of deflection, "
            f"beyond its section; {load:g} N is out of reach. Lower static.load or raise static.inflation."
        )
    # The load curve stiffens: never more than double the deflection in one trial.
    return min(max(secant, below[-1][0] * 1.01), 2 * below[-1][0])
