"""Vibration of the whole tire in the frequency domain: u(w) = Phi a(w) of its coordinates a.

The mean square of the velocity normal to the surface, over its area S, is  w^2 a^H N a / (2 S)
with  N = sum_n (n A)_n Phi^T n_n n_n^T Phi:  one small matrix for all frequencies. A plate that
radiated all of it would have the equivalent radiated power  rho c S <v^2>, an upper bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

IMPEDANCE = 413.3  # N s/m3, rho c of air at 20 deg C and 1013 hPa


@dataclass(frozen=True)
class Surface:
    """The outer face in the static state: `normal` (s, 3), m2, times the area of each node."""

    normal: np.ndarray

    @staticmethod
    def of(points: np.ndarray, quads: np.ndarray) -> Surface:
        """From nodes (s, 3) m and quadrilaterals (q, 4), whose area is divided among their nodes.

        The vector area of a quadrilateral is exactly half the cross product of its diagonals.
        """
        a, b, c, d = (points[quads[:, k]] for k in range(4))
        vector = np.cross(c - a, d - b) / 2
        normal = np.zeros_like(points)
        for k in range(4):
            np.add.at(normal, quads[:, k], vector / 4)
        return Surface(normal)

    @property
    def area(self) -> float:
        """S, m2."""
        return float(np.linalg.norm(self.normal, axis=1).sum())

    def gram(self, shape: np.ndarray) -> np.ndarray:
        """N (m, m) m2/kg of the shapes (3 s, m)."""
        size = np.linalg.norm(self.normal, axis=1)
        unit = self.normal / np.maximum(size, np.finfo(float).tiny)[:, None]
        seen = np.einsum("sk,skm->sm", unit, shape.reshape(len(size), 3, -1))
        return (seen * size[:, None]).T @ seen


def mean_square_velocity(
    a: np.ndarray, gram: np.ndarray, area: float, frequency: np.ndarray
) -> np.ndarray:
    """<v_n^2> (f,) m2/s2 of amplitudes a (f, m) at the frequencies (f,) Hz."""
    square = np.einsum("fm,mn,fn->f", a.conj(), gram, a, optimize=True).real
    return (2 * np.pi * frequency) ** 2 * square / (2 * area)


def radiated_power(velocity: np.ndarray, area: float) -> np.ndarray:
    """Equivalent radiated power, W, of mean-square velocities in m2/s2."""
    return IMPEDANCE * area * velocity
