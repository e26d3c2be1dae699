"""The projected states beside those of the full problem: how far off, and whether one is missing."""

from __future__ import annotations

import numpy as np
from scipy import optimize

_BORDER = 0.02  # relative: a truncated basis may put a state on the other side of a limit by that


def truncation(full: np.ndarray, projected: np.ndarray) -> np.ndarray:
    """Relative error (q,) of the projected eigenvalue nearest to each of the full problem."""
    distance = np.abs(full[:, None] - projected)
    rows, columns = optimize.linear_sum_assignment(distance)
    error = np.full(len(full), np.inf)  # a state that the basis does not know
    error[rows] = distance[rows, columns]
    return error / np.abs(full)


def missing(full: np.ndarray, projected: np.ndarray, low: float, high: float) -> int:
    """How many states the full problem lacks between two limits (1/s), by the count of the projected one.

    `full`, `projected` are the states' sizes (Im s or |s|); those of a truncated basis within 2 % of a limit may
    lie beyond it.
    """
    inside = (projected > low * (1 + _BORDER)) & (projected < high * (1 - _BORDER))
    found = (full >= low) & (full <= high)
    return max(int(inside.sum()) - int(found.sum()), 0)
