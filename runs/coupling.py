"""Responses between chosen probes of a turning tire, with the wanted residual flexibility."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse

from fem.compliance import compliance, rotating_damping, rotating_stiffness, static_shapes
from fem.operators import Operators, Rotation
from fem.receptance import receptance
from greens.attachment import with_attachments
from greens.response import Response, couple
from greens.second_order import Moments, second_order
from modal.basis import Projection, project
from modal.rotating import StateModes, matrices, rotating, standing
from modal.undamped import Modes
from runs.mpi import on_root


@dataclass(frozen=True)
class Basis:
    """`shape` (3 s, m) of the outer face kg^-1/2, the projected matrices, and the decoupled states."""

    shape: np.ndarray
    projection: Projection
    states: StateModes

    def couple(self, outputs, loads, flexibility: np.ndarray | None = None) -> Response:
        """Response (r, k) of the probes `outputs` (r, 3 s) and `loads` (k, 3 s)."""
        momentum = self.projection.momentum
        return couple(self.states, outputs @ self.shape, loads @ self.shape, momentum, flexibility)


@dataclass(frozen=True)
class Wheel:
    """The full matrices of a tire that turns: `damping` is (gamma1 1/s, gamma2 s), `rotation` None
    when it stands. Its properties are collective at their first use."""

    operators: Operators
    rotation: Rotation | None
    speed: float
    damping: tuple[float, float]
    inertia: str

    @cached_property
    def rotating_stiffness(self):
        """K_Omega."""
        return rotating_stiffness(*self._given)

    @cached_property
    def rotating_damping(self):
        """D + 2 Omega G."""
        return rotating_damping(*self._given)

    @property
    def _given(self) -> tuple:
        return self.operators, self.rotation, self.speed, self.damping, self.inertia

    def respond(
        self,
        basis: Basis,
        modes: Modes | None,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        option: str,
    ) -> Response:
        """Response with the residual `option`; `modes` (all rows) for "attachment" only. Collective."""
        if option in ("static", "dirac"):
            flexibility = compliance(self.operators, self.rotating_stiffness, outputs, loads)
            return replace(basis.couple(outputs, loads, flexibility), pulse=option == "dirac")
        r, k = outputs.shape[0], loads.shape[0]
        same = outputs is loads
        probes = loads if same else sparse.vstack([outputs, loads], format="csr")
        shapes = static_shapes(
            self.operators, self.rotating_stiffness, self.rotating_damping, probes
        )
        if option == "attachment":
            grown = self._grown(modes, shapes.columns)
            whole = grown.couple(probes, probes, shapes.compliance)
        else:
            moments = Moments(shapes.compliance, shapes.damping, shapes.inertia, shapes.momentum)
            poles = basis.couple(probes, probes)
            carried = basis.projection.momentum
            whole = second_order(poles, basis.states, probes @ basis.shape, carried, moments)
        return whole if same else whole.between(slice(r), slice(r, r + k))

    def _grown(self, modes: Modes, columns: np.ndarray) -> Basis:
        """The basis with attachment modes. Collective."""
        operators, comm = self.operators, self.operators.body.comm
        grown = with_attachments(modes, operators.stiffness, operators.mass, columns, comm)
        projection = project(grown, self.rotation, operators.mass, comm)
        shape = operators.body.surface(operators.spread(grown.vectors))
        return Basis(
            shape.reshape(-1, len(grown.squares)), projection, self.decouple(projection, comm)
        )

    def decouple(self, projection: Projection, comm) -> StateModes:
        """The second eigenproblem, or the closed formula when the wheel stands. Collective."""
        if self.speed == 0:
            return standing(projection, self.damping)
        pencil = matrices(projection, self.speed, self.damping, self.inertia)
        # One process solves: LAPACK on another could order repeated eigenvalues differently.
        return on_root(comm, lambda: rotating(*pencil))

    def receptance(
        self, outputs: sparse.csr_matrix, loads: sparse.csr_matrix, frequency: np.ndarray
    ) -> np.ndarray:
        """H (f, r, k) m/N without any modes, at the frequencies in Hz. Collective."""
        full = self.rotating_stiffness, self.rotating_damping
        return receptance(self.operators, *full, outputs, loads, frequency)
