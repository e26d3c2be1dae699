"""The states of a rolling tire, and the wheel's motion that they were computed for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.parallel import on_root
from tireroad.fem.turning import Turning
from tireroad.modal.adrift import beside
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.campbell import Campbell
from tireroad.modal.rotating import (
    DEFECTIVE,
    StateModes,
    checks,
    matrices,
    rotating,
    standing,
)

# Conditions above which vectors count as defective. Where the checks fail, a lower limit moves more
# states into the block (observed beside the rigid motions of a free rim with air, on two processes
# of three).
_CONDITIONS = DEFECTIVE, 1e4, 1e2


def pencil(projection: Projection, turning: Turning) -> tuple[np.ndarray, np.ndarray]:
    """D~ (1/s) and K~ (1/s2) of the projected problem."""
    return matrices(projection, turning.speed, turning.damping, turning.inertia)


@dataclass(frozen=True, kw_only=True)
class RollingModes:
    """The decoupled `states` on the fields of `basis`, for a wheel that moves as `turning` says.

    `full`: these are states of the full finite-element matrices, and the basis consists of their
    own fields. `campbell`: eigenvalues over speed, where requested. `figures`: how accurately the
    states satisfy the problem that they solve (modal.rotating.checks).
    """

    basis: ModalBasis
    states: StateModes
    turning: Turning
    full: bool = False
    campbell: Campbell | None = None
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def highest(self) -> float:
        """Circular frequency of the highest mode or full state, rad/s; truncation begins there."""
        if self.full:
            return float(np.abs(self.states.eigenvalue.imag).max())
        return 2 * np.pi * float(self.basis.frequency[-1])


def rolling_modes(basis: ModalBasis, turning: Turning, comm: MPI.Comm) -> RollingModes:
    """The second eigenproblem on the modal basis; in closed form for a standing tire without air.
    Collective.
    """
    states, figures = _decoupled(basis.projection, turning, comm)
    return RollingModes(basis=basis, states=states, turning=turning, figures=figures)


def decouple(projection: Projection, turning: Turning, comm: MPI.Comm) -> StateModes:
    """The states of the projected problem, on every process, with their identities checked.
    Collective.
    """
    return _decoupled(projection, turning, comm)[0]


def _decoupled(projection: Projection, turning: Turning, comm: MPI.Comm) -> tuple[StateModes, dict]:
    """The states, and the figures of modal.rotating.checks. Collective."""
    if turning.speed == 0 and projection.air is None and not projection.moves:
        return standing(projection, turning.damping), {}
    if turning.speed and projection.gyroscopic is None:
        raise InputError(
            "these modes were projected for a standing wheel: project the rotation too"
        )
    if projection.moves:
        projection.wheel.check(turning.speed)
    given, adrift = pencil(projection, turning), projection.adrift

    def solve() -> tuple[StateModes, dict]:
        if adrift.shape[1]:
            states = beside(*given, adrift)
            return states, checks(states, *given)
        for condition in _CONDITIONS:
            states = rotating(*given, condition)
            try:
                return states, checks(states, *given)
            except ConvergenceError as error:
                failed = error
        raise failed

    # Only one process solves, because LAPACK on another could order repeated eigenvalues
    # differently.
    return on_root(comm, solve)
