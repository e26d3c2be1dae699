"""Contact points on a grid between the nodes, and the state at rest moved to other points.

The finite elements find the static state with the road touching nodes only, and without the tread.
On the grid, or on the nodes with their tread, the contact therefore settles again under the same
load, linearised about that state: f >= 0, g >= 0, f . g = 0 with

    g = z_surface - z_road + delta + C~ f + W (A_static (W^T f - f_nodes) + u_0),  sum f = load,

where A_static is the exact static flexibility between the nodes, delta the rise of the tire, and u_0 what moves the nodes
besides, such as the losses of a rolling tire (greens.rolling_loss).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Protocol

import numpy as np
from scipy import sparse
from scipy.optimize import brentq

from tireroad.contact.patch import Patch
from tireroad.contact.solver.conditions import ContactSolver, Mixed
from tireroad.contact.tread.kernel import GridPlaces
from tireroad.fem.errors import ConvergenceError, UnsuitedSettings

# Points of the largest grid that is laid out before the patch is known.
MOST_POINTS = 1_000_000
LOAD_TOLERANCE = 1e-7
# m: the first step in which the tire's rise is sought, and how closely it is found (1e-8 N of a passenger tire).
_STEP, _RISE = 1e-4, 1e-13
# Of a tread that creeps at rest: turns, and by what its displacements may change in the last, of the largest.
MOST_TURNS, SETTLED = 60, 1e-6

ACROSS = 8  # points across the footprint below which twice their spacing gives no estimate
MOST = 1000  # points that touch at rest with half the spacing, up to which a factor solves them


class DeformedTread(Protocol):
    """The deformed tread (fem.tread_surface.TreadSurface)."""

    def weights(self, ring: np.ndarray, arc: np.ndarray) -> sparse.csr_matrix: ...

    def at(self, ring: np.ndarray, arc: np.ndarray) -> np.ndarray: ...

    def locate(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


def make_grid_patch(
    surface: DeformedTread,
    road_height: float,
    nodes: Patch,
    spacing: tuple[float, float],
    reach: float,
) -> Patch:
    """Points at multiples of the spacing (m) with a static gap within reach (m), not yet settled.

    One more row around them is the edge, which should never touch. `nodes`: the patch of the nodes
    for the same reach, which the grid covers. `gap` is the surface's height over the road plane
    (m), negative where it penetrates between touching nodes; `force` is still zero. InputError for
    a grid that is too large or has no point near the road.
    """
    x0, x1, y0, y1 = nodes.extent
    margin = nodes.half_sizes.max(axis=0)
    ends = (x0 - margin[0], x1 + margin[0]), (y0 - margin[1], y1 + margin[1])
    _check_count(ends, spacing, reach)
    lines = [
        step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
        for (low, high), step in zip(ends, spacing, strict=True)
    ]
    shape = len(lines[0]), len(lines[1])
    x, y = (a.ravel() for a in np.meshgrid(*lines, indexing="ij"))
    ring, arc, inside = surface.locate(x, y)
    height = surface.at(ring, arc)[:, 2]
    near = inside & (height - road_height <= reach)
    wide = np.pad(near.reshape(shape), 1)
    touching = wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]
    touching = (touching.ravel() | near) & inside
    place = np.flatnonzero(touching)
    if len(place) == 0:
        raise UnsuitedSettings("contact.points: no grid point near the road; take a finer grid")
    weights = over_cells(
        surface, np.stack([x, y], axis=-1)[place], spacing, ring[place], arc[place]
    )
    used = np.union1d(weights.indices, nodes.index[nodes.force > 0])
    return Patch(
        index=used,
        points=np.stack([x, y, height], axis=-1)[place],
        half_sizes=np.tile(np.array(spacing) / 2, (len(place), 1)),
        force=np.zeros(len(place)),
        gap=(height - road_height)[place],
        edge=~near[place],
        line=place % shape[1],
        weights=weights[:, used].tocsr(),
        places=GridPlaces(shape, spacing, place),
    )


def over_cells(
    surface: DeformedTread,
    points: np.ndarray,
    spacing: tuple[float, float],
    ring: np.ndarray,
    arc: np.ndarray,
) -> sparse.csr_matrix:
    """Shape functions (c, s) averaged over the cell of each point (c, 2) m, by 2 x 2 Gauss points.

    A point's force is a pressure on its cell, as in the tread, and its displacement the mean there.
    The penetration of a point force would depend on the element: 16.9 um/N where elements of order
    3 meet, 9.3 to 9.7 inside, on a wall of 48 MPa, 12 mm thick; over cells of 5 mm 9.7 and 9.0 to
    9.2. Where a cell extends beyond the surface, `ring` and `arc` (rad) of its point are used.
    """
    parts = []
    for signs in product((-1, 1), repeat=2):
        x, y = (points + np.array(signs) * spacing / np.sqrt(12)).T
        around, along, inside = surface.locate(x, y)
        parts.append(surface.weights(np.where(inside, around, ring), np.where(inside, along, arc)))
    return sum(parts[1:], start=parts[0]) / 4


def _check_count(
    ends: Sequence[tuple[float, float]], spacing: tuple[float, float], reach: float
) -> None:
    """UnsuitedSettings for a grid of more than MOST_POINTS, before it is laid out."""
    sizes = [high - low for low, high in ends]
    counts = [np.floor(size / step) for size, step in zip(sizes, spacing, strict=True)]
    if counts[0] * counts[1] > MOST_POINTS:
        raise UnsuitedSettings(
            f"contact.points: dx = {spacing[0]:g} m, dy = {spacing[1]:g} m make {counts[0]:.3g} x "
            f"{counts[1]:.3g} points on the {sizes[0]:.3g} m x {sizes[1]:.3g} m within contact.reach = "
            f"{reach:.3g} m, more than {MOST_POINTS}: take a coarser grid or a smaller contact.reach"
        )


def equilibrate(
    patch: Patch,
    solver: ContactSolver,
    flexibility: np.ndarray,
    nodal_force: np.ndarray,
    offset: np.ndarray | None = None,
    past: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[Patch, float]:
    """The patch in its static state, and the rise delta (m) of the tire.

    `solver` is made for W A_static W^T + C~; `flexibility` A_static (p, p) m/N; `nodal_force` (p,)
    N of the finite elements, whose sum is preserved; `offset` (p,) m: what moves the nodes besides; `past`: displacements (c,) m
    of the points by forces (c,) N on a tread that creeps, beyond those that the solver knows, found by Anderson's acceleration.
    ConvergenceError if no rise yields that load.
    """
    load = float(nodal_force.sum())
    moved = -(flexibility @ nodal_force) if offset is None else offset - flexibility @ nodal_force
    flat = patch.gap + patch.at_points(moved)
    if load == 0.0:  # clear of the road
        rise = max(0.0, -float(flat.min()))
        return replace(patch, force=np.zeros_like(flat), gap=flat + rise), rise

    def settled(moved: np.ndarray | float, near: float, step: float) -> tuple[np.ndarray, float]:
        @cache
        def excess(rise: float) -> float:
            return float(solver.solve(flat + moved + rise).sum()) / load - 1.0

        rise = brentq(excess, *_bracket(excess, near, step), xtol=_RISE)
        return solver.solve(flat + moved + rise), rise

    crept, mixed = np.zeros((1, len(flat))), Mixed()
    rise, step = 0.0, _STEP
    for _ in range(MOST_TURNS):
        before = rise
        force, rise = settled(crept[0], rise, step)
        step = max(2.0 * abs(rise - before), 1e4 * _RISE)
        if past is None:
            break
        rest = past(force)[None] - crept
        if np.abs(rest).max() <= SETTLED * np.abs(crept).max():
            break
        crept = mixed.next(crept, rest, np.where(force > 0.0, 1.0, 0.0)[None])
    else:
        raise ConvergenceError(
            f"contact: no state at rest of a tread that creeps was found in {MOST_TURNS} turns"
        )
    if not abs(force.sum() / load - 1.0) < LOAD_TOLERANCE:
        raise ConvergenceError(
            f"contact: the points carry {force.sum():.6g} N, not {load:.6g} N; take a finer grid "
            "(contact.points)"
        )
    gap = np.maximum(solver.gap, 0.0)
    return replace(patch, force=force, gap=gap), rise


def spread_pull(patch: Patch, pull: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Horizontal forces (c, 2) N at the points of a settled grid, from those of the nodes.

    `pull` (p, 2) N acts on the nodes beside their normal `force` (p,). A point has the ratio of the
    two at the nodes around it; the sum of `pull` is preserved.
    """
    touching = (force > 0).astype(float)
    ratio = pull / np.where(force > 0, force, 1.0)[:, None]
    near = patch.at_points(touching)
    share = patch.at_points(ratio * touching[:, None]) / np.maximum(near, 1e-12)[:, None]
    pulls = patch.force[:, None] * share
    whole = float(patch.force.sum()) or 1.0  # none where the tire is clear of the road
    return pulls + (pull.sum(axis=0) - pulls.sum(axis=0)) * (patch.force / whole)[:, None]


def _bracket(excess: Callable[[float], float], near: float, step: float) -> tuple[float, float]:
    """Rises (m) with too much and with too little load, sought from one that is `near` in steps that double.

    ConvergenceError if there are none.
    """
    much = excess(near) > 0.0
    for _ in range(20):
        beyond = near + (step if much else -step)
        if (excess(beyond) > 0.0) != much:
            return min(near, beyond), max(near, beyond)
        near, step = beyond, 2.0 * step
    raise ConvergenceError(
        "contact: no height of the tire gives the static load on the points; take a finer grid "
        "(contact.points), or a larger contact.reach"
    )


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


def halved(patch: Patch, surface: DeformedTread, road_height: float, reach: float) -> Patch:
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
    ring, arc, inside = surface.locate(x, y)
    weights = over_cells(surface, np.stack([x, y], axis=-1), (along, across), ring, arc)
    weights = weights[:, patch.index].tocsr()
    held = inside & (np.asarray(weights.sum(axis=1)).ravel() > 1 - 1e-9)
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
