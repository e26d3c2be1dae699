"""The air in the tire on a modal basis: the terms that it adds to the projected problem.

With coordinates eta of the tire and g of the air's own modes, both of unit mass, the pencil is that
of `fem.cavity.duct.Duct.joined`. The shapes on the outer face have no component along g.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.cavity.duct import Duct


@dataclass(frozen=True)
class Air:
    """The air of the `duct`, and its `coupling` e (1 + a, m) 1/s with m coordinates of the tire."""

    duct: Duct
    coupling: np.ndarray

    @property
    def count(self) -> int:
        """Number of coordinates of the air, a."""
        return len(self.duct.circular)

    def joined(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """D~ (1/s) and K~ (1/s2) of tire and air, (m + a, m + a), from those of the tire (m, m)."""
        return self.duct.joined(drag, stiffness, speed, self.coupling)

    def share(self, right: np.ndarray) -> np.ndarray:
        """The air's share (q,) of the states' kinetic energy, from their vectors (m + a ..., q)."""
        squares, own = np.abs(right) ** 2, self.coupling.shape[1]
        return squares[own : own + self.count].sum(axis=0) / squares.sum(axis=0)
