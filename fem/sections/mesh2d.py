"""The cross-section of a tire as curved quadrilaterals in the meridian half plane, and its revolution.

A section without layers of its own is meshed as the product of two lines of elements: through the
wall and along it. At a clamped edge stresses are singular and a bending boundary layer ends. Sizes
that grow in proportion to the distance (h = h0 + GROWTH d) give each element the same error. The
smallest size depends on the number of elements: if there are few, the middle of the wall needs them
more.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits

SIDES = ("xi = 0", "xi = 1", "eta = 0", "eta = 1")
Position = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
_SAME = 1e-9  # of the section's size: nodes closer than this coincide
_GAUSS = 4  # points per direction at which the Jacobian is checked, besides the corners

# Largest error in % of nine frequencies (n = 0, 1, 3; three each) of the clamped torus of order 3,
# exact ring, with 8, 10, 12, 14 and 16 elements along the arc. This grading: 0.82, 0.38, 0.22,
# 0.16, 0.14; cosine down to 0.3 of the uniform size at the bead: 1.0, 0.56, 0.37, 0.28, 0.22; sizes
# from a twelfth of the wall: 12, 5.7, 3.4.
GROWTH = 1.0
SPARE = 1.3  # largest size over the uniform one
LEAST = 1.33  # smallest size: wall thicknesses over the number of elements
_SAMPLES = 2001
SIZE = Limits(least=0.05, most=1.0)  # of elements at the footprint, relative to that elsewhere
# (from, to) rad: the footprint's element size holds up to the first, the full size from the second.
# A deflection of 20 mm reaches 0.35 rad along a ring of 0.32 m and 0.6 rad along a section of 0.1
# m.
RING_NEAR = (0.15, 1.2)
ARC_NEAR = (0.2, 1.2)


def equispaced(order: int) -> np.ndarray:
    """Equispaced nodes of one edge of the reference element, (order + 1,), 0 and 1 included."""
    return np.linspace(0.0, 1.0, order + 1)


def lagrange(nodes: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Lagrange functions (k, n) of the nodes (n,) at points t (k,)."""
    values = np.empty((len(t), len(nodes)))
    for a in range(len(nodes)):
        others = np.delete(nodes, a)
        values[:, a] = np.prod((t[:, None] - others) / (nodes[a] - others), axis=1)
    return values


