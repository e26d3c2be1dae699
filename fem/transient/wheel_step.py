"""A moving wheel in an implicit step of the full finite elements, eliminated.

Small motions w of the tire relative to its rim, and xi of rim and body, have the blocks of
modal.corner with the unit matrix in place of modes:

    X_ww, X_wr = X R, X_rw = +-(X R)^T, X_rr    of mass, damping and stiffness.

The unknowns are the tire's whole motion u = w + R xi, and x with xi = L^-T x, L L^T being the
inertia of rim, wheel and body alone. The mass is then diagonal, and contact and loads involve u
only. With T = (1, -R; 0, L^-T), X' = T^T X T, a step solves

    [A   B] [u]   [r]
    [C^T Z] [x] = [s].

The wheel's unknowns follow the tire's on the last process.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from petsc4py import PETSc

from tireroad.fem.axle import Axle
from tireroad.fem.collective import summed
from tireroad.fem.matrices.direct import multiply
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.rim_motion import RimMotion, carried_pencil

Array = np.ndarray


class Wheel:
    """Matrices of the moving wheel. Collective to make.

    `operators` have a fixed rim; `rim`: products with the rim's motions; `axle`: suspension; `drag`
    and `stiffness`: the tire's matrices as it rolls. For damping (1) and stiffness (0): `columns`
    and `rows` (n, c) on the tire's own unknowns and `own` (c, c); `carried` (3, c) kg^1/2: momentum
    per unit rate; `shown` (7, c): motions of rim and body per x.
    """

    def __init__(
        self,
        operators: Operators,
        rim: RimMotion,
        axle: Axle,
        speed: float,
        drag: PETSc.Mat,
        stiffness: PETSc.Mat,
    ) -> None:
        self.comm = operators.body.comm
        part = axle.taking_part
        motion = rim.rows["mass"] / operators.mass[:, None]
        mass, own_drag, own_stiffness = carried_pencil(axle, rim.whole, speed)
        mass[:6, :6] -= summed(self.comm, motion.T @ rim.rows["mass"])
        lower = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(part, part)]))
        self.shown = np.zeros((7, len(part)))
        self.shown[part] = lower.T
        self.carried = mass[:3] @ self.shown
        turning = 2 * speed * rim.rows["gyroscopic"] if speed else np.zeros_like(motion)
        static = rim.rows["stiffness"] + (speed**2 * rim.rows["convective"] if speed else 0.0)
        self.columns, self.rows, self.own = {}, {}, {}
        for order, matrix, across, sign, own in (
            (1, drag, turning, -1, own_drag),
            (0, stiffness, static, 1, own_stiffness),
        ):
            along, back = multiply(matrix, motion), _transposed(matrix, motion)
            whole = own.copy()
            whole[:6, :6] += summed(
                self.comm,
                motion.T @ along - motion.T @ across - sign * across.T @ motion,
            )
            self.columns[order] = (across - along) @ self.shown[:6]
            self.rows[order] = (sign * across - back) @ self.shown[:6]
            self.own[order] = self.shown.T @ whole @ self.shown


def _transposed(matrix: PETSc.Mat, vectors: Array) -> Array:
    """X^T v, own rows (n, k). Collective."""
    before, after = matrix.createVecs()
    out = np.empty_like(vectors)
    for k, vector in enumerate(vectors.T):
        after.array[:] = vector
        matrix.multTranspose(after, before)
        out[:, k] = before.array_r
    before.destroy()
    after.destroy()
    return out


class WheelStep:
    """AirStep's counterpart for the `wheel`; `weights` (c1 1/s, c2 1/s2). All is collective."""

    def __init__(
        self, wheel: Wheel, solve: Callable[[Array], Array], weights: tuple[float, float]
    ) -> None:
        self._wheel, self._comm = wheel, wheel.comm
        self.mine = wheel.comm.rank == wheel.comm.size - 1
        self.count = wheel.own[0].shape[0]
        first, second = weights
        columns = first * wheel.columns[1] + wheel.columns[0]
        self._rows = first * wheel.rows[1] + wheel.rows[0]
        own = second * np.eye(self.count) + first * wheel.own[1] + wheel.own[0]
        self._columns = solve(columns)
        self._inverse = np.linalg.inv(own - summed(self._comm, self._rows.T @ self._columns))

    @property
    def rows(self) -> int:
        """Number of the wheel's unknowns on this process."""
        return self.count if self.mine else 0

    def shared(self, own: Array) -> Array:
        """The wheel's values (c, ...) on every process, from the owner's."""
        return self._comm.bcast(own if self.mine else None, root=self._comm.size - 1)

    def right(self, own: Array, wheel: Array) -> Array:
        """Own rows of the tire's right-hand side; forces on the wheel do not contribute."""
        return own

    def complete(self, free: Array, wheel: Array) -> Array:
        """Own rows (n + rows, ...) of u and x, from A^-1 right (n, ...), wheel forces (c, ...)."""
        x = self._inverse @ (wheel - summed(self._comm, self._rows.T @ free))
        u = free - self._columns @ x
        return np.concatenate([u, x]) if self.mine else u

    def dragged(self, tire: Array, rates: Array) -> tuple[Array, Array]:
        """Damping forces on the tire's own rows (n,) and the wheel's (rows,), from the velocities
        of both. On the tire only those due to the wheel's velocity."""
        x = self.shared(rates)
        back = summed(self._comm, self._wheel.rows[1].T @ tire) + self._wheel.own[1] @ x
        return self._wheel.columns[1] @ x, back if self.mine else rates

    def momentum(self) -> Array:
        """Momentum (3, rows) kg^1/2 per unit rate."""
        return self._wheel.carried[:, : self.rows]
