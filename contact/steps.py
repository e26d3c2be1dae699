"""The number of time steps, and hence the duration of a run and the distance rolled."""

from __future__ import annotations

import math
from dataclasses import dataclass

from tireroad.fem.errors import InputError

_ROUNDING = 1e-9  # of the number of steps: a duration that is a multiple of the step stays one


@dataclass(frozen=True)
class Steps:
    """`count` equal steps of `size` s from the known state at t = 0 to the last at `duration`."""

    size: float
    count: int

    @property
    def duration(self) -> float:
        """Time of the last step, s; not less than the requested duration."""
        return self.size * self.count


def steps_of(duration: float, size: float) -> Steps:
    """The smallest number of steps of `size` (s) that cover `duration` (s), at least one."""
    check_times(duration, size)
    return Steps(size, max(math.ceil(duration / size * (1.0 - _ROUNDING)), 1))


def equal_steps(duration: float, largest: float) -> Steps:
    """Equal steps no longer than `largest` (s) that end exactly at `duration` (s)."""
    check_times(duration, largest)
    count = steps_of(duration, largest).count
    return Steps(duration / count, count)


def check_times(duration: float, size: float) -> None:
    """InputError for a duration or a step (s) that is not positive and finite."""
    for name, value in (("duration", duration), ("step", size)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"time.{name} = {value:g} s must be positive and finite")
