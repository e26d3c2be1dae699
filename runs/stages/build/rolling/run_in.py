"""The run-in, while the road grows from flat: it is left out of a run's figures."""

from __future__ import annotations

import numpy as np

from tireroad.contact.roads.under_tire import is_level
from tireroad.contact.setup import ContactSetup
from tireroad.runs.scene.tables.road import Road


def run_in(setup: ContactSetup, road: Road) -> float:
    """Time (s) until the whole patch is past the run-in; 0 if there is none.

    There is none either where the road is level up to its end, as before a cleat: nothing grows,
    and the impact would be left out with it.
    """
    speed, grown = setup.rolled.speed, setup.road.grown
    x0, x1, y0, y1 = setup.patch.extent
    if speed == 0 or road.kind == "flat" or is_level(setup.road, min(x0, grown), grown, y0, y1):
        return 0.0
    return (road.run_in + x1 - x0) / speed


def first_step(setup: ContactSetup, road: Road, time: np.ndarray) -> int:
    """Index of the first step past the run-in; 0 if that is half the run or more."""
    start = int(np.searchsorted(time, run_in(setup, road)))
    return start if start < len(time) // 2 else 0
