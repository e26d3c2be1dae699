"""The same contact patch with twice or half the spacing of its points, for an error estimate."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from tireroad.contact.grid_patch import Surface, over_cells
from tireroad.contact.patch import Patch
from tireroad.contact.tread.kernel import GridPlaces

ACROSS = 8  # points across the footprint below which twice their spacing gives no estimate
MOST = 1000  # points that touch at rest with half the spacing, up to which a factor solves them


def ratio(patch: Patch, most: float = MOST) -> float:
    """Spacing of a companion's points over that of a patch in its static state.

    Half, if at most `most` points then touch: a run with finer points shows most of the error
    itself, while that of coarser ones is nearly independent of it. The forces of a footprint fewer
    than `ACROSS` points wide depend on where these happen to lie (cobblestones, 17 mm wide, points
    16, 11.3, 8, 5.7 and 4 mm apart: mean 547, 515, 521, 548, 545 N), so there it is half in any
    case. On a curved road the companion is always coarser.
    """
    least = patch.touching.min()
    if patch.places is None or patch.frames is not None or not least:
        return 2.0
    return 0.5 if finer_touching(patch) <= most or least < ACROSS else 2.0


def finer_touching(patch: Patch) -> int:
    """Points that touch at rest with half the spacing, from a patch in its static state."""
    return 4 * int(np.count_nonzero(patch.force))


def thinned(patch: Patch) -> Patch:
    """Points at multiples of twice the spacing, each for four original ones; not yet settled.

    For a patch on a grid (`places`) that is not settled either: `force` is zero, `gap` the
    surface's height.
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
        frames=None if patch.frames is None else patch.frames[keep],
        places=GridPlaces(shape, spacing, row * shape[1] + column),
    )


def halved(patch: Patch, surface: Surface, road_height: float, reach: float) -> Patch:
    """Points at multiples of half the spacing, on the same nodes; not settled.

    For a patch on a grid over a plane, as in `thinned`; `surface`, `road_height` and `reach` (m)
    are those that it was made from. Points beyond the original ones, where no road is prepared, and
    those whose rectangles extend beyond the nodes are left out.
    """
    assert patch.places is not None
    along, across = (step / 2 for step in patch.places.spacing)
    number = 2 * np.rint(patch.points[:, :2] / patch.places.spacing).astype(int)
    first, last = number.min(axis=0), number.max(axis=0)
    steps = np.array(list(product((-1, 0, 1), repeat=2)))
    number = np.unique((number[:, None] + steps).reshape(-1, 2).clip(first, last), axis=0)
    x, y = (number * (along, across)).T
    ring, arc, found = surface.locate(x, y)
    weights = over_cells(surface, np.stack([x, y], axis=-1), (along, across), ring, arc)
    weights = weights[:, patch.index].tocsr()
    held = found & (np.asarray(weights.sum(axis=1)).ravel() > 1 - 1e-9)
    x, y, weights, number = x[held], y[held], weights[held], number[held]
    height = surface.at(ring, arc)[held, 2]
    row, column = (number - first).T
    shape = int(row.max()) + 1, int(column.max()) + 1
    return replace(
        patch,
        points=np.stack([x, y, height], axis=-1),
        half_sizes=np.tile((along / 2, across / 2), (len(x), 1)),
        force=np.zeros(len(x)),
        gap=height - road_height,
        edge=height - road_height > reach,
        line=column,
        weights=weights,
        places=GridPlaces(shape, (along, across), row * shape[1] + column),
    )
