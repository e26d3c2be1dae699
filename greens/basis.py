"""A basis of decoupled states as probes on the outer face see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tireroad.greens.response import Response, couple
from tireroad.greens.second_order import Moments, modal_moments
from tireroad.modal.basis import Projection
from tireroad.modal.rolling import RollingModes
from tireroad.modal.rotating import StateModes

Pencil = tuple[np.ndarray, np.ndarray]  # D~ and K~ of a projected problem


@dataclass(frozen=True)
class Basis:
    """`shape` kg^-1/2 of the outer face (3 s, m), of a free rim after it (+ 6); the projected matrices;
    the decoupled states.
    """

    shape: np.ndarray
    projection: Projection
    states: StateModes

    @staticmethod
    def of(rolling: RollingModes) -> Basis:
        """The states of a rolling tire, as probes see them."""
        return Basis(rolling.basis.shape, rolling.basis.projection, rolling.states)

    def couple(self, outputs, loads, flexibility: np.ndarray | None = None) -> Response:
        """Response (r, k) of the probes `outputs` (r, 3 s) and `loads` (k, 3 s), or 3 s + 6 wide."""
        carried = self.projection.carried
        return couple(self.states, self.seen(outputs), self.seen(loads), carried, flexibility)

    def seen(self, probes: sparse.csr_matrix) -> np.ndarray:
        """The coordinates (k, m + a) as the probes read them: the air's are not seen."""
        seen = probes @ self.shape[: probes.shape[1]]
        air = self.projection.air
        return seen if air is None else np.pad(seen, ((0, 0), (0, air.count)))


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
