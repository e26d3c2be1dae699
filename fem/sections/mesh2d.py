"""The cross-section of a tire as curved quadrilaterals in the meridian half plane."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tireroad.fem.sections import reference

Position = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


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
        from tireroad.fem.sections.checks import check

        check(self)

    def at(self, cells: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        """Positions (k, 2) m at reference coordinates in cells, (k,) each."""
        if self.position is not None:
            return self.position(cells, xi, eta)
        edge = reference.equispaced(self.order)
        shape = reference.tensor(reference.line(edge, xi), reference.line(edge, eta))
        return np.einsum("ka,kax->kx", shape, self.nodes[self.cells[cells]])

    def on_nodes(self, order: int, edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (m, 2) and cells (c, (order + 1)^2) of this section with other element nodes.

        `edge` (order + 1,): nodes on an edge of the reference element, instead of equispaced ones.
        The numbering does not depend on `edge`; at the mesh's own order it is unchanged.
        """
        cells = self.cells if order == self.order else self._numbered(order)
        count = cells.max() + 1
        owner, local = _first_use(cells, count)
        xi, eta = (part[local] for part in reference.grid_points(edge))
        return self.at(owner, xi, eta), cells

    def of_order(self, order: int) -> SectionMesh:
        """The same section with elements of another order; raising the order keeps the shape."""
        if order == self.order:
            return self
        nodes, cells = self.on_nodes(order, reference.equispaced(order))
        return replace(self, order=order, nodes=nodes, cells=cells)

    def moved(self, place: Callable[[np.ndarray], np.ndarray]) -> SectionMesh:
        """The same elements with every point (r, y) mapped by `place`, (k, 2) to (k, 2) m."""
        exact = self.position
        position = None if exact is None else lambda *at: place(exact(*at))
        return replace(self, nodes=place(self.nodes), position=position)

    def side(self, edges: np.ndarray) -> np.ndarray:
        """Nodes (k, order + 1) of edges (k, 2), in ascending xi or eta."""
        cell, side = edges.T
        return self.cells[cell[:, None], reference.side_nodes(self.order)[side]]

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
        for side, local in enumerate(reference.side_nodes(order)):
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
