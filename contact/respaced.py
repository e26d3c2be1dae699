"""The same contact patch with twice or half the spacing of its points: what that is worth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.contact.grid_patch import Surface, over_cells
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


def halved(patch: Patch, surface: Surface, road_height: float) -> Patch:
    """Four points in the rectangle of each of before, on the same nodes; not yet settled.

    For a patch on a grid, as `thinned`; `surface` and `road_height` (m) are those it was made from. Outermost points
    beyond those of before, where no road is prepared, or whose rectangles reach beyond the nodes are left out.
    """
    places = patch.places
    assert places is not None
    spacing = places.spacing[0] / 2, places.spacing[1] / 2
    base = np.rint(patch.points[:, :2] / places.spacing).astype(int)
    quarters = np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    number = (2 * base[:, None] + quarters).reshape(-1, 2)
    x, y = ((number - 0.5) * spacing).T
    ring, arc, found = surface.locate(x, y)
    here = over_cells(surface, np.stack([x, y], axis=-1), spacing, ring, arc)[:, patch.index]
    covered = np.asarray(here.sum(axis=1)).ravel()
    first = number.min(axis=0)
    row, column = (number - first).T
    shape = int(row.max()) + 1, int(column.max()) + 1
    x0, x1, y0, y1 = patch.extent
    found &= (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)
    kept = np.flatnonzero(found & (covered > 1 - 1e-9))
    kept = kept[np.argsort((row * shape[1] + column)[kept])]
    height = surface.at(ring, arc)[kept, 2]
    return replace(
        patch,
        points=np.stack([x[kept], y[kept], height], axis=-1),
        half_sizes=patch.half_sizes[kept // 4] / 2,
        force=np.zeros(len(kept)),
        gap=height - road_height,
        edge=patch.edge[kept // 4],
        line=column[kept],
        weights=here[kept].tocsr(),
        places=GridPlaces(shape, spacing, (row * shape[1] + column)[kept]),
    )
