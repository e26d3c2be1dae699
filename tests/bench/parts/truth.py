"""The true error of a run's axle force, against a reference run."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tireroad.contact.results.error_bars import Measured, bars, measured
from tireroad.tests.bench.parts.rolling_cases import Recorded


@dataclass(frozen=True)
class Truth:
    """An `exact` run, the time (s) from which runs are compared, and the highest frequency (Hz)."""

    exact: Recorded
    since: float
    up_to: float

    def error(self, run: Recorded) -> float:
        """The error that a search's target limits: the larger one of the vertical axle force's
        history and mean, relative."""
        one, other = self.measured(run)
        far = bars(one, other, 1.0)
        return float(max(far.history[2], far.mean[2] / abs(one.mean[2])))

    def measured(self, run: Recorded) -> list[Measured]:
        """The exact run and another one of the same duration, from an instant at which a step of
        both begins: a lag of half a step between their histories would count as an error."""
        forces = [one.forces["axle_force"] for one in (self.exact, run)]
        common = math.gcd(*(len(force) for force in forces))
        begun = math.ceil(self.since / (run.step * len(forces[1])) * common - 1e-9)
        assert begun < common, "the steps of the two runs never begin together"
        return [
            measured(force[begun * len(force) // common :], one.step, self.up_to, self.up_to)
            for force, one in zip(forces, (self.exact, run), strict=True)
        ]
