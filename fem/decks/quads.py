"""A section as nine-node quadrilaterals: conversion of triangles, its faces, its mirror image.

Local node (i, j) of a cell is at 3 i + j, at xi = i/2, eta = j/2; sides 0 to 3 are xi = 0, xi = 1,
eta = 0, eta = 1, as in tireroad.fem.sections. Every side carries the number of the deck's edge it
is part of, so that sets of the deck remain valid after cells are split.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.decks.deck import SCOPE, CardBlock, Deck
from tireroad.fem.errors import InputError

SIDE_NODES = np.array([[0, 1, 2], [6, 7, 8], [0, 3, 6], [2, 5, 8]])
SIDE_OF_FACE = np.array([2, 1, 3, 0])  # faces S1 to S4 of a quadrilateral
TENSOR = np.array([0, 7, 3, 4, 8, 6, 1, 5, 2])  # corners 0-3, middles 4-7, centre 8 in tensor order
_MOST = 50_000  # elements of a section
_BASE = 0.15  # of the inner face's length: a longer gap between it and the rim is an error
_CLOSE = 1e-4  # of the section's size: tolerance for nodes on the centre plane


@dataclass(frozen=True, kw_only=True)
class Quads:
    """points (n, 2) r, y; cells (c, 9); region (c,); element (c,): the deck's label; origin (c, 4):
    number of the deck's edge or cord line on which a side lies, -1 for sides created inside an
    element.
    """

    points: np.ndarray
    cells: np.ndarray
    region: np.ndarray
    element: np.ndarray
    origin: np.ndarray

    @property
    def corners(self) -> np.ndarray:
        """Corner nodes (c, 4) in the order (0, 0), (0, 1), (1, 0), (1, 1)."""
        return self.cells[:, [0, 2, 6, 8]]

    def sides(self) -> np.ndarray:
        """Nodes (c, 4, 3) of all sides, in ascending xi or eta."""
        return self.cells[:, SIDE_NODES]

    def sides_of(self, cell: int) -> np.ndarray:
        """Nodes (4, 3) of the sides of one cell."""
        return self.cells[cell][SIDE_NODES]

    def boundary(self) -> np.ndarray:
        """Boundary sides (k, 2) of (cell, side): those with one cell only."""
        middle = self.sides()[:, :, 1]
        count = np.bincount(middle.ravel(), minlength=len(self.points))
        return np.argwhere(count[middle] == 1)


@dataclass(frozen=True)
class Raw:
    """Triangles or quadrilaterals of a deck: corners, and middles (rows of points, -1: none)."""

    labels: np.ndarray
    corners: np.ndarray
    middles: np.ndarray
    region: np.ndarray


def shape(t: np.ndarray) -> np.ndarray:
    """Quadratic functions (k, 3) of the nodes 0, 1/2 and 1 at t (k,)."""
    t = np.asarray(t, float)
    return np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)], axis=-1)


def place(nine: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Points (..., k, 2) at reference coordinates (k,) of cells of nine points (..., 9, 2)."""
    both = (shape(xi)[:, :, None] * shape(eta)[:, None, :]).reshape(-1, 9)
    return np.einsum("ka,...ax->...kx", both, nine)


def nine_points(nodes: np.ndarray, raw: Raw, edge: np.ndarray, middles: np.ndarray) -> np.ndarray:
    """Nine points (c, 9, 2) of quadrilaterals; a missing centre follows from the others."""
    corner, middle = nodes[raw.corners], middles[edge]
    centre = middle.sum(axis=1) / 2 - corner.sum(axis=1) / 4
    return np.concatenate([corner, middle, centre[:, None]], axis=1)[:, TENSOR]


def split(nodes: np.ndarray, raws: dict, edges: tuple, middles: np.ndarray) -> Quads:
    """Split triangles into three cells, quadrilaterals into four, so that whole sides meet.

    Points are identified by (0, node, 0), (1, edge, quarter from its lower end) or (2, element,
    position in it).
    """
    parts = [
        _thirds(nodes, raws[3], edges[0], middles),
        _quarters(nodes, raws[4], edges[1], middles, len(raws[3].labels)),
    ]
    points, origin, keys = (np.concatenate(part) for part in zip(*parts, strict=True))
    _, first, cells = np.unique(keys.reshape(-1, 3), axis=0, return_index=True, return_inverse=True)
    return Quads(
        points=points.reshape(-1, 2)[first],
        cells=cells.reshape(-1, 9),
        region=np.concatenate([np.repeat(raws[n].region, n) for n in (3, 4)]),
        element=np.concatenate([np.repeat(raws[n].labels, n) for n in (3, 4)]),
        origin=origin,
    )


