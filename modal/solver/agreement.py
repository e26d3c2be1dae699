"""Comparison of the projected states with those of the full problem: errors and missing states."""

from __future__ import annotations

import numpy as np
from scipy import optimize

_BORDER = 0.02  # relative: truncation may move a state across a limit by as much


def truncation(full: np.ndarray, projected: np.ndarray) -> np.ndarray:
    """Relative error (q,) of the projected eigenvalue matched to each full eigenvalue."""
    distance = np.abs(full[:, None] - projected)
    rows, columns = optimize.linear_sum_assignment(distance)
    error = np.full(len(full), np.inf)  # inf: no projected state left to match
    error[rows] = distance[rows, columns]
    return error / np.abs(full)


def missing(full: np.ndarray, projected: np.ndarray, low: float, high: float) -> int:
    """Number of states missing from the full problem between two limits (1/s).

    `full`, `projected` are magnitudes (Im s or |s|). Projected states within 2 % of a limit are not
    counted, since truncation may have moved them across it.
    """
    inside = (projected > low * (1 + _BORDER)) & (projected < high * (1 - _BORDER))
    found = (full >= low) & (full <= high)
    return max(int(inside.sum()) - int(found.sum()), 0)
