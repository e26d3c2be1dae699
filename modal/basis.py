"""The rotating-frame matrices on the basis of undamped modes: small, replicated, and free of speed."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.cavity.column import Column
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Rotation
from tireroad.modal.air import Air
from tireroad.modal.corner import Corner
from tireroad.modal.solver.fields import loss_factors, projected
from tireroad.modal.solver.modes import Modes
from tireroad.modal.waves import Labels

_SAME = 1e-9  # of the largest trace: two solutions of the same modes differ by their sign at least


@dataclass(frozen=True, kw_only=True)
class Projection:
    """Phi^T X Phi of the matrices with Omega taken out (physics of the rotating frame).

    `squares` (m,) omega^2; `gyroscopic`, `body` (m, m) 1/rad skew; `convective`, `body_convective`
    (m, m) 1/rad2 symmetric, all four None for a wheel that stands; `momentum` (3, m) kg^1/2:
    int rho phi_k, the mass each mode moves; `loss_factor` (m,) by strain energy (modal.damping), None where
    no compound has one. The last `shapes` of the m are static shapes that joined the modes (modal.joined). What else
    takes part: `air`, a coordinates after the m, and a `corner`, c after them, none of a wheel that is held, whose hub
    yet carries moments.
    """

    squares: np.ndarray
    momentum: np.ndarray
    gyroscopic: np.ndarray | None = None
    convective: np.ndarray | None = None
    body: np.ndarray | None = None
    body_convective: np.ndarray | None = None
    loss_factor: np.ndarray | None = None
    shapes: int = 0
    air: Air | None = None
    corner: Corner | None = None

    @property
    def carried(self) -> np.ndarray:
        """Momentum (3, m + a + c) kg^1/2 per rate of all coordinates: of all that the hub has to move."""
        if not self.moves:
            return self.inside
        return self.wheel.carried(self.inside, self.air_mass) @ self._change

    @property
    def inside(self) -> np.ndarray:
        """Momentum (3, m + a) kg^1/2 per rate of tire and air against the rim."""
        return (
            self.momentum
            if self.air is None
            else np.hstack([self.momentum, self.air.duct.momentum])
        )

    def pencil(
        self, drag: np.ndarray, stiffness: np.ndarray, speed: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """D~ (1/s) and K~ (1/s2) of all coordinates, unit mass, from those of tire and air, (m + a, m + a)."""
        if not self.moves:
            return drag, stiffness
        turn, joined = self._change, self.wheel.joined(drag, stiffness, speed)
        return turn.T @ joined[0] @ turn, turn.T @ joined[1] @ turn

    def seen(self, shapes: np.ndarray, probes: sparse.csr_matrix) -> np.ndarray:
        """All coordinates (k, m + a + c) as `probes` read them, `shapes` (k, m) being what they see of the modes:
        the air's are not seen.
        """
        seen = shapes if self.air is None else np.pad(shapes, ((0, 0), (0, self.air.count)))
        return self.wheel.seen(seen, probes) @ self._change if self.moves else seen

    def moments(self, speed: float) -> np.ndarray:
        """The rows (3, 3, m + a + c) of `Corner.moments` on all coordinates."""
        rows = self.wheel.moments(self.inside.shape[1], speed)
        return rows @ self._change if self.moves else rows

    @property
    def moves(self) -> bool:
        """Whether there is a corner that lets the wheel move."""
        return self.corner is not None and self.corner.count > 0

    @property
    def wheel(self) -> Corner:
        """The corner, of which there must be one."""
        assert self.corner is not None, "nothing is known of this tire's rim"
        return self.corner

    @property
    def adrift(self) -> np.ndarray:
        """Orthonormal motions (m + a + c, r) of a corner that meet neither stiffness nor damping."""
        if not self.moves:
            return np.zeros((self.inside.shape[1], 0))
        return self.wheel.adrift(*self._moved)

    @property
    def air_mass(self) -> float:
        """Of what the rim carries along besides the tire, kg."""
        return 0.0 if self.air is None else self.air.duct.density * self.air.duct.volume

    @property
    def rim_momentum(self) -> np.ndarray:
        """P (7, m + a) kg^1/2 of a corner."""
        return self.wheel.momentum(None if self.air is None else self.air.duct.momentum)

    @property
    def _moved(self) -> tuple[np.ndarray, float]:
        return self.rim_momentum, self.air_mass

    @property
    def _change(self) -> np.ndarray:
        return self.wheel.change(*self._moved)

    @property
    def own(self) -> int:
        """Coordinates of the tire itself, m."""
        return len(self.squares)

    @property
    def modes(self) -> int:
        """How many of the coordinates are modes: the first ones."""
        return self.own - self.shapes

    def rotating(self, inertia: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Factors (m, m) of 2 Omega, Omega^2 and Omega d_k. InputError for the modes of a wheel that stands."""
        full = inertia == "full"
        gyroscopic = self.gyroscopic if full else self.body
        convective = self.convective if full else self.body_convective
        if gyroscopic is None or convective is None or self.body is None:
            raise InputError("modes: these are of a standing wheel and have no rotating states")
        return gyroscopic, convective, self.body

    def first(self, count: int) -> Projection:
        """On the first `count` coordinates alone."""
        cut: dict[str, Any] = {
            "squares": self.squares[:count],
            "momentum": self.momentum[:, :count],
            "shapes": max(0, count - self.modes),
        }
        for item in fields(self):
            values = getattr(self, item.name)
            if item.name not in cut and isinstance(values, np.ndarray):
                cut[item.name] = np.ascontiguousarray(values[(slice(count),) * values.ndim])
        if self.air is not None:
            cut["air"] = replace(self.air, coupling=self.air.coupling[:, :count])
        if self.corner is not None:
            cut["corner"] = self.corner.first(count)
        return replace(self, **cut)

    def among(self, wanted: np.ndarray) -> Projection:
        """On the coordinates where `wanted` (m,) is true, before anything joins them."""
        small: dict[str, Any] = {
            name: None if value is None else value[np.ix_(*[wanted] * value.ndim)]
            for name, value in vars(self).items()
            if name not in ("momentum", "shapes", "air", "corner")
        }
        shapes = int(np.count_nonzero(wanted[self.modes :]))
        return Projection(momentum=self.momentum[:, wanted], shapes=shapes, **small)


