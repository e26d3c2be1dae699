"""Sections meshed as the product of two lines of elements: through the wall and along it.

Element sizes near a clamped edge: geometric grading, as far as the other elements allow.

At a clamped edge stresses are singular and a bending boundary layer ends. Sizes that grow in
proportion to the distance (h = h0 + GROWTH d) give each element the same error. The smallest size
depends on the number of elements: if there are few, the middle of the wall needs them more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import SectionMesh

# Largest error in % of nine frequencies (n = 0, 1, 3; three each) of the clamped torus of order 3,
# exact ring, with 8, 10, 12, 14 and 16 elements along the arc. This grading: 0.82, 0.38, 0.22,
# 0.16, 0.14; cosine down to 0.3 of the uniform size at the bead: 1.0, 0.56, 0.37, 0.28, 0.22; sizes
# from a twelfth of the wall: 12, 5.7, 3.4.
GROWTH = 1.0
SPARE = 1.3  # largest size over the uniform one
LEAST = 1.33  # smallest size: wall thicknesses over the number of elements


def size(distance: np.ndarray, length: float, count: int, floor: float) -> np.ndarray:
    """Sizes at distances from the nearer of two clamped edges, for `count` elements over a length.

    Distances, length, floor (the least size at the edge) and result have the same unit.
    """
    largest = SPARE * length / count

    def elements(logarithm: float) -> float:
        first = largest * np.exp(-logarithm)
        graded = 2 * (largest - first) / GROWTH
        return 2 * logarithm / GROWTH + max(length - graded, 0.0) / largest

    low, deep = 0.0, np.log(largest / floor) if largest > floor else 0.0
    if elements(deep) > count:  # a smaller first element costs more elements: bisect
        for _ in range(60):
            middle = (low + deep) / 2
            low, deep = (middle, deep) if elements(middle) < count else (low, middle)
    return np.minimum(largest * np.exp(-deep) + GROWTH * distance, largest)


@dataclass(frozen=True)
class RegionPatch:
    """A part of a wall of another compound: signed section angles (rad) and depths, from and to.

    Depth as a fraction of the wall: 0 inner, 1 outer face.
    """

    name: str
    arcs: tuple[tuple[float, float], ...]
    depth: tuple[float, float]


@dataclass(frozen=True)
class PlyLine:
    """A line of cords: from, to in rad, at a depth as a fraction of the wall (0 inner, 1 outer)."""

    name: str
    arc: tuple[float, float]
    depth: float


def product(
    *,
    order: int,
    wall: np.ndarray,
    arc: np.ndarray,
    place: Callable[[np.ndarray, np.ndarray], np.ndarray],
    patches: Sequence[RegionPatch] = (),
    plies: Sequence[PlyLine] = (),
    main: str = "wall",
) -> SectionMesh:
    """The section with ascending corners at depths `wall` (0 to 1) and angles `arc` (rad).

    `place(depth, angle)` gives (r, y) m. The inner face is at depth 0, the outer one, all of it
    tread, at 1; the rim is at both ends. Edges of patches and plies must be among the corners.
    """
    layers, along = len(wall) - 1, len(arc) - 1

    def position(cells: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        k, j = np.divmod(cells, along)
        return place(_between(wall, k, xi), _between(arc, j, eta))

    cells = _cells(layers, along, order)
    k, j = (part.ravel() for part in np.meshgrid(range(layers), range(along), indexing="ij"))
    depth, angle = (wall[k] + wall[k + 1]) / 2, (arc[j] + arc[j + 1]) / 2
    across, length = np.arange(layers), np.arange(along)
    return SectionMesh(
        order=order,
        nodes=_nodes(cells, order, position),
        cells=cells,
        region=_regions(depth, angle, patches),
        regions=(main, *(patch.name for patch in patches)),
        outer=_edges((layers - 1) * along + length, 1),
        tread=_edges((layers - 1) * along + length, 1),
        inner=_edges(length, 0),
        rim=np.concatenate([_edges(across * along, 2), _edges((across + 1) * along - 1, 3)]),
        plies={ply.name: _ply(ply, wall, arc) for ply in plies},
        position=position,
    )


def _between(corners: np.ndarray, element: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Positions within elements of a line; an element's end is exactly the corner."""
    inside = np.diff(corners)[element] * t + corners[element]
    return np.where(t == 1.0, corners[element + 1], inside)


