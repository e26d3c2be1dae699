"""Contact pressure and the extent of the footprint, from nodal forces and gaps on the outer face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.tire.mesh import Lattice


@dataclass(frozen=True)
class Footprint:
    """Length (x), width (y) in m and area in m2 of where the pressure is positive."""

    length: float
    width: float
    area: float


def nodal_area(lattice: Lattice, positions: np.ndarray) -> np.ndarray:
    """Horizontal area (s,) m2 that each node of the deformed outer face (s, 3) stands for.

    The row sums of the surface's mass matrix by the Lobatto rule of the nodes: positive in every
    order, so that pressure = force/area has the force's sign. On a plane they are what a uniform
    pressure puts on the nodes; a node's share of distances is not (a factor 2 between corners and
    middles of quadratic elements).
    """
    around, along = lattice.face_shape
    order = len(lattice.edge) - 1
    weight, slope = _edge_rule(lattice.edge)
    grid = positions.reshape(around, along, 3)
    i = (order * np.arange(around // order)[:, None] + np.arange(order + 1)) % around
    j = order * np.arange((along - 1) // order)[:, None] + np.arange(order + 1)
    element = grid[i[:, None, :, None], j[None, :, None, :]]
    ring = np.einsum("ab,ijbcx->ijacx", slope, element)
    arc = np.einsum("cb,ijabx->ijacx", slope, element)
    shadow = abs(ring[..., 0] * arc[..., 1] - ring[..., 1] * arc[..., 0])
    area = np.zeros((around, along))
    share = shadow * np.outer(weight, weight)
    np.add.at(area, (i[:, None, :, None], j[None, :, None, :]), share)
    return area.ravel()


def _edge_rule(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the nodes on [0, 1], and slopes (at node, of shape function)."""
    powers = np.arange(len(nodes))
    coefficients = np.linalg.inv(nodes[:, None] ** powers)  # of the shape functions, by column
    derivative = powers * nodes[:, None] ** np.maximum(powers - 1, 0)
    return (1 / (powers + 1)) @ coefficients, derivative @ coefficients


def footprint(
    shape: tuple[int, int],
    positions: np.ndarray,
    pressure: np.ndarray,
    gap: np.ndarray,
    area: np.ndarray,
) -> Footprint:
    """Extent of the contact on a face of `shape` (around, along); arrays (s,), positions (s, 3).

    Between a node that presses and one that does not, the edge lies where pressure and gap, each over
    its mean, balance: the extent moves with the load and does not jump from node to node.
    """
    if not (pressure > 0).any():
        return Footprint(0.0, 0.0, 0.0)
    level = _level(shape, pressure, gap)
    grid = positions.reshape(*shape, 3)
    closed = np.concatenate([grid, grid[:1]])
    wrapped = np.concatenate([level, level[:1]])
    edge = np.concatenate(
        [_crossings(closed, wrapped), _crossings(grid.swapaxes(0, 1), level.swapaxes(0, 1))]
    )
    cover = _cover(np.concatenate([level[-1:], wrapped]), 0)
    cover = cover * _cover(np.pad(level, ((0, 0), (1, 1)), constant_values=-1.0), 1)
    length, width = edge[:, :2].max(axis=0) - edge[:, :2].min(axis=0)
    return Footprint(float(length), float(width), float((area * cover.ravel()).sum()))


def _level(shape: tuple[int, int], pressure: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Positive where there is pressure, negative where there is a gap, about 1 at the edge."""
    inside = (pressure > 0).reshape(shape)
    near = np.roll(inside, 1, 0) | np.roll(inside, -1, 0)
    near[:, 1:] |= inside[:, :-1]
    near[:, :-1] |= inside[:, 1:]
    rim = (near & ~inside).ravel()
    opening = gap[rim].mean() if rim.any() else 1.0
    mean = pressure[pressure > 0].mean()
    level = np.where(pressure > 0, pressure / mean, -np.maximum(gap, 0.0) / opening)
    return np.where(level == 0, -np.finfo(float).tiny, level).reshape(shape)


def _crossings(points: np.ndarray, level: np.ndarray) -> np.ndarray:
    """Points (n, 3) along the first axis at which the level changes sign."""
    a, b = level[:-1], level[1:]
    mixed = (a > 0) != (b > 0)
    part = (a[mixed] / (a[mixed] - b[mixed]))[:, None]
    return points[:-1][mixed] * (1 - part) + points[1:][mixed] * part


def _cover(level: np.ndarray, axis: int) -> np.ndarray:
    """Covered share of each inner node's two half segments along an axis."""
    level = np.moveaxis(level, axis, 0)
    a, b = level[:-1], level[1:]
    share = (np.maximum(a, 0) + np.maximum(b, 0)) / (abs(a) + abs(b))

    def half(share: np.ndarray, inside: np.ndarray) -> np.ndarray:
        return np.where(inside, np.minimum(1, 2 * share), np.maximum(0, 2 * share - 1))

    inner = level[1:-1] > 0
    return np.moveaxis((half(share[:-1], inner) + half(share[1:], inner)) / 2, 0, axis)
