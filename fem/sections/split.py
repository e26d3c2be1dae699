"""Points located in a section, and local refinement: strips of its cells split in two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.sections.ring import Ring

_CANDIDATES = 9  # cells whose centres are nearest to a point: one of them contains it
_NEWTON = 12
_OUTSIDE = 0.2  # of an element: limit of the reference coordinates for points off the mesh


def locate(
    nodes: np.ndarray, cells: np.ndarray, order: int, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cell, xi and eta, (k,) each, of points (k, 2) m in cells (c, n) of equispaced nodes.

    Newton's method in the nearest cells; a point outside all of them gets the best fit.
    """
    near = min(_CANDIDATES, len(cells))
    _, candidates = cKDTree(nodes[cells].mean(axis=1)).query(points, k=near)
    candidates = candidates.reshape(len(points), near)
    best = np.full(len(points), np.inf)
    found = np.zeros((len(points), 3))
    for cell in candidates.T:
        place = _inverse(nodes[cells[cell]], order, points)
        # Any cell that contains the point will do; otherwise the nearest.
        excess = np.abs(place - 0.5).max(axis=1)
        better = excess < best - 1e-9
        best[better] = excess[better]
        found[better] = np.column_stack([cell, place])[better]
    return found[:, 0].astype(int), found[:, 1], found[:, 2]


def _inverse(corners: np.ndarray, order: int, points: np.ndarray) -> np.ndarray:
    """Reference coordinates (k, 2) of points (k, 2) in cells with nodes (k, n, 2)."""
    edge = mesh2d.equispaced(order)
    place = np.full(points.shape, 0.5)
    for _ in range(_NEWTON):
        xi, eta = place.T
        value = mesh2d.line(edge, xi), mesh2d.line(edge, eta)
        slope = mesh2d.line_slope(edge, xi), mesh2d.line_slope(edge, eta)
        defect = np.einsum("ka,kax->kx", mesh2d.tensor(*value), corners) - points
        rates = [
            np.einsum("ka,kax->kx", mesh2d.tensor(*pair), corners)
            for pair in ((slope[0], value[1]), (value[0], slope[1]))
        ]
        step = np.linalg.solve(np.stack(rates, axis=-1), defect[:, :, None])[:, :, 0]
        place = np.clip(place - np.clip(step, -0.5, 0.5), -_OUTSIDE, 1 + _OUTSIDE)
    return place


