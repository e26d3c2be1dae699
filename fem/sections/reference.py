"""The reference quadrilateral [0, 1] x [0, 1]: tensor-product Lagrange functions and sides."""

from __future__ import annotations

import numpy as np

SIDES = ("xi = 0", "xi = 1", "eta = 0", "eta = 1")


def equispaced(order: int) -> np.ndarray:
    """Equispaced nodes of one edge of the reference element, (order + 1,), 0 and 1 included."""
    return np.linspace(0.0, 1.0, order + 1)


def line(nodes: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Lagrange functions (k, n) of the nodes (n,) at points t (k,)."""
    values = np.empty((len(t), len(nodes)))
    for a in range(len(nodes)):
        others = np.delete(nodes, a)
        values[:, a] = np.prod((t[:, None] - others) / (nodes[a] - others), axis=1)
    return values


def line_slope(nodes: np.ndarray, t: np.ndarray) -> np.ndarray:
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
