"""A tread of independent springs (Winkler), and no tread at all."""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.compliance import Influence, no_tread, winkler_compliance
from tireroad.contact.tread.law import TreadLaw, tread_law
from tireroad.fem.parameters import number

Array = NDArray[np.float64]


@tread_law("winkler", "independent springs")
class Winkler(TreadLaw):
    """Springs of compliance 1/(k A_i) at each point of area A_i."""

    winkler_stiffness: float = number(
        2.0e8, "N/m³", "force per area and approach of the springs", least=1e3, most=1e15
    )

    def influence(self, farthest: float) -> Influence:
        """The spring of a point under its own force, 0 under others."""

        def of(x: Array, y: Array, a: Array, b: Array) -> Array:
            return np.where((x == 0) & (y == 0), 1 / (4 * a * b * self.winkler_stiffness), 0.0)

        return of

    def matrix(self, points: Array, half_sizes: Array, farthest: float) -> Array:
        """Diagonal."""
        return winkler_compliance(4 * half_sizes.prod(axis=1), self.winkler_stiffness)


@tread_law("none", "no compliance: the tread is part of the finite elements")
class NoTread(TreadLaw):
    """No compliance."""

    compliant = False

    def influence(self, farthest: float) -> Influence:
        """0 everywhere."""
        return lambda x, y, a, b: np.zeros(np.broadcast_shapes(np.shape(x), np.shape(a)))

    def matrix(self, points: Array, half_sizes: Array, farthest: float) -> Array:
        """Zeros."""
        return no_tread(len(points))
