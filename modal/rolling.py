"""The states of a rolling tire: what its modes become as the wheel turns, and what they were made for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parallel import on_root
from tireroad.fem.turning import Turning
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.campbell import Campbell
from tireroad.modal.rotating import StateModes, matrices, rotating, standing


def pencil(projection: Projection, turning: Turning) -> tuple[np.ndarray, np.ndarray]:
    """D~ (1/s) and K~ (1/s2) of the projected problem."""
    return matrices(projection, turning.speed, turning.damping, turning.inertia)


@dataclass(frozen=True, kw_only=True)
class RollingModes:
    """The decoupled `states` on the fields of `basis`, for a wheel that moves as `turning` says.

    `full`: they are states of the full finite-element matrices, and the basis is of their own fields.
    `campbell`: eigenvalues over speed, where they were asked for.
    """

    basis: ModalBasis
    states: StateModes
    turning: Turning
    full: bool = False
    campbell: Campbell | None = None

    @property
    def highest(self) -> float:
        """Circular frequency of the highest mode, or full state, rad/s: what is left out lies beyond."""
        if self.full:
            return float(np.abs(self.states.eigenvalue.imag).max())
        return 2 * np.pi * float(self.basis.frequency[-1])


def rolling_modes(basis: ModalBasis, turning: Turning, comm) -> RollingModes:
    """The second eigenproblem on the modal basis; of a tire without air that stands, the closed
    formula. Collective."""
    return RollingModes(
        basis=basis, states=decouple(basis.projection, turning, comm), turning=turning
    )


def decouple(projection: Projection, turning: Turning, comm) -> StateModes:
    """The states of the projected problem, on every process. Collective."""
    if turning.speed == 0 and projection.air is None:
        return standing(projection, turning.damping)
    if turning.speed and projection.gyroscopic is None:
        raise InputError(
            "these modes were projected for a wheel that stands: project the rotation too"
        )
    given = pencil(projection, turning)
    # One process solves: LAPACK on another could order repeated eigenvalues differently.
    return on_root(comm, lambda: rotating(*given))
