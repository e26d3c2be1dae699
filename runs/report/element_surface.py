"""The outer face as its elements have it: curved between the nodes, not a polygon of them.

x(t, s) = sum_ij N_i(t) N_j(s) x_ij,   Lagrange functions N of the elements' order.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.sections import mesh2d

FACET = np.radians(4.0)  # largest angle around the axle between two places that are drawn
ALONG = 48  # least number of places from bead to bead that are drawn


@dataclass(frozen=True)
class ElementSurface:
    """A grid of the face finer than its nodes: `points` (s', 3) m, `quads` (q', 4), and `field`."""

    points: NDArray
    quads: NDArray
    _around: NDArray
    _along: NDArray

    @staticmethod
    def of(points: NDArray, quads: NDArray, scene: Mapping) -> ElementSurface:
        """The surface of nodes (s, 3) with `quads` (q, 4) between them, of a resolved `scene`.

        The nodes themselves where they are no grid of elements of the scene's order.
        """
        around, along = _grid(points, quads)
        order = int(scene.get("tire", {}).get("order", 1))
        if order < 2 or around % order or (along - 1) % order:
            return ElementSurface(points, quads, np.eye(around), np.eye(along))
        ring = points.reshape(around, along, 3)[:, along // 2]
        angle = np.unwrap(np.arctan2(ring[:, 0], -ring[:, 2]))
        corner = np.append(angle[::order], angle[0] + 2 * np.pi)
        if (np.diff(corner) <= 0).any():
            return ElementSurface(points, quads, np.eye(around), np.eye(along))
        edge = (np.append(angle[:order], corner[1]) - corner[0]) / (corner[1] - corner[0])
        parts = np.maximum(np.ceil(np.diff(corner) / FACET).astype(int), order)
        line = points.reshape(around, along, 3)[0, ::order]
        length = np.linalg.norm(np.diff(line, axis=0), axis=1)
        across = np.maximum(np.ceil(ALONG * length / length.sum()).astype(int), order)
        rows, columns = _fine(edge, parts, around), _fine(edge, across, along)
        surface = ElementSurface(points, quads, rows, columns)
        fine = surface.field(points)
        return ElementSurface(fine, _quads(len(rows), len(columns)), rows, columns)

    def field(self, values: NDArray) -> NDArray:
        """A field (..., s, 3) at the nodes, at the points of this surface."""
        grid = values.reshape(*values.shape[:-2], len(self._around.T), len(self._along.T), 3)
        fine = np.einsum("ia,jb,...abk->...ijk", self._around, self._along, grid, optimize=True)
        return fine.reshape(*values.shape[:-2], -1, 3)


def _grid(points: NDArray, quads: NDArray) -> tuple[int, int]:
    """Nodes around and from bead to bead, from the first quadrilateral: [0, along, along + 1, 1]."""
    along = int(quads[0, 1]) if len(quads) else len(points)
    if along < 2 or len(points) % along:
        return 1, len(points)
    return len(points) // along, along


def _fine(edge: NDArray, parts: NDArray, nodes: int) -> NDArray:
    """Weights (k, nodes) of the nodes at so many equal `parts` of each element, closed or with its end."""
    order, rows = len(edge) - 1, []
    for number, count in enumerate(parts):
        weights = mesh2d.lagrange(edge, np.arange(count) / count)
        row = np.zeros((count, nodes))
        row[:, (order * number + np.arange(order + 1)) % nodes] = weights
        rows.append(row)
    if len(parts) * order < nodes:  # a line has an end, a ring none
        rows.append(np.eye(nodes)[-1:])
    return np.concatenate(rows)


def _quads(around: int, along: int) -> NDArray:
    """Quadrilaterals (q, 4) between the places of a grid, closed around."""
    i, j = np.meshgrid(np.arange(around), np.arange(along - 1), indexing="ij")
    first, after = i * along + j, (i + 1) % around * along + j
    return np.stack([first, after, after + 1, first + 1], axis=-1).reshape(-1, 4)
