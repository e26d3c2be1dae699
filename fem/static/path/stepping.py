"""Adaptive load steps: halved when Newton's method fails, enlarged when it converges easily.

If the steps become too small, an error names the last converged state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from tireroad.fem.errors import LoadingStopped
from tireroad.fem.static.equilibrium import Step

_SMALLEST = 1e-4  # of the first step: smaller load steps are abandoned
_LARGEST = 4  # times the first step
_STUCK = 3  # consecutive failures after which a fall is tried, once
_EASY = 6  # tangents up to which the next load step may grow

Attempt = Callable[[float], Step]


@dataclass(frozen=True)
class Show:
    """What is stepped, for display: its name, and its value `scale` at 1 in `unit`."""

    what: str
    scale: float
    unit: str


def march(
    attempt: Attempt,
    start: float,
    end: float,
    first: float,
    show: Show,
    fall: Attempt | None = None,
    enough: Callable[[], bool] = lambda: False,
) -> None:
    """From a converged `start` to `end` in steps, the first of size `first`. Collective.

    If steps keep failing, `fall` searches for a state not near the last one (path.snap). Ends
    before `end` after a converged step that is `enough`. Raises LoadingStopped if steps of a
    ten-thousandth of the first do not converge either.
    """
    done, size, failures = start, first, 0
    while True:
        left = end - done
        target = end if abs(left) <= size * (1 + 1e-12) else done + math.copysign(size, left)
        step = attempt(target)
        failures = 0 if step.converged else failures + 1
        if fall is not None and failures == _STUCK:
            step = fall(target)
        if step.converged:
            done, failures = target, 0
            if done == end or enough():
                return
            size = min(_LARGEST * first, 2 * size) if step.iterations <= _EASY else size
            continue
        size = 0.5 * min(size, abs(target - done))
        if size < _SMALLEST * first:
            scale, unit = show.scale, show.unit
            raise LoadingStopped(
                f"static: {show.what} stops at {done * scale:.6g} {unit} of {end * scale:.6g} {unit}; "
                f"a further step of {size * scale:.2g} {unit} does not converge ({step.reason})"
            )
