"""Location of points in a section: cell, reference coordinates and shape functions."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from tireroad.fem.sections import reference

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
    edge = reference.equispaced(order)
    place = np.full(points.shape, 0.5)
    for _ in range(_NEWTON):
        xi, eta = place.T
        value = reference.line(edge, xi), reference.line(edge, eta)
        slope = reference.line_slope(edge, xi), reference.line_slope(edge, eta)
        defect = np.einsum("ka,kax->kx", reference.tensor(*value), corners) - points
        rates = [
            np.einsum("ka,kax->kx", reference.tensor(*pair), corners)
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
    shape = reference.tensor(reference.line(edge, xi), reference.line(edge, eta))
    rows = np.repeat(np.arange(len(cell)), shape.shape[1])
    entries = shape.ravel(), (rows, cells[cell].ravel())
    return sparse.csr_matrix(entries, shape=(len(cell), count))