def _cells(layers: int, along: int, order: int) -> np.ndarray:
    k, j = np.divmod(np.arange(layers * along)[:, None], along)
    step_k, step_j = np.divmod(np.arange((order + 1) ** 2), order + 1)
    return (order * k + step_k) * (order * along + 1) + order * j + step_j


def _nodes(
    cells: np.ndarray,
    order: int,
    position: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
) -> np.ndarray:
    _, first = np.unique(cells, return_index=True)
    owner, local = np.divmod(first, cells.shape[1])
    xi, eta = (part[local] for part in mesh2d.grid_points(mesh2d.equispaced(order)))
    return position(owner, xi, eta)


def _regions(depth: np.ndarray, angle: np.ndarray, patches: Sequence[RegionPatch]) -> np.ndarray:
    """Number of the last patch that contains each cell, from 1; 0: none."""
    owner = np.zeros(len(depth), int)
    for number, patch in enumerate(patches):
        along = [(angle > low) & (angle < high) for low, high in patch.arcs]
        inside = np.any(along, axis=0) & (depth > patch.depth[0]) & (depth < patch.depth[1])
        if not inside.any():
            raise InputError(
                f"{patch.name}: no part of the wall lies in its arc and depth; the wall ends at the beads"
            )
        owner[inside] = number + 1
    return owner


def _edges(cells: np.ndarray, side: int) -> np.ndarray:
    return np.stack([cells, np.full(len(cells), side)], axis=1)


def _ply(ply: PlyLine, wall: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """Sides xi = 0 of the cells outside the ply, or xi = 1 below the outer face."""
    level = int(np.abs(wall - ply.depth).argmin())
    first, last = (int(np.abs(arc - end).argmin()) for end in ply.arc)
    along, top = len(arc) - 1, level == len(wall) - 1
    row = level - 1 if top else level
    return _edges(row * along + np.arange(first, last), 1 if top else 0)


def corners(
    count: int,
    density: Callable[[np.ndarray], np.ndarray],
    low: float,
    high: float,
    between: Sequence[float] = (),
) -> np.ndarray:
    """Ascending corners from low to high, one at each of `between`, for at least `count` elements.

    `density(x)`: relative number of elements per length. Each part gets its share of the count, at
    least one, and its corners divide the density evenly. Symmetry about the middle is preserved
    exactly.
    """
    fixed = np.unique(np.concatenate([[low, high], between]))
    small = 1e-9 * (high - low)
    fixed = fixed[(fixed >= low) & (fixed <= high)]
    fixed = fixed[np.append(True, np.diff(fixed) > small)]
    fixed[-1] = high
    parts = [_cumulative(density, a, b) for a, b in zip(fixed[:-1], fixed[1:], strict=True)]
    weight = np.array([total[-1] for _, total in parts])
    numbers = _shared_out(count, weight)
    lines = [
        np.interp(np.linspace(0, total[-1], n + 1)[:-1], total, x)
        for n, (x, total) in zip(numbers, parts, strict=True)
    ]
    found = np.append(np.concatenate(lines), high)
    starts = np.concatenate([[0], np.cumsum(numbers)])
    if np.allclose(fixed + fixed[::-1], low + high, rtol=0, atol=small) and _even(numbers):
        found = ((low + high) + (found - found[::-1])) / 2
    found[starts] = fixed
    return found


_SAMPLES = 2001


def _cumulative(
    density: Callable[[np.ndarray], np.ndarray], a: float, b: float
) -> tuple[np.ndarray, np.ndarray]:
    x = np.linspace(a, b, _SAMPLES)
    middle = density((x[1:] + x[:-1]) / 2) * (b - a) / (_SAMPLES - 1)
    return x, np.concatenate([[0.0], np.cumsum(middle)])


def _even(numbers: np.ndarray) -> bool:
    return bool((numbers == numbers[::-1]).all())


def _shared_out(count: int, weight: np.ndarray) -> np.ndarray:
    """Elements of each part: near its share, at least one, `count` in all, mirrored parts alike."""
    share = count * weight / weight.sum()
    numbers = np.maximum(1, np.floor(share + 0.5 - 1e-9 * len(weight))).astype(int)
    while numbers.sum() < count:
        coarse = share / numbers
        numbers[coarse > (1 - 1e-9) * coarse.max()] += 1
    return numbers
