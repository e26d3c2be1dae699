"""Vertical motion of the whole road, such as that of a shaker or a drum."""

import math
from collections.abc import Callable
from dataclasses import dataclass

from tireroad.fem.parameters import Parameters, choice, number


def smoothstep(s: float) -> float:
    """6 s^5 - 15 s^4 + 10 s^3 on [0, 1], constant outside: twice continuously differentiable."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, kw_only=True)
class Motion(Parameters):
    """Height r(t) of the road over time: 0, a ramp, or a sine."""

    owner = "road.motion"

    kind: str = choice(
        "none", ("none", "ramp", "sine"), "vertical motion of the whole road over time"
    )
    amplitude: float = number(1.0e-3, "m", "amplitude of the motion, positive up", least=-1, most=1)
    frequency: float = number(
        50.0,
        "Hz",
        "frequency of the sine",
        least=1e-3,
        most=1e5,
        only_for=("kind", ("none", "sine")),
    )
    duration: float = number(
        0.01, "s", "duration of the ramp", least=1e-5, most=1e5, only_for=("kind", ("none", "ramp"))
    )


def make_motion(
    kind: str, amplitude: float = 0.0, frequency: float = 50.0, duration: float = 0.01
) -> Callable[[float], float]:
    """Height r(t) in m of the road over time t in s, r(0) = 0.

    kind "none": 0; "ramp": from 0 to `amplitude` (m, may be negative) over `duration` (s) by a
    smoothstep, then constant; "sine": amplitude sin(2 pi frequency t), frequency in Hz. InputError
    for another kind or a value outside the range given in `Motion`.
    """
    Motion(kind=kind, amplitude=amplitude, frequency=frequency, duration=duration)
    if kind == "ramp":
        return lambda t: amplitude * smoothstep(t / duration)
    if kind == "sine":
        return lambda t: amplitude * math.sin(2.0 * math.pi * frequency * t)
    return lambda t: 0.0
