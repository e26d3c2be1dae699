"""The true error of a run against a reference with another time step."""

from __future__ import annotations

import numpy as np

from tireroad.tests.bench.parts.rolling_cases import Recorded
from tireroad.tests.bench.parts.truth import Truth


def test_runs_of_other_steps_are_compared_over_the_same_time() -> None:
    def rolled(steps: int) -> Recorded:
        step = 0.16 / steps
        force = np.zeros((steps, 3))
        force[:, 2] = 500.0 + 20.0 * np.sin(2 * np.pi * 77.0 * step * np.arange(1, steps + 1))
        return Recorded({"axle_force": force}, step, {})

    # A lag of half a step of 1.25 ms would be 30 % of the variation.
    for since in (0.0, 0.0207, 0.0219, 0.05):
        assert Truth(rolled(1600), since, 100.0).error(rolled(128)) < 0.03
