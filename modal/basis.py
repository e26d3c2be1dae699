"""The rotating-frame matrices on the basis of undamped modes: small, replicated, and free of speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from modal.fields import gram, multiply
from modal.undamped import Modes


@dataclass(frozen=True)
class Projection:
    """Phi^T X Phi of the matrices with Omega taken out (physics of the rotating frame).

    `squares` (m,) omega^2; `gyroscopic`, `body` (m, m) 1/rad skew; `convective`, `body_convective`
    (m, m) 1/rad2 symmetric, all four None for a wheel that stands; `momentum` (3, m) kg^1/2:
    int rho phi_k, the mass each mode moves.
    """

    squares: np.ndarray
    momentum: np.ndarray
    gyroscopic: np.ndarray | None = None
    convective: np.ndarray | None = None
    body: np.ndarray | None = None
    body_convective: np.ndarray | None = None


def project(modes: Modes, rotation, carried: np.ndarray, comm) -> Projection:
    """Project the rotation matrices (fem.operators.Rotation, or None) and the momentum: `carried` (3, n)
    kg of own rows, as in fem.operators. Collective.
    """
    vectors = modes.vectors

    def reduced(matrix):
        return gram(comm, vectors, multiply(matrix, vectors))

    def skew(matrix):
        return (matrix - matrix.T) / 2

    def symmetric(matrix):
        return (matrix + matrix.T) / 2

    moved = comm.allreduce(carried @ vectors)
    if rotation is None:
        return Projection(modes.squares, moved)
    return Projection(
        modes.squares,
        moved,
        skew(reduced(rotation.gyroscopic)),
        symmetric(reduced(rotation.convective)),
        skew(reduced(rotation.body)),
        symmetric(reduced(rotation.body_convective)),
    )