def interpolation(
    cells: np.ndarray,
    edge: np.ndarray,
    count: int,
    place: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> sparse.csr_matrix:
    """Shape functions (k, count) at (cell, xi, eta) on cells (c, n) with nodes at `edge`."""
    cell, xi, eta = place
    shape = mesh2d.tensor(mesh2d.line(edge, xi), mesh2d.line(edge, eta))
    rows = np.repeat(np.arange(len(cell)), shape.shape[1])
    entries = shape.ravel(), (rows, cells[cell].ravel())
    return sparse.csr_matrix(entries, shape=(len(cell), count))


_SAME = 1e-7  # of the section's size: nodes of two cells closer than this are merged


def split_ring(ring: Ring, around: np.ndarray, along: np.ndarray) -> Ring:
    """The ring with segments `around` (segments,) bool and the strips of cells under outer edges
    `along` (k,) bool split in two. The shape and all existing nodes are kept.
    """
    return replace(
        ring,
        section=split_section(ring.section, along),
        ring_corners=_cut(ring.ring_corners, around),
        arc_corners=_cut(ring.arc_corners, along),
        coarser=lambda: None,
    )


def _cut(corners: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Ascending corners with a midpoint inserted in each wanted interval."""
    return np.sort(np.append(corners, ((corners[1:] + corners[:-1]) / 2)[wanted]))


def split_section(section: SectionMesh, along: np.ndarray) -> SectionMesh:
    """The section with strips of cells under outer edges `along` (k,) bool split in two.

    A strip runs from an edge to the opposite one of the same cell and on through the next, so that
    cells still share whole edges. The shape is that of the original cells.
    """
    children = _Children(_strips(section, section.outer[along]))
    order = section.order
    xi, eta = mesh2d.grid_points(mesh2d.equispaced(order))

    def position(cells: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        return section.at(*children.in_parent(cells, xi, eta))

    count = len(children.owner)
    every = np.repeat(np.arange(count), len(xi))
    nodes, number = _merged(position(every, np.tile(xi, count), np.tile(eta, count)))
    return replace(
        section,
        nodes=nodes,
        cells=number.reshape(count, -1),
        region=section.region[children.owner],
        outer=children.chain(section, section.outer),
        tread=children.edges(section.tread),
        inner=children.edges(section.inner),
        rim=children.edges(section.rim),
        plies={name: children.chain(section, edges) for name, edges in section.plies.items()},
        position=position,
    )


def _strips(section: SectionMesh, starts: np.ndarray) -> np.ndarray:
    """Reference coordinates along which each cell is split, (cells, 2) bool."""
    sides = section.cells[:, mesh2d.side_nodes(section.order)][..., [0, -1]]
    across: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for cell, side in np.ndindex(sides.shape[:2]):
        across.setdefault(tuple(sorted(sides[cell, side])), []).append((cell, side))
    cut = np.zeros((len(section.cells), 2), bool)
    for cell, side in starts:
        while not cut[cell, _along(side)]:
            cut[cell, _along(side)] = True
            opposite = cell, side ^ 1
            both = across[tuple(sorted(sides[opposite]))]
            cell, side = next((found for found in both if found != opposite), opposite)
    return cut


def _along(side: int) -> int:
    """The reference coordinate that runs along a side."""
    return 1 - side // 2


class _Children:
    """The cells into which `cut` (cells, 2) bool splits each cell, consecutive for each parent."""

    def __init__(self, cut: np.ndarray) -> None:
        self.parts = 1 + cut
        self.first = np.concatenate([[0], np.cumsum(self.parts.prod(axis=1))])
        self.owner = np.repeat(np.arange(len(cut)), self.parts.prod(axis=1))
        local = np.arange(len(self.owner)) - self.first[self.owner]
        self.size = 1 / self.parts[self.owner]
        self.start = np.stack(np.divmod(local, self.parts[self.owner, 1]), axis=-1) * self.size

    def in_parent(
        self, cells: np.ndarray, xi: np.ndarray, eta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cell and reference coordinates in the parent section."""
        place = self.start[cells] + self.size[cells] * np.stack([xi, eta], axis=-1)
        return self.owner[cells], place[:, 0], place[:, 1]

    def edges(self, edges: np.ndarray, turned: np.ndarray | None = None) -> np.ndarray:
        """The children's edges (k', 2) of edges (k, 2), reversed for sides that are `turned`."""
        found = []
        for number, (cell, side) in enumerate(edges):
            across, step = self.parts[cell], _along(side)
            place = np.zeros((across[step], 2), int)
            place[:, step] = np.arange(across[step])
            place[:, 1 - step] = (across[1 - step] - 1) * (side % 2)
            if turned is not None and turned[number]:
                place = place[::-1]
            child = self.first[cell] + place[:, 0] * across[1] + place[:, 1]
            found.append(np.stack([child, np.full(len(child), side)], axis=1))
        return np.concatenate(found) if found else edges

    def chain(self, section: SectionMesh, edges: np.ndarray) -> np.ndarray:
        """The children's edges of an ordered chain, in its order."""
        start = section.chain(edges)[:: section.order][:-1]
        return self.edges(edges, section.side(edges)[:, 0] != start)


def _merged(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unique points (n, 2), and the index of each given point (k,) among them."""
    size = np.ptp(points, axis=0).max()
    a, b = cKDTree(points).query_pairs(_SAME * size, output_type="ndarray").T
    same = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(points),) * 2)
    _, number = connected_components(same, directed=False)
    _, first = np.unique(number, return_index=True)
    return points[first], number
