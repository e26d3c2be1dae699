"""Modal damping in the full finite-element model: a low-rank matrix in addition to the sparse ones.

    D_x = M Phi diag(e) Phi^T M,   and in the rolling pencil
    K_x = Omega D_x M^-1 B = Omega M Phi diag(e) Phi^T B,

e_k being the damping rate of mode k in excess of the sparse matrices' uniform one. A system A + c
D_x + K_x is solved with A's factorisation and a small matrix (Sherman, Morrison and Woodbury).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from tireroad.fem.collective import summed
from tireroad.fem.matrices.direct import multiply
from tireroad.fem.matrices.operators import Operators


class ModalDamping:
    """`fields`: own rows (n, m) of M-orthonormal modes, kg^-1/2; `excess` (m,) 1/s. Collective.

    `body`: the matrix B of a wheel that rotates at `speed` (rad/s), None if standing.
    """

    def __init__(
        self,
        operators: Operators,
        fields: np.ndarray,
        excess: np.ndarray,
        body: PETSc.Mat | None = None,
        speed: float = 0.0,
    ) -> None:
        self._comm, self._fields = operators.body.comm, fields
        self._weighted = operators.mass[:, None] * fields
        self._push = self._weighted * excess
        # Phi^T B = -(B Phi)^T: B is skew.
        self._turned = 0.0 if body is None else -speed * multiply(body, fields)

    def force(self, rate: np.ndarray) -> np.ndarray:
        """D_x rate, own rows, N, for velocities (n,) m/s. Collective."""
        return self._push @ summed(self._comm, self._weighted.T @ rate)

    def joined(
        self, solve: Callable[[np.ndarray], np.ndarray], share: float
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Solver of A + share D_x + K_x, own rows (n, k), from `solve`, that of A. Collective."""
        reading = share * self._weighted + self._turned
        through = solve(self._push)
        small = np.eye(through.shape[1]) + summed(self._comm, reading.T @ through)

        def whole(right: np.ndarray) -> np.ndarray:
            first = solve(right)
            return first - through @ np.linalg.solve(small, summed(self._comm, reading.T @ first))

        return whole
