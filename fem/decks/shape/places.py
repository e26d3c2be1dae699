"""Location of points in the cells of a section."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.shape.quad_split import Quads, shape

_NEWTON = 12


def rate(t: np.ndarray) -> np.ndarray:
    """Derivatives (k, 3) of the quadratic functions of the nodes 0, 1/2 and 1."""
    t = np.asarray(t, float)
    return np.stack([4 * t - 3, 4 - 8 * t, 4 * t - 1], axis=-1)


def rates(nine: np.ndarray, where: np.ndarray) -> np.ndarray:
    """d(r, z)/d(xi, eta) (k, 2, 2) of cells (k, 9, 2) at one position (k, 2) each."""
    grid = nine.reshape(-1, 3, 3, 2)
    xi, eta = where.T
    along = [(rate(xi), shape(eta)), (shape(xi), rate(eta))]
    return np.stack([np.einsum("ka,kb,kabx->kx", a, b, grid) for a, b in along], axis=-1)


def inverse(
    nine: np.ndarray, points: np.ndarray, limit: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (k, 2) of points (k, 2) in cells (k, 9, 2), and residual distances: Newton.

    Coordinates are kept within `limit` of the cell.
    """
    where = np.full(points.shape, 0.5)
    grid = nine.reshape(-1, 3, 3, 2)
    for _ in range(_NEWTON + 1):
        here = np.einsum("ka,kb,kabx->kx", shape(where[:, 0]), shape(where[:, 1]), grid)
        matrix = rates(nine, where)
        size = np.linalg.norm(matrix, axis=1).prod(axis=1)
        matrix[np.abs(np.linalg.det(matrix)) <= 1e-9 * size] = np.eye(2) * 1e300
        step = np.linalg.solve(matrix, (here - points)[..., None])[..., 0]
        where = np.clip(where - np.clip(step, -0.5, 0.5), -limit, 1 + limit)
    return where, np.linalg.norm(here - points, axis=1)


def locate(quads: Quads, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells (k,) containing points (k, 2), coordinates (k, 2), distance outside (k,) in cells.

    A point near no cell has cell -1 and an infinite distance.
    """
    nine = quads.points[quads.cells]
    low, high = nine.min(axis=1), nine.max(axis=1)
    margin = 0.2 * (high - low).max(axis=1, keepdims=True)
    near = [
        np.flatnonzero(((point >= low - margin) & (point <= high + margin)).all(axis=1))
        for point in points
    ]
    owner = np.repeat(np.arange(len(points)), [len(cells) for cells in near])
    cells = np.concatenate([np.empty(0, np.int64), *near])
    where, miss = inverse(nine[cells], points[owner])
    size = np.linalg.norm(high - low, axis=1)[cells]
    beyond = np.maximum(np.maximum(-where, where - 1).max(axis=1, initial=0), 0) + miss / size
    order = np.lexsort((beyond, owner))
    there, first = np.unique(owner[order], return_index=True)
    best = order[first]
    found = np.full(len(points), -1), np.zeros((len(points), 2)), np.full(len(points), np.inf)
    for into, value in zip(found, (cells, where, beyond), strict=True):
        into[there] = value[best]
    return found
