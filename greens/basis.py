"""A basis of decoupled states as probes on the outer face see it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

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
        """Response (r, k) of the probes `outputs` and `loads`."""
        carried = self.projection.carried
        given = self.seen(outputs), self.seen(loads)
        response = couple(self.states, *given, carried, flexibility)
        corner = self.projection.corner
        wanted = (
            outputs[:, 3 * len(corner.places) + SEEN :] if corner else sparse.csr_matrix((0, 0))
        )
        return self._reading_moments(response, wanted, loads) if wanted.nnz else response

    def _reading_moments(
        self, response: Response, wanted: sparse.csr_matrix, loads: sparse.csr_matrix
    ) -> Response:
        """The response whose outputs `wanted` (r, 3) read the moments on the hub besides."""
        rows, states = self.projection.moments(self.speed), self.states
        s, block = states.eigenvalue, states.block
        by_state, by_block = np.zeros((3, len(s)), complex), np.zeros((3, len(block)))
        powered = states.block_right
        for k, part in enumerate(rows):
            by_state -= (part @ states.right) * s**k
            by_block -= part @ powered
            powered = powered @ block
        moment = self.projection.wheel.rigid(loads)[:, MOMENTS] - self.seen(loads) @ rows[2].T
        return replace(
            response,
            output=response.output + wanted @ by_state,
            block_output=response.block_output + wanted @ by_block,
            residual=response.residual + wanted @ moment.T,
        )

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
        return replace(self, projection=replace(self.projection, corner=None))


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
    carried = basis.projection.carried[:, flexible]

    def moments(pencil: Pencil) -> Moments:
        drag, stiffness = (matrix[np.ix_(flexible, flexible)] for matrix in pencil)
        return modal_moments(drag, stiffness, *seen, carried)

    return moments(true).minus(moments(uniform))
