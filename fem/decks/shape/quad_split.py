"""Nine-node quadrilaterals, and the conversion of sections with triangles to quadrilaterals.

Local node (i, j) of a cell is at 3 i + j, at xi = i/2, eta = j/2; sides 0 to 3 are xi = 0, xi = 1,
eta = 0, eta = 1, as in tireroad.fem.sections. Every side carries the number of the deck's edge it
is part of, so that sets of the deck remain valid after cells are split.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIDE_NODES = np.array([[0, 1, 2], [6, 7, 8], [0, 3, 6], [2, 5, 8]])
SIDE_OF_FACE = np.array([2, 1, 3, 0])  # faces S1 to S4 of a quadrilateral
TENSOR = np.array([0, 7, 3, 4, 8, 6, 1, 5, 2])  # corners 0-3, middles 4-7, centre 8 in tensor order


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
