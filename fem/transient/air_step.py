"""The cavity's air in an implicit step of the full finite elements, eliminated.

    [A + E E^T    -E' w ] [u]   [r]
    [ -w E'^T       Z   ] [g] = [q],    Z = c2 + c1 D_a + K_a,

A being the tire's matrix of the step, E = e^T, the rest as in fem.cavity.column. The air's unknowns
follow the tire's on the last process.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tireroad.fem.cavity.column import Column


class AirStep:
    """`solve` maps own rows (n, k) to own rows of A^-1 times them; `weights` are (c1 1/s, c2 1/s2).
    Creation and all methods are collective.
    """

    def __init__(
        self,
        air: Column,
        solve: Callable[[np.ndarray], np.ndarray],
        weights: tuple[float, float],
    ) -> None:
        self._air, self._comm = air, air.comm
        self.mine = air.comm.rank == air.comm.size - 1
        self.count = len(air.duct.circular)
        self._drag, stiffness = air.duct.pencil(air.speed)
        first, second = weights
        own = second * np.eye(self.count) + first * self._drag + stiffness
        self._inverse = np.linalg.inv(own)
        self._driven = air.duct.circular
        weight = np.eye(1 + self.count)
        weight[1:, 1:] -= self._driven[:, None] * self._inverse * self._driven
        self._columns = solve(air.pushed.toarray())
        core = np.eye(1 + self.count) + air.coupling(self._columns) @ weight
        self._mend = weight @ np.linalg.inv(core)

    @property
    def rows(self) -> int:
        """Number of the air's unknowns on this process."""
        return self.count if self.mine else 0

    def shared(self, own: np.ndarray) -> np.ndarray:
        """The air's values (a, ...) on every process, from the owner's."""
        return self._comm.bcast(own if self.mine else None, root=self._comm.size - 1)

    def right(self, own: np.ndarray, air: np.ndarray) -> np.ndarray:
        """Own rows (n,) of the tire's right-hand side, with forces (a,) on the air eliminated."""
        return own + self._air.pushed[:, 1:] @ (self._driven * (self._inverse @ air))

    def complete(self, free: np.ndarray, air: np.ndarray) -> np.ndarray:
        """Own rows (n + rows, ...) of u and g, from A^-1 right (n, ...), air forces (a, ...)."""
        u = free - self._columns @ (self._mend @ self._air.coupling(free))
        moved = self._air.coupling(u)[1:]
        g = self._inverse @ (air + (self._driven * moved.T).T)
        return np.concatenate([u, g]) if self.mine else u

    def dragged(self, tire: np.ndarray, rates: np.ndarray) -> tuple[float, np.ndarray]:
        """Damping forces: none on the tire's rows, D_a g' (rows,) on the air's."""
        return 0.0, self._drag @ rates if self.mine else rates

    def momentum(self) -> np.ndarray:
        """Momentum (3, rows) kg^1/2 per unit rate."""
        return self._air.duct.momentum[:, : self.rows]