@dataclass(frozen=True, kw_only=True)
class ModalBasis:
    """The standing modes as all later steps take them: fields, M-orthonormal.

    `frequency` (m,) Hz; `shape` kg^-1/2 of the outer face (3 s, m + k), of a free rim after it (+ 6), k static shapes
    that joined the m modes among them (modal.turning_shapes); `projection` the small matrices on these very fields.
    `modes`: the fields on all unknowns, where this process solved for them and they are not read from a file; `labels` of a round tire;
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
        """The first `count` modes, no more than there are, without any shapes."""
        count = min(count, len(self.frequency))
        return ModalBasis(
            frequency=self.frequency[:count],
            shape=self.shape[:, :count],
            projection=self.projection.first(count),
            modes=self.modes and self.modes.first(count),
            labels=self.labels and self.labels.first(count),
            column=self.column,
        )


def same_fields(found: np.ndarray, known: np.ndarray) -> bool:
    """Whether shapes on the outer face (s, m) are of one solution: another one's signs and vectors of repeated
    frequencies differ."""
    return found.shape == known.shape and np.allclose(found, known, 0, _SAME * np.abs(known).max())


def project(
    modes: Modes,
    rotation: Rotation | None,
    carried: np.ndarray,
    comm: MPI.Comm,
    known: Projection | None = None,
    loss: PETSc.Mat | None = None,
) -> Projection:
    """Project the rotation matrices (fem.operators.Rotation, or None) and the momentum: `carried` (3, n)
    kg of own rows, as in fem.operators. `known`, the projection on the first of the modes, is taken
    over: a basis that grows costs the products with what joins it. `loss`: the loss stiffness of
    fem.operators, or None. Collective.
    """
    moved = comm.allreduce(carried @ modes.vectors)
    shapes = len(modes.squares) - modes.count
    done = None if known is None else known.loss_factor
    losing = None if loss is None else loss_factors(modes, loss, comm, done)
    if rotation is None:
        return Projection(squares=modes.squares, momentum=moved, loss_factor=losing, shapes=shapes)

    def reduced(name: str, sign: int) -> np.ndarray:
        old = None if known is None else getattr(known, name)
        return projected(comm, modes.vectors, getattr(rotation, name), sign, old)

    return Projection(
        squares=modes.squares,
        momentum=moved,
        gyroscopic=reduced("gyroscopic", -1),
        convective=reduced("convective", 1),
        body=reduced("body", -1),
        body_convective=reduced("body_convective", 1),
        loss_factor=losing,
        shapes=shapes,
    )
