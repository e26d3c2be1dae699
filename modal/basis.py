"""The rotating-frame matrices on the basis of undamped modes: small, replicated, and free of speed."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from tireroad.fem.cavity.column import Column
from tireroad.modal.air import Air
from tireroad.modal.solver.fields import CHUNK, gram, multiply
from tireroad.modal.solver.modes import Modes
from tireroad.modal.waves import Labels


@dataclass(frozen=True)
class Projection:
    """Phi^T X Phi of the matrices with Omega taken out (physics of the rotating frame).

    `squares` (m,) omega^2; `gyroscopic`, `body` (m, m) 1/rad skew; `convective`, `body_convective`
    (m, m) 1/rad2 symmetric, all four None for a wheel that stands; `momentum` (3, m) kg^1/2:
    int rho phi_k, the mass each mode moves; `loss_factor` (m,) by strain energy (modal.damping), None where
    no compound has one. `air`: what else takes part, a coordinates after the m.
    """

    squares: np.ndarray
    momentum: np.ndarray
    gyroscopic: np.ndarray | None = None
    convective: np.ndarray | None = None
    body: np.ndarray | None = None
    body_convective: np.ndarray | None = None
    loss_factor: np.ndarray | None = None
    air: Air | None = None

    @property
    def carried(self) -> np.ndarray:
        """Momentum (3, m + a) kg^1/2 per rate of all coordinates, the air's last."""
        if self.air is None:
            return self.momentum
        return np.hstack([self.momentum, self.air.duct.momentum])

    @property
    def own(self) -> int:
        """Coordinates of the tire itself, m."""
        return len(self.squares)

    def first(self, count: int) -> Projection:
        """On the first `count` modes alone."""
        cut = {"squares": self.squares[:count], "momentum": self.momentum[:, :count]}
        for item in fields(self):
            values = getattr(self, item.name)
            if item.name not in cut and isinstance(values, np.ndarray):
                cut[item.name] = np.ascontiguousarray(values[(slice(count),) * values.ndim])
        if self.air is not None:
            cut["air"] = replace(self.air, coupling=self.air.coupling[:, :count])
        return replace(self, **cut)

    def among(self, wanted: np.ndarray) -> Projection:
        """On the coordinates where `wanted` (m,) is true, before any air joins them."""
        small = {
            name: None if value is None else value[np.ix_(*[wanted] * value.ndim)]
            for name, value in vars(self).items()
            if name not in ("momentum", "air")
        }
        return Projection(momentum=self.momentum[:, wanted], **small)


@dataclass(frozen=True, kw_only=True)
class ModalBasis:
    """The standing modes as all later steps take them: m fields, M-orthonormal.

    `frequency` (m,) Hz; `shape` kg^-1/2 of the outer face (3 s, m), of a free rim after it (+ 6);
    `projection` the small matrices on these very fields. `modes`: the fields on all unknowns, where
    this process solved for them and they are not read from a file; `labels` of a round tire;
    `column`: the air that joined them, where this process made it. Signs of eigenvectors, and vectors
    of repeated frequencies, are of one solution only: never combine two bases' parts.
    """

    frequency: np.ndarray
    shape: np.ndarray
    projection: Projection
    modes: Modes | None = None
    labels: Labels | None = None
    column: Column | None = None

    def first(self, count: int) -> ModalBasis:
        """The first `count` modes."""
        return ModalBasis(
            frequency=self.frequency[:count],
            shape=self.shape[:, :count],
            projection=self.projection.first(count),
            modes=self.modes and self.modes.first(count),
            labels=self.labels and self.labels.first(count),
            column=self.column,
        )


def project(
    modes: Modes, rotation, carried: np.ndarray, comm, known: Projection | None = None, loss=None
) -> Projection:
    """Project the rotation matrices (fem.operators.Rotation, or None) and the momentum: `carried` (3, n)
    kg of own rows, as in fem.operators. `known`, the projection on the first of the modes, is taken
    over: a basis that grows costs the products with what joins it. `loss`: the loss stiffness of
    fem.operators, or None. Collective.
    """
    moved = comm.allreduce(carried @ modes.vectors)
    losing = None if loss is None else _loss_factors(modes, loss, comm, known)
    if rotation is None:
        return Projection(modes.squares, moved, loss_factor=losing)

    def reduced(name: str, sign: int) -> np.ndarray:
        old = None if known is None else getattr(known, name)
        return _reduced(comm, modes.vectors, getattr(rotation, name), sign, old)

    return Projection(
        modes.squares,
        moved,
        reduced("gyroscopic", -1),
        reduced("convective", 1),
        reduced("body", -1),
        reduced("body_convective", 1),
        losing,
    )


def with_air(projection: Projection, modes: Modes, air: Column | None) -> Projection:
    """The projection on the modes (all rows), joined by the air where there is any. Collective."""
    if air is None:
        return projection
    return replace(projection, air=Air(air.duct, air.coupling(modes.vectors)))


def _loss_factors(modes: Modes, loss, comm, known: Projection | None) -> np.ndarray:
    """eta_k = phi . sum_r eta_r K_r phi / omega_k^2 (m,) of modes of unit mass; 0 of rigid ones. Collective."""
    done = np.zeros(0) if known is None else known.loss_factor
    lost = np.empty(modes.vectors.shape[1] - len(done))
    for start in range(0, len(lost), CHUNK):
        some = modes.vectors[:, len(done) + start : len(done) + start + CHUNK]
        lost[start : start + CHUNK] = (some * multiply(loss, some)).sum(axis=0)
    squares = modes.squares[len(done) :]
    eta = np.divide(comm.allreduce(lost), squares, out=np.zeros(len(squares)), where=squares > 0)
    return np.concatenate([done, eta])


def _reduced(comm, vectors: np.ndarray, matrix, sign: int, known: np.ndarray | None) -> np.ndarray:
    """V^T X V (m, m), symmetric (sign 1) or skew (-1); `known` (k, k) is its upper left part."""
    m, k = vectors.shape[1], 0 if known is None else len(known)
    out = np.empty((m, m))
    out[:, k:] = gram(comm, vectors, multiply(matrix, vectors[:, k:]))
    own = out[k:, k:]
    out[k:, k:] = (own + sign * own.T) / 2
    out[k:, :k] = sign * out[:k, k:].T
    if known is not None:
        out[:k, :k] = known
    return out
