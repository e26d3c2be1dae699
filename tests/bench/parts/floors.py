"""Peak rates of the machine: lower bounds for the measured stages."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def durations(work: Callable[[], object], repeats: int) -> list[float]:
    """Durations of several runs, s."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return times


def fastest(work: Callable[[], object], repeats: int) -> float:
    """Shortest of several runs, s, used as a lower bound."""
    return min(durations(work, repeats))


def bandwidth() -> float:
    """Memory bandwidth of a + s b -> c, bytes per second, on one core."""
    a, b, c = np.ones((3, 8_000_000))

    def triad() -> None:
        np.multiply(b, 3.0, out=c)
        np.add(a, c, out=c)

    return 5 * a.nbytes / fastest(triad, 5)


def flop_rate() -> float:
    """Floating-point operations per second of a dense product."""
    n = 1000
    a = np.ones((n, n))
    return 2 * n**3 / fastest(lambda: a @ a, 5)


def exponent(sizes: list[float], costs: list[float]) -> float:
    """Slope of log cost over log size."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])
