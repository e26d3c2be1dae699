"""The run-in, while the road grows from flat: it is left out of a run's figures."""

from __future__ import annotations

import numpy as np

from tireroad.contact.roads.under_tire import is_level
from tireroad.contact.setup import ContactSetup
from tireroad.runs.scene.tables.scene import Road


def run_in(setup: ContactSetup, road: Road) -> float:
    """Time (s) until the whole patch is past the run-in; 0 if there is none.

    There is none either where the road is level up to its end, as before a cleat: nothing grows,
    and the impact would be left out with it.
    """
    return 0.0 if road.kind == "flat" else grown(setup, road.run_in)


def grown(setup: ContactSetup, length: float) -> float:
    """The same for a run-in of this length (m) on a road of any kind."""
    speed, whole = setup.rolled.speed, setup.road.grown
    x0, x1, y0, y1 = setup.patch.extent
    if speed == 0 or is_level(setup.road, min(x0, whole), whole, y0, y1):
        return 0.0
    return (length + x1 - x0) / speed


def first_step(setup: ContactSetup, road: Road, time: np.ndarray) -> int:
    """Index of the first step past the run-in; 0 if that is half the run or more."""
    start = int(np.searchsorted(time, run_in(setup, road)))
    return start if start < len(time) // 2 else 0
