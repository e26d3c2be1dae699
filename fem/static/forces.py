"""Assembled residual and tangent of one body at its present displacement, without a road."""

from __future__ import annotations

import math

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from tireroad.fem import compat
from tireroad.fem.static.curved.unrolled import Unrolled
from tireroad.fem.static.drag import Drag
from tireroad.fem.static.shape_damping import ShapeDamping
from tireroad.fem.static.virtual_work import (
    Rolling,
    inverted_volume,
    static_residual,
    stress_prediction,
    tangent,
)
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body


class Forces:
    """All forces except those of the road. Forms and matrix are created once. Collective.

    `pressure` (Pa) may be changed; `cost`: seconds by part; `drag`: springs that slow the body
    during a snap.
    """

    def __init__(self, body: Body, rolling: Rolling) -> None:
        self.body, self.rolling = body, rolling
        self.cost = Timing()
        self.drag: Drag | None = None
        self.pressure = fem.Constant(body.mesh, 0.0)
        self._before = fem.Function(body.space)
        residual = static_residual(body, self.pressure, rolling)
        self._damping: ShapeDamping | None = None
        if rolling.speed * rolling.stiffness_damping:
            self._damping = ShapeDamping(body, self.pressure, rolling)
            residual += self._damping.work
        self._residual = compat.form(residual)
        self._tangent = compat.form(tangent(body, residual) + stress_prediction(body, self._before))
        self._inverted = compat.form(inverted_volume(body))
        self._clamp = [body.clamp()]
        self._local_tangent = fem.petsc.create_matrix(self._tangent)
        self.matrix = self._local_tangent
        self._work = compat.force_vector(self._residual, body.space)
        self._rim = (3 * body.rim[body.rim < body.nodes, None] + np.arange(3)).ravel()

    @property
    def lag(self) -> float:
        """Most of an error that a Newton step leaves because its tangent is incomplete."""
        return self._damping.lag if self._damping else 0.0

    @property
    def rounds(self) -> int:
        """Solutions of a linear problem that complete it to 1e-9: 1 with a complete tangent."""
        return 1 + math.ceil(math.log(1e-9) / math.log(self.lag)) if self.lag else 1

    def lacking(self, change: np.ndarray, along: Unrolled | None) -> np.ndarray:
        """Forces (N) of a `change` (m) that the tangent lacks, both in the road's coordinates
        `along` or the wheel's axes. Collective."""
        if not (self._damping and self.lag):
            return np.zeros_like(change)
        forces = self._damping.lacking(change if along is None else along.spread(change))
        if along is not None:
            along.turn(forces)
        return forces

    def _assemble_residual(self) -> np.ndarray:
        """Residual forces at the owned dofs, N; 0 on the rim, where the wheel takes them."""
        if self._damping:
            self._damping.update()
        with self._work.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._work, self._residual)
        self._work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        if self.drag:
            self.drag.add_to(self._work.array)
        self._work.array[self._rim] = 0.0
        return self._work.array_r

    def _assemble_tangent(self) -> None:
        self._local_tangent.zeroEntries()
        fem.petsc.assemble_matrix(self._local_tangent, self._tangent, bcs=self._clamp)
        self._local_tangent.assemble()
        if self.drag:
            self.drag.stiffen(self._local_tangent)
        if self._damping:
            self.matrix = self._damping.completed(self._local_tangent)

    def _inside_out(self) -> bool:
        """Whether det F <= 0 at some Gauss point: the energy does not distinguish J from -J."""
        return self.body.comm.allreduce(fem.assemble_scalar(self._inverted)) > 0
