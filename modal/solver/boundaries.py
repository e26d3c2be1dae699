"""Where to count eigenvalues next, so that all slices hold about as many."""

from __future__ import annotations

import numpy as np


def merged(steps: list[tuple[float, np.ndarray]], most: float) -> list[tuple[float, np.ndarray]]:
    """Join neighbouring steps as long as together they hold at most `most` eigenvalues.

    The first steps are narrow, because the density of eigenvalues is not known yet.
    """
    kept = steps[:1]
    for one, following in zip(steps[1:], [*steps[2:], None], strict=True):
        if following is None or (following[1] - kept[-1][1]).sum() > most:
            kept.append(one)
    return kept


def onward(low: float, step: float) -> float:
    """The next boundary, `step` (rad/s) up; at most threefold once the first modes are known."""
    root = np.sqrt(low)
    return (root + (min(step, 2 * root) if root else step)) ** 2


def between(low: float, known: int, high: float, crowd: int, goal: float) -> float:
    """The value with `goal` eigenvalues more than at `low`, interpolated linearly in frequency.

    `known` lie below `low` and `crowd` below `high`; the result stays well inside the interval.
    """
    share = np.clip(goal / (crowd - known), 0.05, 0.9)
    root = np.sqrt(max(low, 0.0))
    return (root + share * (np.sqrt(high) - root)) ** 2
