"""Vertical motion of the whole road: what a shaker or a drum under the tire does."""

import math
from collections.abc import Callable

from tireroad.fem.errors import InputError


def smoothstep(s: float) -> float:
    """6 s^5 - 15 s^4 + 10 s^3 on [0, 1], constant outside: twice continuously differentiable."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def make_motion(
    kind: str, amplitude: float = 0.0, frequency: float = 0.0, duration: float = 0.0
) -> Callable[[float], float]:
    """Height r(t) in m of the road over time t in s, r(0) = 0.

    kind "none": 0; "ramp": from 0 to `amplitude` (m, may be negative) over `duration` (s) by a
    smoothstep, constant after; "sine": amplitude sin(2 pi frequency t), frequency in Hz.
    InputError for another kind, a ramp without duration or a frequency that is not positive.
    """
    if kind == "none":
        return lambda t: 0.0
    if kind == "ramp":
        if not duration > 0.0:
            raise InputError(f"road.motion: the ramp's duration {duration:g} s must be positive")
        return lambda t: amplitude * smoothstep(t / duration)
    if kind == "sine":
        if not frequency > 0.0:
            raise InputError(f"road.motion: the frequency {frequency:g} Hz must be positive")
        return lambda t: amplitude * math.sin(2.0 * math.pi * frequency * t)
    raise InputError(f'road.motion.kind = "{kind}" is unknown: take "none", "ramp" or "sine"')
