"""The same contact patch with every other point of its grid: what the points' spacing is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.contact.patch import Patch
from tireroad.contact.tread.kernel import GridPlaces


def thinned(patch: Patch) -> Patch:
    """Points at multiples of twice the spacing, each for four of before; not yet settled.

    For a patch on a grid (`places`), not settled either: `force` is zero, `gap` the surface's height.
    """
    places, weights = patch.places, patch.weights
    assert places is not None and weights is not None  # of every grid
    number = np.rint(patch.points[:, :2] / places.spacing).astype(int)
    keep = (number % 2 == 0).all(axis=1)
    first = number[keep].min(axis=0)
    row, column = ((number[keep] - first) // 2).T
    shape = int(row.max()) + 1, int(column.max()) + 1
    spacing = 2 * places.spacing[0], 2 * places.spacing[1]
    return replace(
        patch,
        points=patch.points[keep],
        half_sizes=2 * patch.half_sizes[keep],
        force=patch.force[keep],
        gap=patch.gap[keep],
        edge=patch.edge[keep],
        line=column,
        weights=weights[keep],
        places=GridPlaces(shape, spacing, row * shape[1] + column),
    )