def lagrange_slope(nodes: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Derivatives (k, n) of the Lagrange functions of the nodes (n,) at points t (k,)."""
    slopes = np.zeros((len(t), len(nodes)))
    for a in range(len(nodes)):
        others = np.delete(nodes, a)
        for b in range(len(others)):
            rest = np.delete(others, b)
            slopes[:, a] += np.prod(t[:, None] - rest, axis=1)
        slopes[:, a] /= np.prod(nodes[a] - others)
    return slopes


def tensor(xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Products (k, n * n) of values (k, n) along xi and along eta, local (i, j) at i * n + j."""
    return (xi[:, :, None] * eta[:, None, :]).reshape(len(xi), -1)


def side_nodes(order: int) -> np.ndarray:
    """Local nodes (4, order + 1) of the sides xi = 0, xi = 1, eta = 0, eta = 1, each ascending."""
    grid = np.arange((order + 1) ** 2).reshape(order + 1, order + 1)
    return np.stack([grid[0], grid[-1], grid[:, 0], grid[:, -1]])


def grid_points(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """xi and eta (n * n,) of all nodes of an element with the given nodes (n,) on an edge."""
    xi, eta = np.meshgrid(nodes, nodes, indexing="ij")
    return xi.ravel(), eta.ravel()


@dataclass(frozen=True, kw_only=True)
class SectionMesh:
    """An undeformed section in (r, y) m: r > 0 from the axle, y along it, 0 at the centre plane.

    Every source of a section (torus, built-in tire, section file, deck) produces this mesh, from
    which alone the ring of hexahedra is made. With p = `order` of the elements, 1 to 3:

    nodes (n, 2): r, y of all nodes; each is used, no two coincide.
    cells (c, (p + 1)^2): nodes of each cell in tensor order, local (i, j) at i * (p + 1) + j, where
        xi = i / p and eta = j / p: equispaced on the reference square. d(r, y)/d(xi, eta) has a
        positive determinant; cells share whole edges or nothing.
    region (c,): index into `regions`, names of the compounds.
    Sets of edges, (k, 2) of (cell, side), side 0: xi = 0, 1: xi = 1, 2: eta = 0, 3: eta = 1:
      outer: the face away from the air, an ordered chain from the rim at the lower y to the rim at
          the higher y, each edge starting where the last one ended;
      tread: the part of `outer` that can touch the road (any order);
      inner: the face under inflation pressure, one unbroken chain between the two rims (any order);
      rim: what the wheel holds (any order). Part of outer, inner or any other boundary edges.
    plies: name -> ordered chain of cell edges, inside or on the boundary, on which cords lie; each
        edge is listed once, for one of its cells. Chains run towards higher y at their middle;
        cord angles are positive from +x (forward at the lowest point) towards the chain's end.
    position: maps (cells, xi, eta), (k,) each, to the exact (r, y) (k, 2), if there is an exact
        shape; None: the Lagrange interpolation of the nodes is the shape.

    Raises InputError for a mesh that violates a rule, with the rule, cell and position.
    """

    order: int
    nodes: np.ndarray
    cells: np.ndarray
    region: np.ndarray
    regions: tuple[str, ...]
    outer: np.ndarray
    tread: np.ndarray
    inner: np.ndarray
    rim: np.ndarray
    plies: Mapping[str, np.ndarray] = field(default_factory=dict)
    position: Position | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        check(self)

    def at(self, cells: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        """Positions (k, 2) m at reference coordinates in cells, (k,) each."""
        if self.position is not None:
            return self.position(cells, xi, eta)
        edge = equispaced(self.order)
        shape = tensor(lagrange(edge, xi), lagrange(edge, eta))
        return np.einsum("ka,kax->kx", shape, self.nodes[self.cells[cells]])

    def on_nodes(self, order: int, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (m, 2) and cells (c, (order + 1)^2) of this section with other element nodes.

        `edge` (order + 1,): nodes on an edge of the reference element, instead of equispaced ones.
        The numbering does not depend on `edge`; at the mesh's own order it is unchanged.
        """
        cells = self.cells if order == self.order else self._numbered(order)
        count = cells.max() + 1
        owner, local = _first_use(cells, count)
        xi, eta = grid_points(edge)
        return self.at(owner, xi[local], eta[local]), cells

    def of_order(self, order: int) -> SectionMesh:
        """The same section with elements of another order; raising the order keeps the shape."""
        if order == self.order:
            return self
        nodes, cells = self.on_nodes(order, equispaced(order))
        return replace(self, order=order, nodes=nodes, cells=cells)

    def moved(self, place: Callable[[np.ndarray], np.ndarray]) -> SectionMesh:
        """The same elements with every point (r, y) mapped by `place`, (k, 2) to (k, 2) m."""
        exact = self.position
        position = None if exact is None else lambda *at: place(exact(*at))
        return replace(self, nodes=place(self.nodes), position=position)

    def side(self, edges: np.ndarray) -> np.ndarray:
        """Nodes (k, order + 1) of edges (k, 2), in ascending xi or eta."""
        cell, side = edges.T
        return self.cells[cell[:, None], side_nodes(self.order)[side]]

    def chain(self, edges: np.ndarray) -> np.ndarray:
        """Nodes (k * order + 1,) along a chain of edges (k, 2); empty if it is not a chain."""
        return _joined(self.side(edges))

    def _numbered(self, order: int) -> np.ndarray:
        """Cells (c, (order + 1)^2) of another order: numbers of corners, then edges, then cells."""
        corners = self.cells[:, [0, self.order, -1 - self.order, -1]]
        used, corner = np.unique(corners, return_inverse=True)
        corner = corner.reshape(corners.shape)
        cells = np.empty((len(self.cells), (order + 1) ** 2), int)
        cells[:, [0, order, -1 - order, -1]] = corner
        ends = corner[:, [[0, 1], [2, 3], [0, 2], [1, 3]]]  # of the four sides
        edges, number = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
        number = number.reshape(-1, 4)
        inner = np.arange(order - 1)
        for side, local in enumerate(side_nodes(order)):
            turned = (ends[:, side, 0] > ends[:, side, 1])[:, None]
            step = np.where(turned, inner[::-1], inner)
            cells[:, local[1:-1]] = len(used) + number[:, side, None] * (order - 1) + step
        grid = np.arange((order + 1) ** 2).reshape(order + 1, order + 1)[1:-1, 1:-1].ravel()
        first = len(used) + len(edges) * (order - 1)
        cells[:, grid] = first + np.arange(len(cells) * len(grid)).reshape(len(cells), -1)
        return cells


def _first_use(cells: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """For each node one cell that has it, and its local number there."""
    nodes, first = np.unique(cells, return_index=True)
    if len(nodes) != count:
        raise ValueError("a number of a node is not used")
    return np.divmod(first, cells.shape[1])


def _joined(sides: np.ndarray) -> np.ndarray:
    """Nodes along a chain of edges (k, n), each starting where the last ends; empty if broken."""
    sides = sides.copy()
    if len(sides) > 1 and sides[0, -1] not in sides[1, [0, -1]]:
        sides[0] = sides[0, ::-1]
    for before, edge in zip(sides[:-1], sides[1:], strict=True):
        if edge[0] != before[-1]:
            edge[:] = edge[::-1]
        if edge[0] != before[-1]:
            return np.zeros(0, int)
    return np.append(sides[:, :-1].ravel(), sides[-1, -1])


def check(mesh: SectionMesh) -> None:
    """Raise InputError for the first rule of `SectionMesh` that is violated."""
    _arrays(mesh)
    _check_nodes(mesh)
    _jacobians(mesh)
    _one_body(mesh)
    edges = _boundary_edges(mesh)
    for name in ("outer", "tread", "inner", "rim"):
        _on_boundary(mesh, name, edges)
    _outer(mesh)
    _inner(mesh)
    _plies(mesh, edges)


def _arrays(mesh: SectionMesh) -> None:
    if mesh.order not in (1, 2, 3):
        raise InputError(f"section: elements of order {mesh.order}; 1, 2 and 3 are available")
    shapes = {
        "nodes": mesh.nodes.ndim == 2 and mesh.nodes.shape[1] == 2,
        "cells": mesh.cells.ndim == 2 and mesh.cells.shape[1] == (mesh.order + 1) ** 2,
        "region": mesh.region.shape == mesh.cells.shape[:1],
    }
    for name, right in shapes.items():
        if not right:
            raise InputError(f"section: {name} has shape {getattr(mesh, name).shape}")
    if not len(mesh.cells):
        raise InputError("section: no element in it")
    if not np.isfinite(mesh.nodes).all():
        raise InputError("section: a coordinate is not a number")
    if not ((mesh.region >= 0) & (mesh.region < len(mesh.regions))).all():
        raise InputError("section: an element has no region")


def _place(point: np.ndarray) -> str:
    return f"r = {point[0]:.5g} m, y = {point[1]:.5g} m"


def _check_nodes(mesh: SectionMesh) -> None:
    if mesh.nodes[:, 0].min() <= 0:
        worst = mesh.nodes[mesh.nodes[:, 0].argmin()]
        raise InputError(
            f"section: a node at {_place(worst)}: the axle is r = 0, all lies above it"
        )
    unused = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.cells)
    if len(unused):
        raise InputError(
            f"section: node {unused[0]} at {_place(mesh.nodes[unused[0]])} has no element"
        )
    from scipy.spatial import cKDTree  # late, here and below: the help of the program stays light

    pairs = cKDTree(mesh.nodes).query_pairs(_SAME * np.ptp(mesh.nodes, axis=0).max())
    if pairs:
        a, b = min(pairs)
        raise InputError(
            f"section: nodes {a} and {b} are both at {_place(mesh.nodes[a])}: two bodies, or elements "
            "that should share a node"
        )


def _jacobians(mesh: SectionMesh) -> None:
    """Positive at Gauss points and at the corners of every element."""
    edge = equispaced(mesh.order)
    t = np.polynomial.legendre.leggauss(_GAUSS)[0] / 2 + 0.5
    xi, eta = grid_points(np.concatenate([[0.0], t, [1.0]]))
    value = [lagrange(edge, x) for x in (xi, eta)]
    slope = [lagrange_slope(edge, x) for x in (xi, eta)]
    points = mesh.nodes[mesh.cells]
    along_xi = np.einsum("ka,cax->ckx", tensor(slope[0], value[1]), points)
    along_eta = np.einsum("ka,cax->ckx", tensor(value[0], slope[1]), points)
    area = along_xi[..., 0] * along_eta[..., 1] - along_xi[..., 1] * along_eta[..., 0]
    low, high = area.min(axis=1), area.max(axis=1)
    bad = np.flatnonzero(~(low > 1e-6 * np.abs(area).max(axis=1)))
    if len(bad):
        middle = points[bad[0]].mean(axis=0)
        what = "is inside out" if high[bad[0]] <= 0 else "is folded or has no angle at a corner"
        raise InputError(
            f"section: element {bad[0]} at {_place(middle)} {what} ({len(bad)} of {len(mesh.cells)})"
        )


def _one_body(mesh: SectionMesh) -> None:
    count = mesh.cells.shape[1]
    rows = np.repeat(np.arange(len(mesh.cells)), count)
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    table = coo_matrix((np.ones(rows.size), (rows, mesh.cells.ravel()))).tocsr()
    bodies, which = connected_components(table @ table.T, directed=False)
    if bodies > 1:
        apart = mesh.nodes[mesh.cells[np.flatnonzero(which == 1)[0]]].mean(axis=0)
        raise InputError(
            f"section: {bodies} bodies that share no node; one lies at {_place(apart)}"
        )


def _boundary_edges(mesh: SectionMesh) -> np.ndarray:
    """Number of cells that share each side of each cell, (c, 4)."""
    sides = np.sort(mesh.cells[:, side_nodes(mesh.order)], axis=2)
    _, inverse, count = np.unique(
        sides.reshape(-1, mesh.order + 1), axis=0, return_inverse=True, return_counts=True
    )
    count = count[inverse.ravel()].reshape(-1, 4)
    if count.max() > 2:
        cell = np.argwhere(count > 2)[0][0]
        raise InputError(f"section: an edge of element {cell} belongs to more than two elements")
    return count


def _in_range(mesh: SectionMesh, name: str, edges: np.ndarray) -> None:
    if edges.ndim != 2 or edges.shape[1] != 2:
        raise InputError(f"section: {name} has shape {edges.shape}, not (edges, 2)")
    cell, side = edges.T
    if not ((cell >= 0) & (cell < len(mesh.cells)) & (side >= 0) & (side < 4)).all():
        raise InputError(f"section: {name} names an edge of no element")


def _on_boundary(mesh: SectionMesh, name: str, count: np.ndarray) -> None:
    edges = getattr(mesh, name)
    _in_range(mesh, name, edges)
    if not len(edges):
        raise InputError(f"section: no edge is {name}")
    inside = count[edges[:, 0], edges[:, 1]] > 1
    if inside.any():
        middle = mesh.nodes[mesh.side(edges[inside][:1])[0]].mean(axis=0)
        raise InputError(f"section: {name} has an edge inside the body, at {_place(middle)}")


def _outer(mesh: SectionMesh) -> None:
    chain = mesh.chain(mesh.outer)
    if not len(chain):
        raise InputError("section: the outer face is not one chain in order, bead to bead")
    if mesh.nodes[chain[0], 1] >= mesh.nodes[chain[-1], 1]:
        raise InputError("section: the outer face runs from the higher y to the lower")
    keys = {tuple(edge) for edge in mesh.outer.tolist()}
    for edge in mesh.tread.tolist():
        if tuple(edge) not in keys:
            middle = mesh.nodes[mesh.side(np.array([edge]))[0]].mean(axis=0)
            raise InputError(f"section: the tread at {_place(middle)} is not of the outer face")


def _inner(mesh: SectionMesh) -> None:
    """The inner face is one path whose two ends lie on the rim or at the ends of the outer face."""
    ends = mesh.side(mesh.inner)[:, [0, -1]]
    nodes, uses = np.unique(ends, return_counts=True)
    loose = nodes[uses == 1]
    if len(loose) != 2 or uses.max() > 2:
        where = "; ".join(_place(mesh.nodes[n]) for n in loose[:4])
        raise InputError(
            f"section: the inner face is not one unbroken line, it ends {len(loose)} times: {where}"
        )
    held = np.union1d(mesh.side(mesh.rim), mesh.chain(mesh.outer)[[0, -1]])
    for node in loose:
        if node not in held:
            raise InputError(f"section: the inner face is open at {_place(mesh.nodes[node])}")


def _plies(mesh: SectionMesh, count: np.ndarray) -> None:
    for name, edges in mesh.plies.items():
        _in_range(mesh, f"ply {name!r}", edges)
        if not len(edges):
            raise InputError(f"section: ply {name!r} has no edge")
        chain = mesh.chain(edges)
        if not len(chain):
            raise InputError(f"section: ply {name!r} is not one chain of element edges in order")
        if len(np.unique(chain)) != len(chain):
            raise InputError(f"section: ply {name!r} meets itself")


def graded_size(distance: np.ndarray, length: float, count: int, floor: float) -> np.ndarray:
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


def product_mesh(
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
    owner, local = _first_use(cells, cells.max() + 1)
    xi, eta = grid_points(equispaced(order))
    k, j = (part.ravel() for part in np.meshgrid(range(layers), range(along), indexing="ij"))
    depth, angle = (wall[k] + wall[k + 1]) / 2, (arc[j] + arc[j + 1]) / 2
    across, length = np.arange(layers), np.arange(along)
    return SectionMesh(
        order=order,
        nodes=position(owner, xi[local], eta[local]),
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


def element_corners(
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
    corners = np.append(np.concatenate(lines), high)
    starts = np.concatenate([[0], np.cumsum(numbers)])
    if np.allclose(fixed + fixed[::-1], low + high, rtol=0, atol=small) and _even(numbers):
        corners = ((low + high) + (corners - corners[::-1])) / 2
    corners[starts] = fixed
    return corners


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


def near_road(distance: np.ndarray, footprint_size: float, near: tuple[float, float]) -> np.ndarray:
    """Relative element size at a distance (rad) from the lowest point, linear within `near`."""
    part = np.clip((distance - near[0]) / (near[1] - near[0]), 0.0, 1.0)
    return footprint_size + (1 - footprint_size) * part


def ring_corners(segments: int, footprint_size: float) -> np.ndarray:
    """Angles of the element corners, rad, from the lowest point (0) towards +x to 2 pi."""

    def density(angle: np.ndarray) -> np.ndarray:
        return 1 / near_road(np.pi - np.abs(angle - np.pi), footprint_size, RING_NEAR)

    return element_corners(segments, density, 0.0, 2 * np.pi)


@dataclass(frozen=True, kw_only=True)
class Ring:
    """The section revolved about the axle (y), `segments` elements of its order around.

    `ring_corners` (segments + 1,) rad: angles of the element corners, ascending from 0, the lowest
    point, towards +x to 2 pi, or less for a sector. `arc_corners` (k + 1,) rad: ascending section
    angles of the ends of the k outer-face edges, 0 at the crown, positive for y > 0. `thickness` m
    of a typical wall and `height` m of the section: scales of motions. `coarser`: the same tire
    with elements of about twice the size, None if there is none.
    """

    section: SectionMesh
    ring_corners: np.ndarray
    arc_corners: np.ndarray
    thickness: float
    height: float
    coarser: Callable[[], Ring | None] = lambda: None

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the mesh: nodes, cells, regions, faces, lines of cords and angles around."""
        mesh, digest = self.section, hashlib.sha256()
        faces = (mesh.outer, mesh.tread, mesh.inner, mesh.rim)
        lines = [line for _, line in sorted(mesh.plies.items())]
        for array in (mesh.nodes, mesh.cells, mesh.region, *faces, *lines, self.ring_corners):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(repr((mesh.order, mesh.regions, sorted(mesh.plies))).encode())
        return digest.hexdigest()

    @property
    def segments(self) -> int:
        """Number of elements around."""
        return len(self.ring_corners) - 1

    @property
    def order(self) -> int:
        """Element order."""
        return self.section.order

    @property
    def closed(self) -> bool:
        """Whether the ring is complete and not a sector."""
        return bool(self.ring_corners[-1] - self.ring_corners[0] > 2 * np.pi * (1 - 1e-9))

    @property
    def elements(self) -> int:
        """Number of hexahedra."""
        return self.segments * len(self.section.cells)

    @cached_property
    def faces(self) -> int:
        """Number of element faces on the outer face."""
        return self.segments * len(self.section.outer)

    def outer_line(self, element: np.ndarray, t: np.ndarray) -> np.ndarray:
        """(r, y) (k, 2) m on outer edges (k,) of the chain at t (k,), 0 to 1 from bead to bead."""
        cell, side = self.section.outer[element].T
        t = np.where(self._turned[element], 1 - t, t)
        fixed = np.where(side % 2 == 1, 1.0, 0.0)
        xi, eta = np.where(side < 2, fixed, t), np.where(side < 2, t, fixed)
        return self.section.at(cell, xi, eta)

    @cached_property
    def _turned(self) -> np.ndarray:
        """Whether each edge of the outer chain runs against its cell's coordinate."""
        start = self.section.chain(self.section.outer)[:: self.order][:-1]
        return self.section.side(self.section.outer)[:, 0] != start


def revolved(
    section: SectionMesh,
    segments: int,
    footprint_size: float,
    coarser: Callable[[], Ring | None],
) -> Ring:
    """Any section revolved into `segments` elements, with the scales derived from its mesh."""
    return Ring(
        section=section,
        ring_corners=ring_corners(segments, footprint_size),
        arc_corners=section_angles(section),
        thickness=wall_thickness(section),
        height=float(np.ptp(section.nodes[:, 0])),
        coarser=coarser,
    )


def section_angles(section: SectionMesh) -> np.ndarray:
    """Section angles (rad) of the outer face's corners, ascending, 0 at the crown.

    Angles about the point of the centre plane halfway between the crown and the beads. If they do
    not increase monotonically, the same range is distributed by length along the face.
    """
    line = section.nodes[section.chain(section.outer)]
    corners = line[:: section.order]
    centre = (line[:, 0].max() + line[[0, -1], 0].mean()) / 2
    angle = np.unwrap(np.arctan2(line[:, 1], line[:, 0] - centre))
    if (np.diff(angle) > 0).all():
        return angle[:: section.order]
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1)))
    crown = np.interp(0.0, corners[:, 1], length) if (np.diff(corners[:, 1]) > 0).all() else None
    middle = length[-1] / 2 if crown is None else crown
    return (length - middle) / length[-1] * (angle[-1] - angle[0])


def crown_layer(section: SectionMesh) -> tuple[int, float]:
    """Number of the region that is the outer face at the crown, and how thick (m) it is there: area over width."""
    cell = section.outer[len(section.outer) // 2, 0]
    middle = section.nodes[section.cells].mean(axis=1)
    low, high = np.sort(section.nodes[section.cells[cell], 1])[[0, -1]]
    own = section.region == section.region[cell]
    under = own & (middle[:, 1] > low) & (middle[:, 1] < high)
    return int(section.region[cell]), float(cell_areas(section)[under].sum() / (high - low))


def cell_areas(section: SectionMesh) -> np.ndarray:
    """Area (m2) of each cell between its corners."""
    corners = section.nodes[section.cells[:, [0, section.order, -1, -1 - section.order]]]
    x, y = corners[..., 0], corners[..., 1]
    return 0.5 * np.abs((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1))


def wall_thickness(section: SectionMesh) -> float:
    """Area over mean length of inner and outer face, m."""
    lengths = [
        np.linalg.norm(np.diff(section.nodes[section.side(face)], axis=1), axis=2).sum()
        for face in (section.inner, section.outer)
    ]
    return float(2 * cell_areas(section).sum() / sum(lengths))
