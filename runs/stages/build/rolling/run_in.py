"""The run-in, while the road grows from flat: it is left out of a run's figures."""

from __future__ import annotations

import numpy as np

from tireroad.contact.setup import ContactSetup
from tireroad.runs.scene.tables.road import Road


def run_in(setup: ContactSetup, road: Road) -> float:
    """Time (s) until the whole patch is past the run-in; 0 if there is none."""
    speed = setup.rolled.speed
    if speed == 0 or road.kind == "flat":
        return 0.0
    x0, x1, _, _ = setup.patch.extent
    return (road.run_in + x1 - x0) / speed


def first_step(setup: ContactSetup, road: Road, time: np.ndarray) -> int:
    """Index of the first step past the run-in; 0 if that is half the run or more."""
    start = int(np.searchsorted(time, run_in(setup, road)))
    return start if start < len(time) // 2 else 0
