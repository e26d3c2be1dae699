"""A basis of decoupled states as probes on the outer face see it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from tireroad.fem.axle import Axle
from tireroad.greens.hub import reading
from tireroad.greens.residual.second_order import Moments, modal_moments
from tireroad.greens.response import Response, couple
from tireroad.modal.basis import Projection
from tireroad.modal.corner import MOMENTS, SEEN
from tireroad.modal.rolling import RollingModes
from tireroad.modal.rotating import StateModes

Array = np.ndarray
Probes = sparse.csr_matrix  # (k, 3 s) over the outer face, or (k, 3 s + 6) with the rim
Pencil = tuple[np.ndarray, np.ndarray]  # D~ and K~ of a projected problem


@dataclass(frozen=True, kw_only=True)
class Basis:
    """`shape` kg^-1/2 of the outer face (3 s, m), of a free rim after it (+ 6); the projected matrices;
    the decoupled states at `speed` rad/s.

    Probes are (k, 3 s) weights of the outer face; or wider: 6 more of a free rim's motion; of a corner's wheel
    and body 7 (modal.corner), and 3 more that read the moments on its hub.
    """

    shape: np.ndarray
    projection: Projection
    states: StateModes
    speed: float = 0.0

    @staticmethod
    def of(rolling: RollingModes) -> Basis:
        """The states of a rolling tire, as probes see them."""
        return Basis(
            shape=rolling.basis.shape,
            projection=rolling.basis.projection,
            states=rolling.states,
            speed=rolling.turning.speed,
        )

    def couple(
        self,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        flexibility: np.ndarray | None = None,
    ) -> Response:
        """Response (r, k) of the probes `outputs` and `loads`; with the exact static answers `flexibility` (r, k) its
        residual is what the states lack of them."""
        given = self.seen(outputs), self.seen(loads)
        response = couple(self.states, *given, self.projection.carried)
        wanted = self.of_hub(outputs)
        if wanted.nnz:
            response = reading(response, self.states, wanted, self.beside(wanted)[3:])
            direct = wanted @ self.loaded(loads)
            response = replace(response, residual=response.residual + direct)
        if flexibility is None:
            return response
        return replace(response, residual=flexibility - response.static())

    def of_hub(self, outputs: sparse.csr_matrix) -> sparse.csr_matrix:
        """By what weights (r, 3) the probes read the moments on the hub."""
        corner = self.projection.corner
        if corner is None:
            return sparse.csr_matrix((outputs.shape[0], 3))
        return outputs[:, 3 * len(corner.places) + SEEN :]

    def loaded(self, loads: sparse.csr_matrix) -> np.ndarray:
        """Moments (3, k) m of unit loads about the axle's centre."""
        return self.projection.wheel.rigid(loads)[:, MOMENTS].T

    def beside(self, wanted: sparse.csr_matrix) -> np.ndarray:
        """What all coordinates carry besides, (3, m + a + c): momentum; and where moments on the hub are `wanted` (r, 3) the
        rows A_0, A_1, A_2 of greens.hub after it, (12, m + a + c)."""
        carried = self.projection.carried
        if not wanted.nnz:
            return carried
        return np.vstack([carried, *self.projection.moments(self.speed)])

    @property
    def coordinates(self) -> int:
        """How many there are: m + a + c."""
        return self.projection.carried.shape[1]

    def seen(self, probes: sparse.csr_matrix) -> np.ndarray:
        """All coordinates (k, m + a + c) as the probes read them (modal.basis.Projection.seen)."""
        return self.projection.seen(self._of_modes(probes), probes)

    def _of_modes(self, probes: sparse.csr_matrix) -> np.ndarray:
        """What the probes see of the modes (k, m); a corner's own motions come after the outer face."""
        width = min(probes.shape[1], len(self.shape))
        return probes[:, :width] @ self.shape[:width]

    @property
    def held(self) -> Basis:
        """The coordinates with the rim held; the states are not theirs."""
        corner = self.projection.corner and replace(self.projection.corner, axle=Axle.held())
        return replace(self, projection=replace(self.projection, corner=corner))


def regained(
    basis: Basis,
    true: Pencil,
    uniform: Pencil,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
) -> Moments:
    """What the modes answer under their true damping beyond what they do under that of the full matrices.

    The moments of full matrices with it are those of matrices that damp the modes truly, and the rest
    uniformly. `true`, `uniform`: D~ and K~ of both.
    """
    own = basis.projection.squares > 0
    flexible = np.pad(own, (0, len(true[0]) - len(own)), constant_values=True)  # the air's are
    seen = basis.seen(outputs)[:, flexible], basis.seen(loads)[:, flexible]
    carried = basis.beside(basis.of_hub(outputs))[:, flexible]

    def moments(pencil: Pencil) -> Moments:
        drag, stiffness = (matrix[np.ix_(flexible, flexible)] for matrix in pencil)
        return modal_moments(drag, stiffness, *seen, carried)

    return moments(true).minus(moments(uniform))
