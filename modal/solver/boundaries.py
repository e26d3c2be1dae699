"""Where to count eigenvalues next, so that slices hold about as many as each other."""

from __future__ import annotations

import numpy as np


def merged(steps: list[tuple[float, np.ndarray]], most: float) -> list[tuple[float, np.ndarray]]:
    """Fewer steps, of at most so many eigenvalues where none had more: the first ones were careful."""
    kept = steps[:1]
    for one, following in zip(steps[1:], [*steps[2:], None], strict=True):
        if following is None or (following[1] - kept[-1][1]).sum() > most:
            kept.append(one)
    return kept


def onward(low: float, step: float) -> float:
    """A step up in frequency, at most threefold once the first modes are known."""
    root = np.sqrt(low)
    return (root + (min(step, 2 * root) if root else step)) ** 2


def between(low: float, known: int, high: float, crowd: int, goal: float) -> float:
    """Where a straight line in frequency has `goal` more eigenvalues than at `low`, well inside."""
    share = np.clip(goal / (crowd - known), 0.05, 0.9)
    root = np.sqrt(max(low, 0.0))
    return (root + share * (np.sqrt(high) - root)) ** 2
