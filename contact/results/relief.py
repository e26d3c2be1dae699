"""How much of the road's relief the contact points of a run see."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tireroad.contact.roads.cell_mean import CellMean
from tireroad.contact.roads.under_tire import NOTHING, is_level
from tireroad.contact.setup import ContactSetup

_LONGEST = 1.0  # m of road that is sampled
_MOST = 8000  # samples along


class Relief(NamedTuple):
    """Standard deviation (m) of the heights of the `road`, and of those that the `points` see."""

    road: float
    points: float


def nothing_met(setup: ContactSetup) -> bool:
    """Whether all heights that the patch passes over are the same, by the road's own bounds."""
    _, x1, y0, y1 = setup.patch.extent
    return is_level(setup.road, x1, setup.road.end, y0, y1)


def relief_seen(setup: ContactSetup) -> Relief | None:
    """The relief along up to three rows of points that touch, before and after smoothing.

    After the run-in, over at most 1 m; None if the points resolve the road, which is then not
    smoothed, or if there is nothing to see.
    """
    patch, road = setup.patch, setup.road
    held = np.flatnonzero(patch.force > 0)
    x = _places(setup)
    if not setup.fine or not len(held) or not len(x):
        return None
    order = held[np.argsort(patch.points[held, 1], kind="stable")]
    chosen = order[[0, len(order) // 2, -1]]
    y, half = patch.points[chosen, 1], patch.half_sizes[chosen]
    given = np.repeat(x[:, None], 3, axis=1), np.broadcast_to(y, (len(x), 3))
    raw, seen = road.height(*given), CellMean(road, y, half).height(*given)
    found = Relief(float(raw.std(axis=0).max()), float(seen.std(axis=0).max()))
    return found if found.road > NOTHING else None


def _places(setup: ContactSetup) -> np.ndarray:
    """Places (n,) m along a run, behind its run-in if half of it is left."""
    first, end = setup.patch.extent[1], setup.road.end
    grown = setup.road.grown
    first = grown if grown < 0.5 * (first + end) else first
    length = min(end - first, _LONGEST)
    count = int(np.clip(4 * length / setup.road.spacing, 0, _MOST))
    return first + length * (np.arange(count) + 0.5) / max(count, 1)
