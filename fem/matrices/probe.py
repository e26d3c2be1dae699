"""Loads and readings on the outer face: nodal weights from the element's shape functions."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import lagrange
from tireroad.fem.tire.mesh import NodeGrid

_POINTS = 6  # Gauss points per direction in each element under a distributed load
_STEP = 1e-5  # step of the difference quotient, as a fraction of an element


def nodes(index: np.ndarray, count: int, component: int = 2) -> sparse.csr_matrix:
    """Rows (k, 3 count) for one component at single nodes, `index` (k,) into the outer face."""
    k = len(index)
    return sparse.csr_matrix(
        (np.ones(k), (np.arange(k), 3 * index + component)), shape=(k, 3 * count)
    )


def along(index: np.ndarray, count: int, vectors: np.ndarray) -> sparse.csr_matrix:
    """Rows (k, 3 count) for components along `vectors` (k, 3) at nodes `index` (k,)."""
    k = len(index)
    rows = np.repeat(np.arange(k), 3)
    columns = (3 * index[:, None] + np.arange(3)).ravel()
    return sparse.csr_matrix((vectors.ravel(), (rows, columns)), shape=(k, 3 * count))


def spot(
    lattice: NodeGrid, ring: float, arc: float, spread: tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """Weights (s,) of the outer-face nodes for a point load, or a uniform traction of total 1.

    Angles in rad: `ring` around the axle from the lowest point, `arc` along the section from the
    crown; `spread`: half widths. As a reading, a spread spot gives the mean over it. InputError if
    it reaches beyond a bead.
    """
    first, last = lattice.arc_corners[0], lattice.arc_corners[-1]
    if not max(first - (arc - spread[1]), arc + spread[1] - last) <= _STEP * (last - first):
        raise InputError(
            f"a point at {arc:.4g} rad along the section, +- {spread[1]:.4g} rad, reaches beyond the bead: the "
            f"outer face has {first:.4g} to {last:.4g} rad"
        )
    around, ring_weight = _line_rule(lattice.ring_corners, ring, spread[0])
    along, arc_weight = _line_rule(lattice.arc_corners, arc, spread[1])
    # Area per unit angles: the outer parts of the spot are longer.
    area = _area(lattice, along)
    arc_weight = arc_weight * area / (arc_weight @ area)
    shape_ring = ring_weight @ _shape(lattice.ring_corners, lattice.edge, around % (2 * np.pi))
    shape_ring[0] += shape_ring[-1]
    shape_arc = arc_weight @ _shape(lattice.arc_corners, lattice.edge, along)
    return np.outer(shape_ring[:-1], shape_arc).ravel()


def between(lattice: NodeGrid, other: NodeGrid) -> sparse.csr_matrix:
    """Weights (s', s) of the outer face's nodes of a lattice in fields at those of another mesh of the same tire."""
    around = _shape(lattice.ring_corners, lattice.edge, other.ring)
    around[:, 0] += around[:, -1]
    across = _shape(lattice.arc_corners, lattice.edge, other.arc)
    return sparse.kron(sparse.csr_matrix(around[:, :-1]), sparse.csr_matrix(across), format="csr")


def _area(lattice: NodeGrid, arc: np.ndarray) -> np.ndarray:
    """Undeformed outer area per ring and section angle, m2/rad2, at section angles (k,)."""
    element, local = _local(lattice.arc_corners, arc)
    low, high = np.clip(local - _STEP, 0, 1), np.clip(local + _STEP, 0, 1)
    ends = [lattice.tire.outer_line(element, t) for t in (low, high)]
    length = np.linalg.norm(ends[1] - ends[0], axis=1) / (high - low)
    r = lattice.tire.outer_line(element, np.clip(local, 0, 1))[:, 0]
    return r * length / np.diff(lattice.arc_corners)[element]


def directed(weights: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Weights (3 s,) over three dofs a node for the unit vector along `direction`."""
    return np.outer(weights, np.asarray(direction) / np.linalg.norm(direction)).ravel()


def _line_rule(corners: np.ndarray, centre: float, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Gauss points and weights (sum 1) on centre +- half, split at element boundaries."""
    if half == 0:
        return np.array([centre]), np.ones(1)
    turn = 2 * np.pi * np.arange(-1, 2)[:, None] if corners[0] == 0 else 0.0
    inner = np.unique(corners + turn)
    low, high = centre - half, centre + half
    edges = np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])
    t, weight = np.polynomial.legendre.leggauss(_POINTS)
    length = np.diff(edges)[:, None] / 2
    points = (edges[:-1, None] + edges[1:, None]) / 2 + length * t
    return points.ravel(), (length * weight).ravel() / (2 * half)


def _shape(corners: np.ndarray, edge: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Shape functions (points, nodes) of all nodes of a line of elements at the points."""
    first, values = line_shape(corners, edge, points)
    order = len(edge) - 1
    out = np.zeros((len(points), order * (len(corners) - 1) + 1))
    out[np.arange(len(points))[:, None], first[:, None] + np.arange(order + 1)] = values
    return out


def line_shape(
    corners: np.ndarray, edge: np.ndarray, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """First node (k,) of each point's element on a line; shape functions (k, order + 1) there."""
    element, local = _local(corners, points)
    return (len(edge) - 1) * element, lagrange(edge, local)


def _local(corners: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Element (k,) of each point on a line, and its local coordinate, 0 to 1."""
    element = np.clip(np.searchsorted(corners, points, side="right") - 1, 0, len(corners) - 2)
    return element, (points - corners[element]) / np.diff(corners)[element]