def _on_edge(edge: np.ndarray, quarter: int, forward: np.ndarray) -> np.ndarray:
    """Identifiers (c, 3) of points on edges, `quarter` being counted in the element's direction."""
    return np.column_stack([np.full_like(edge, 1), edge, np.where(forward, quarter, 4 - quarter)])


def _named(sort: int, number: np.ndarray, place_in: int = 0) -> np.ndarray:
    return np.column_stack([np.full_like(number, sort), number, np.full_like(number, place_in)])


def _quarters(
    nodes: np.ndarray, raw: Raw, edge: np.ndarray, middles: np.ndarray, first: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """points (4 c, 9, 2), origin (4 c, 4), identifiers (4 c, 9, 3) of quadrilaterals' quarters."""
    grid = np.linspace(0, 1, 5)
    xi, eta = (part.ravel() for part in np.meshgrid(grid, grid, indexing="ij"))
    points = place(nine_points(nodes, raw, edge, middles), xi, eta).reshape(-1, 5, 5, 2)
    names = np.empty((len(edge), 5, 5, 3), np.int64)
    number = first + np.arange(len(edge))
    for i in range(5):
        for j in range(5):
            names[:, i, j] = _named(2, number, 5 * i + j)
    forward = raw.corners < np.roll(raw.corners, -1, axis=1)
    for k in (1, 2, 3):
        names[:, k, 0] = _on_edge(edge[:, 0], k, forward[:, 0])
        names[:, 4, k] = _on_edge(edge[:, 1], k, forward[:, 1])
        names[:, 4 - k, 4] = _on_edge(edge[:, 2], k, forward[:, 2])
        names[:, 0, 4 - k] = _on_edge(edge[:, 3], k, forward[:, 3])
    for corner, (i, j) in enumerate([(0, 0), (4, 0), (4, 4), (0, 4)]):
        names[:, i, j] = _named(0, raw.corners[:, corner])
    origin = np.full((len(edge), 2, 2, 4), -1)
    origin[:, 0, :, 0], origin[:, 1, :, 1] = edge[:, [3]], edge[:, [1]]
    origin[:, :, 0, 2], origin[:, :, 1, 3] = edge[:, [0]], edge[:, [2]]
    windows = [(slice(2 * a, 2 * a + 3), slice(2 * b, 2 * b + 3)) for a in (0, 1) for b in (0, 1)]
    points = np.stack([points[:, i, j].reshape(-1, 9, 2) for i, j in windows], axis=1)
    names = np.stack([names[:, i, j].reshape(-1, 9, 3) for i, j in windows], axis=1)
    return points.reshape(-1, 9, 2), origin.reshape(-1, 4), names.reshape(-1, 9, 3)


def _thirds(
    nodes: np.ndarray, raw: Raw, edge: np.ndarray, middles: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """points (3 c, 9, 2), origin (3 c, 4), identifiers (3 c, 9, 3) of thirds of triangles."""
    six = np.concatenate([nodes[raw.corners], middles[edge]], axis=1)
    forward = raw.corners < np.roll(raw.corners, -1, axis=1)
    number = np.arange(len(edge))
    points, names, origin = [], [], []
    for k in range(3):
        before = (k - 1) % 3
        corner = [_third_middle(k, k), _edge_middle(k), np.full(3, 1 / 3), _edge_middle(before)]
        between = [(corner[i] + corner[(i + 1) % 4]) / 2 for i in range(4)]
        places = np.array([*corner, *between, np.mean(corner, axis=0)])[TENSOR]
        points.append(np.einsum("ka,cax->ckx", _six(places), six))
        named = [
            _named(0, raw.corners[:, k]),
            _on_edge(edge[:, k], 2, forward[:, k]),
            _named(2, number, 0),
            _on_edge(edge[:, before], 2, forward[:, before]),
            _on_edge(edge[:, k], 1, forward[:, k]),
            _named(2, number, 1 + k),
            _named(2, number, 1 + before),
            _on_edge(edge[:, before], 3, forward[:, before]),
            _named(2, number, 4 + k),
        ]
        names.append(np.stack(named, axis=1)[:, TENSOR])
        sides = np.full((len(edge), 4), -1)
        sides[:, SIDE_OF_FACE[0]], sides[:, SIDE_OF_FACE[3]] = edge[:, k], edge[:, before]
        origin.append(sides)

    def flat(part: list[np.ndarray]) -> np.ndarray:
        stacked = np.stack(part, axis=1)
        return stacked.reshape(-1, *stacked.shape[2:])

    return flat(points), flat(origin), flat(names)


def _third_middle(a: int, b: int) -> np.ndarray:
    """Area coordinates of the midpoint between corners a and b of a triangle."""
    return (np.eye(3)[a] + np.eye(3)[b]) / 2


def _edge_middle(k: int) -> np.ndarray:
    return _third_middle(k, (k + 1) % 3)


def _six(area: np.ndarray) -> np.ndarray:
    """Quadratic functions (k, 6) of a triangle at area coordinates (k, 3); edges 12, 23, 31."""
    corner = area * (2 * area - 1)
    edge = 4 * area * np.roll(area, -1, axis=1)
    return np.concatenate([corner, edge], axis=1)


@dataclass(frozen=True)
class DeckEdges:
    """The deck's edges: end nodes (e, 2) as rows of the deck's points, ascending; for each element
    label the numbers of its faces' edges (n, 4), -1 for the missing one of a triangle.
    """

    ends: np.ndarray
    labels: np.ndarray
    faces: np.ndarray

    def between(self, nodes: np.ndarray) -> np.ndarray:
        """Numbers of the edges both of whose ends are among the given rows of points."""
        return np.flatnonzero(np.isin(self.ends, nodes).all(axis=1))

    def numbers(self, pairs: np.ndarray) -> np.ndarray:
        """Numbers (k,) of edges by their end nodes (k, 2); -1 if there is none."""
        size = max(self.ends.max(initial=0), pairs.max(initial=0)) + 1
        keys = self.ends[:, 0] * size + self.ends[:, 1]
        low = np.sort(pairs, axis=1)
        numbers = low[:, 0] * size + low[:, 1]
        at = np.minimum(np.searchsorted(keys, numbers), len(keys) - 1)
        return np.where(keys[at] == numbers, at, -1)


def build(deck: Deck, region_of: dict[int, int]) -> tuple[Quads, DeckEdges, bool]:
    """The cells of a two-dimensional deck's solids, its edges, and whether elements were split.

    `region_of`: compound number of each element label. Raises InputError, with file and line, for
    elements that are inside out.
    """
    blocks = [b for b in deck.blocks if b.kind.role == "solid" and b.kind.dimension == 2]
    if sum(len(b.labels) for b in blocks) > _MOST:
        raise blocks[0].place.error(f"more than {_MOST} elements in one section: use a coarser one")
    raws = {n: _raw(deck, [b for b in blocks if b.kind.corners == n], n, region_of) for n in (3, 4)}
    for block in blocks:
        _positive(deck, block)
    pairs = [_pairs(raw) for raw in raws.values()]
    ends, inverse = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    edge3 = inverse[: len(pairs[0])].reshape(-1, 3)
    edge4 = inverse[len(pairs[0]) :].reshape(-1, 4)
    middles = _middles(deck, ends, ((edge3, raws[3]), (edge4, raws[4])), blocks)
    faces = np.concatenate([np.pad(edge3, ((0, 0), (0, 1)), constant_values=-1), edge4])
    edges = DeckEdges(ends, np.concatenate([raws[3].labels, raws[4].labels]), faces)
    nodes = deck.points[:, :2]
    if not len(raws[3].labels):
        return _whole(nodes, raws[4], edge4, middles), edges, False
    return split(nodes, raws, (edge3, edge4), middles), edges, True


def _raw(deck: Deck, blocks: list[CardBlock], corners: int, region_of: dict[int, int]) -> Raw:
    labels, ends, middles = [np.empty(0, np.int64)], [], []
    for block in blocks:
        rows = deck.rows(block.nodes, block.place)
        labels.append(block.labels)
        ends.append(rows[:, :corners])
        none = np.full((len(rows), corners), -1)
        middles.append(rows[:, corners:] if block.kind.nodes > corners else none)
    every, empty = np.concatenate(labels), np.empty((0, corners), np.int64)
    return Raw(
        every,
        np.concatenate([empty, *ends]),
        np.concatenate([empty, *middles]),
        np.array([region_of[label] for label in every.tolist()], np.int64),
    )


def _positive(deck: Deck, block: CardBlock) -> None:
    """Check that corners run counter-clockwise in (r, z) with angles below 180 degrees."""
    count = block.kind.corners
    corners = deck.points[deck.rows(block.nodes[:, :count], block.place)][:, :, :2]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    turn = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
    size = np.abs(turn).max(axis=1, initial=0.0)
    wrong = np.flatnonzero(~(turn.min(axis=1, initial=np.inf) > 1e-9 * size))
    if not len(wrong):
        return
    label, inverted = block.labels[wrong[0]] % SCOPE, turn[wrong[0]].max() <= 0
    r, z = corners[wrong[0]].mean(axis=0)
    what = "has a negative volume (its nodes run clockwise)" if inverted else "is folded or flat"
    hint = " All do: are the columns z, r?" if inverted and len(wrong) == len(block.labels) else ""
    raise block.place.error(
        f"element {label} at r = {r:.5g}, z = {z:.5g} {what}; {len(wrong)} of this block.{hint}"
    )


def _pairs(raw: Raw) -> np.ndarray:
    """End nodes (elements * corners, 2) of all edges, each ascending."""
    return np.sort(
        np.stack([raw.corners, np.roll(raw.corners, -1, axis=1)], axis=2), axis=2
    ).reshape(-1, 2)


def _middles(
    deck: Deck, ends: np.ndarray, parts: Sequence[tuple[np.ndarray, Raw]], blocks: list[CardBlock]
) -> np.ndarray:
    """The middle of each edge: the deck's node if there is one, else halfway between its ends."""
    nodes = deck.points[:, :2]
    middles = nodes[ends].mean(axis=1)
    node = np.full(len(ends), -1)
    for edge, raw in parts:
        has_middle = raw.middles >= 0
        node[edge[has_middle]] = raw.middles[has_middle]
        other = has_middle & (node[edge] != raw.middles)
        if other.any():
            label = raw.labels[other.any(axis=1)][0] % SCOPE
            raise blocks[0].place.error(
                f"element {label} shares two corners with a neighbour and not the node between them"
            )
    middles[node >= 0] = nodes[node[node >= 0]]
    return middles


def _whole(nodes: np.ndarray, raw: Raw, edge: np.ndarray, middles: np.ndarray) -> Quads:
    used, corner = np.unique(raw.corners, return_inverse=True)
    corner = corner.reshape(raw.corners.shape)
    first, count = len(used), len(raw.labels)
    centre = first + len(middles) + np.arange(count)
    cells = np.column_stack([corner, first + edge, centre])[:, TENSOR]
    points = np.concatenate([nodes[used], middles, nine_points(nodes, raw, edge, middles)[:, 4]])
    origin = np.empty((count, 4), np.int64)
    origin[:, SIDE_OF_FACE] = edge
    return Quads(points=points, cells=cells, region=raw.region, element=raw.labels, origin=origin)


def once(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """Sides (k, 2), with those shared by two cells listed once."""
    middle = quads.sides()[edges[:, 0], edges[:, 1], 1]
    _, first = np.unique(middle, return_index=True)
    return edges[np.sort(first)]


def with_origin(quads: Quads, numbers: np.ndarray) -> np.ndarray:
    """Sides (k, 2) on the given edges of the deck, each listed once."""
    return once(quads, np.argwhere(np.isin(quads.origin, numbers) & (quads.origin >= 0)))


def ends(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """End nodes (k, 2) of sides."""
    return quads.sides()[edges[:, 0], edges[:, 1]][:, [0, 2]]


def strings(pairs: np.ndarray) -> tuple[list[np.ndarray], list[int]]:
    """Line elements (k, 2) in order: indices of each chain, and nodes where three or more meet.

    A closed line is one chain. Chains end at branches.
    """
    at = defaultdict(list)
    for number, pair in enumerate(pairs.tolist()):
        for node in pair:
            at[node].append(number)
    left = set(range(len(pairs)))
    strings = []
    for start in sorted(node for node, there in at.items() if len(there) != 2) + sorted(at):
        for number in at[start]:
            if number in left:
                strings.append(np.array(_follow(start, number, pairs, at, left)))
    return strings, [node for node, there in at.items() if len(there) > 2]


def _follow(node: int, number: int, pairs: np.ndarray, at: dict, left: set) -> list[int]:
    path = []
    while True:
        path.append(number)
        left.discard(number)
        a, b = pairs[number]
        node = b if node == a else a
        onward = [n for n in at[node] if n in left]
        if len(at[node]) != 2 or not onward:
            return path
        number = onward[0]


def along(pairs: np.ndarray) -> np.ndarray:
    """Nodes (k + 1,) along an ordered chain of line elements (k, 2)."""
    if len(pairs) == 1:
        return pairs[0]
    first = pairs[0, ::-1] if pairs[0, 0] in pairs[1] and pairs[0, 1] not in pairs[1] else pairs[0]
    nodes = list(first)
    for pair in pairs[1:]:
        nodes.append(pair[1] if pair[0] == nodes[-1] else pair[0])
    return np.array(nodes)


def forward(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """An ordered chain, running towards higher y at its middle (higher r where level)."""
    nodes = along(ends(quads, edges))
    middle = (len(nodes) - 1) // 2
    step = quads.points[nodes[middle + 1]] - quads.points[nodes[middle]]
    level = abs(step[1]) < 1e-9 * abs(step[0])
    return edges[::-1] if (step[0] if level else step[1]) < 0 else edges


@dataclass(frozen=True)
class Faces:
    """Sides (k, 2) of (cell, side); `outer` from lower to higher y. `notes`: guesses made."""

    outer: np.ndarray
    tread: np.ndarray
    inner: np.ndarray
    rim: np.ndarray
    notes: tuple[str, ...]


def faces(
    quads: Quads, rim: np.ndarray, inner: np.ndarray | None, tread: np.ndarray | None
) -> Faces:
    """The faces from the sides that the deck names; unnamed inner face and tread from the outline.

    Without the rim the outline consists of two or more lines: the outer face reaches farthest from
    the axle, the inner face farthest of the rest. Raises InputError if there are too few.
    """
    outline = quads.boundary()
    notes = []
    held = rim if inner is None else np.concatenate([rim, inner])
    lines = _lines(quads, _without(quads, outline, held))
    if len(lines) < (2 if inner is None else 1):
        raise InputError(
            "the rim does not part the outline of the section into an inner and an outer face: it must be "
            "held at both beads (tire.rim; a half section needs mirror = true), or tire.inner must be named"
        )
    outer = lines[0]
    if inner is None:
        inner = lines[1]
        notes.append(
            f"inner face: guessed, the {len(inner)} sides between the rims that look at the axle"
        )
    else:
        inner, more = _closed(quads, inner, rim, lines[1:])
        if more:
            notes.append(
                f"inner face: goes on along {more} sides of the bead's base to the rim, which the file leaves without pressure"
            )
    if tread is None:
        tread = outer
        notes.append(f"tread: not named, the whole outer face of {len(outer)} sides")
    order = along(ends(quads, outer))
    if quads.points[order[0], 1] > quads.points[order[-1], 1]:
        outer = outer[::-1]
    return Faces(outer, tread, inner, rim, tuple(notes))


def _closed(
    quads: Quads, inner: np.ndarray, rim: np.ndarray, lines: list[np.ndarray]
) -> tuple[np.ndarray, int]:
    """The inner face with short lines of the outline that join its ends to the rim, and their number of sides.

    A wheel that holds a bead by its flange alone leaves the base of the bead free; the air's boundary
    has to end on what is held.
    """
    faces, uses = np.unique(ends(quads, inner), return_counts=True)
    loose = np.setdiff1d(faces[uses == 1], ends(quads, rim))
    whole = _length(quads, inner)
    line_found = [inner]
    for line in lines:
        nodes, uses = np.unique(ends(quads, line), return_counts=True)
        tips = nodes[uses == 1]
        joins = (
            len(tips) == 2 and np.isin(tips, loose).any() and np.isin(tips, ends(quads, rim)).any()
        )
        if joins and _length(quads, line) <= _BASE * whole:
            line_found.append(line)
    return np.concatenate(line_found), sum(len(line) for line in line_found[1:])


def _length(quads: Quads, sides: np.ndarray) -> float:
    a, b = quads.points[ends(quads, sides)].transpose(1, 0, 2)
    return float(np.linalg.norm(b - a, axis=1).sum())


def _lines(quads: Quads, sides: np.ndarray) -> list[np.ndarray]:
    """Unbroken lines of an outline's sides, the one that reaches farthest from the axle first."""
    lines, _ = strings(ends(quads, sides)) if len(sides) else ([], [])
    reach = [-quads.points[ends(quads, sides[line]).ravel(), 0].max() for line in lines]
    return [sides[lines[n]] for n in np.argsort(reach, kind="stable")]


def _without(quads: Quads, sides: np.ndarray, others: np.ndarray) -> np.ndarray:
    middle = quads.sides()[:, :, 1]
    gone = middle[others[:, 0], others[:, 1]]
    return sides[~np.isin(middle[sides[:, 0], sides[:, 1]], gone)]


def on_outline(quads: Quads, sides: np.ndarray) -> np.ndarray:
    """The given sides that are on the boundary."""
    middle = quads.sides()[:, :, 1]
    outline = quads.boundary()
    there = middle[outline[:, 0], outline[:, 1]]
    return once(quads, sides[np.isin(middle[sides[:, 0], sides[:, 1]], there)])


def one_body(quads: Quads, name: Callable[[int], str]) -> None:
    """Raise InputError unless all cells are connected by nodes; `name` formats an element label."""
    pairs = ends(quads, np.argwhere(np.ones((len(quads.cells), 4), bool)))
    group = np.arange(len(quads.points))
    while True:
        low = np.minimum(group[pairs[:, 0]], group[pairs[:, 1]])
        new = group.copy()
        np.minimum.at(new, pairs.ravel(), np.repeat(low, 2))
        new = new[new]
        if (new == group).all():
            break
        group = new
    bodies, first = np.unique(group[quads.cells[:, 0]], return_index=True)
    if len(bodies) > 1:
        a, b = (name(quads.element[cell]) for cell in first[:2])
        raise InputError(
            f"{len(bodies)} bodies that share no nodes, one with {a} and one with {b}: the section must be "
            "one; merge the nodes at their border, or raise tire.merge"
        )


def on_centre(quads: Quads) -> np.ndarray:
    """Mask of the points that lie on the plane z = 0."""
    return np.abs(quads.points[:, 1]) < _CLOSE * np.ptp(quads.points, axis=0).max()


def is_half(quads: Quads) -> bool:
    """Whether the section lies on one side of z = 0 and has sides of its outline on it."""
    centre = on_centre(quads)
    y = quads.points[~centre, 1]
    sides = quads.sides()[tuple(quads.boundary().T)]
    return bool(len(y) and (y.min() > 0 or y.max() < 0) and centre[sides].all(axis=1).any())


def mirrored(quads: Quads) -> Quads:
    """Both halves, sharing nodes on the centre plane. InputError if it is not a half section."""
    if not is_half(quads):
        low, high = quads.points[:, 1].min(), quads.points[:, 1].max()
        raise InputError(
            f"mirror = true is for a half section that ends on z = 0; this one goes from z = {low:.5g} to "
            f"{high:.5g}"
        )
    centre = on_centre(quads)
    points = quads.points.copy()
    points[centre, 1] = 0.0
    image = np.arange(len(points))
    image[~centre] = len(points) + np.arange((~centre).sum())
    turned = np.arange(9).reshape(3, 3)[::-1].ravel()  # xi is reversed
    return replace(
        quads,
        points=np.concatenate([points, points[~centre] * [1, -1]]),
        cells=np.concatenate([quads.cells, image[quads.cells[:, turned]]]),
        region=np.tile(quads.region, 2),
        element=np.tile(quads.element, 2),
        origin=np.concatenate([quads.origin, quads.origin[:, [1, 0, 2, 3]]]),
    )
