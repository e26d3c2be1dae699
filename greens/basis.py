"""The states that responses are built from, and static answers on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.response import Response, couple, reading
from tireroad.modal.basis import Projection
from tireroad.modal.corner import MOMENTS, READINGS, SEEN
from tireroad.modal.rolling import RollingModes
from tireroad.modal.states import StateModes

Array = np.ndarray
Probes = sparse.csr_matrix  # (k, 3 s) over the outer face, or (k, 3 s + 6) with the rim
ABOUT_AXLE = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # e_y x


class Statics(NamedTuple):
    """Static answers of loads: `compliance` (r, k) m/N; `momentum` (3, k) kg m/N, int rho x, or (12, k),
    followed by A_0 x, A_1 x and A_2 x of greens.response."""

    compliance: np.ndarray
    momentum: np.ndarray


def modal_statics(
    stiffness: np.ndarray, outputs: np.ndarray, loads: np.ndarray, carried: np.ndarray
) -> Statics:
    """Static answers between outputs (r, m) and loads (k, m) of a pencil with stiffness K~."""
    x = np.linalg.solve(stiffness, loads.T)
    return Statics(outputs @ x, carried @ x)


@dataclass(frozen=True, kw_only=True)
class Basis:
    """The modal basis and its states, with the operations that probes need.

    `shape` kg^-1/2 of the outer face (3 s, m), with six more rows for a free rim; `projection`: the
    projected matrices; `states`: the decoupled states at `speed` rad/s with this `inertia`. Probes
    are weights (k, 3 s) of the outer face. Wider ones have six more columns for the motion of a
    free rim, or, with a corner, seven for wheel and body (modal.corner) and three more that read
    the hub moments. Columns and rows of `shape` beyond these are of places inside the tire and read
    its motion relative to the wheel.
    """

    shape: np.ndarray
    projection: Projection
    states: StateModes
    speed: float = 0.0
    inertia: str = "full"

    @staticmethod
    def of(rolling: RollingModes) -> Basis:
        """The basis of the states of a rolling tire."""
        basis = rolling.basis
        found = Basis(shape=basis.shape, projection=basis.projection, states=rolling.states)
        return found.at(rolling.turning)

    def at(self, turning: Turning) -> Basis:
        """The same with the speed and the inertia of the rotation that its states are of."""
        return replace(self, speed=turning.speed, inertia=turning.inertia)

    def couple(
        self,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        flexibility: np.ndarray | None = None,
    ) -> Response:
        """Response (r, k) between the probes `outputs` and `loads`.

        With the exact static response `flexibility` (r, k), its residual is what the states lack of
        it.
        """
        arguments = self.seen(outputs), self.seen(loads)
        response = couple(self.states, *arguments, self.carried)
        needed = self.of_hub(outputs)
        if needed.nnz:
            response = self.reading_hub(response, needed, loads)
        if flexibility is None:
            return response
        return replace(response, residual=flexibility - response.static())

    def reading_hub(
        self, response: Response, moments: sparse.csr_matrix, loads: sparse.csr_matrix
    ) -> Response:
        """The response (r, k) of the states to the probes `loads` (k, 3 s), with hub `moments` (r, 3) in its outputs."""
        response = reading(response, self.states, moments, self.beside(moments)[3:])
        return replace(response, residual=response.residual + moments @ self.loaded(loads))

    def of_hub(self, outputs: sparse.csr_matrix) -> sparse.csr_matrix:
        """Weights (r, 3) by which the probes read the hub moments."""
        corner = self.projection.corner
        if corner is None:
            return sparse.csr_matrix((outputs.shape[0], 3))
        face = 3 * len(corner.places)
        return outputs[:, face + SEEN : face + READINGS]

    def loaded(self, loads: sparse.csr_matrix) -> np.ndarray:
        """Moments (3, k), m, of unit loads about the axle's centre."""
        return self.projection.wheel.rigid(loads)[:, MOMENTS].T

    @property
    def carried(self) -> np.ndarray:
        """Rows of all coordinates of which the axle feels the rates (Response.momentum)."""
        whole, tire = self.projection.carried, self.projection.momentum
        # The air moves with its own inertia, of which nothing is left out.
        tire = np.pad(tire, ((0, 0), (0, whole.shape[1] - tire.shape[1])))
        return np.vstack([whole, self.felt(tire)[3:]])

    def felt(self, moment: np.ndarray) -> np.ndarray:
        """Rows of which the axle feels the rates, of first moments (3, n) int rho u of the tire.

        These themselves, since convective parts cancel around the ring; or, with the doppler
        inertia, whose rate is that of a frame that turns with the wheel, the three parts (9, n) of

            (d/dt - Omega e_y x)^2 int rho u.
        """
        if self.inertia == "full" or self.speed == 0 or self.projection.moves:
            return moment
        swept = self.speed * ABOUT_AXLE @ moment
        return np.vstack([moment, -2 * swept, self.speed * ABOUT_AXLE @ swept])

    def beside(self, moments: sparse.csr_matrix) -> np.ndarray:
        """Rows that all coordinates carry besides: the momentum (3, m + a + c).

        Where hub `moments` (r, 3) are asked for, the rows A_0, A_1, A_2 of greens.response follow,
        (12, m + a + c).
        """
        carried = self.projection.carried
        if not moments.nnz:
            return carried
        return np.vstack([carried, *self.projection.moments(self.speed, self.inertia)])

    @property
    def coordinates(self) -> int:
        """Number of coordinates, m + a + c."""
        return self.projection.carried.shape[1]

    def seen(self, probes: sparse.csr_matrix) -> np.ndarray:
        """Readings of the probes per coordinate, (k, m + a + c) (modal.basis.Projection.seen)."""
        return self.projection.seen(self._of_modes(probes), probes)

    def face(self, nodes: int) -> np.ndarray:
        """Motion of the `nodes` of the outer face with all coordinates, (3 s, m + a + c).

        That of a wheel that moves is part of it: Phi eta + R xi (modal.corner), not Phi q.
        """
        return self.seen(sparse.identity(3 * nodes, format="csr"))

    def _of_modes(self, probes: sparse.csr_matrix) -> np.ndarray:
        """Readings of the probes per mode (k, m); columns of a corner's motions are skipped."""
        width = min(probes.shape[1], len(self.shape))
        return probes[:, :width] @ self.shape[:width]

    @property
    def held(self) -> Basis:
        """The coordinates with the rim held; the states are not those of a held rim."""
        corner = self.projection.corner and replace(self.projection.corner, axle=Axle.held())
        return replace(self, projection=replace(self.projection, corner=corner))


def regained(
    basis: Basis,
    true: np.ndarray,
    uniform: np.ndarray,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    full: Basis | None = None,
) -> Statics:
    """Static answers of the modes under true damping less those under the full matrices' damping.

    Added to the answers of the full matrices, they yield those of matrices that damp the modes
    truly and all other motions uniformly. `true`, `uniform`: K~ of both; `full`: the basis with what the
    probes are in the full matrices, if they are others there.
    """
    own = basis.projection.squares > 0
    flexible = np.pad(own, (0, len(true) - len(own)), constant_values=True)  # the air's are

    def statics(basis: Basis, stiffness: np.ndarray) -> Statics:
        seen = basis.seen(outputs)[:, flexible], basis.seen(loads)[:, flexible]
        carried = basis.beside(basis.of_hub(outputs))[:, flexible]
        return modal_statics(stiffness[np.ix_(flexible, flexible)], *seen, carried)

    both = zip(statics(basis, true), statics(full or basis, uniform), strict=True)
    return Statics(*(a - b for a, b in both))
