"""Springs to the current position that slow the motion of a body through a snap."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from tireroad.fem.tire.body import Body


class Drag:
    """Springs of `stiffness` (owned unknowns,) N/m to the displacement at the last `here`."""

    def __init__(self, body: Body, stiffness: float) -> None:
        """Proportional to nodal mass, with mean `stiffness` (N/m) per unknown. Collective."""
        mass = body.nodal_mass()
        total, count = body.comm.allreduce(np.array([mass.sum(), len(mass)]))
        self._field = body.u.x
        self.stiffness = stiffness * mass * (count / total)
        self.here()

    def here(self) -> None:
        """Anchor the springs at the current displacement."""
        self._place = self._field.array[: len(self.stiffness)].copy()

    def add_to(self, out: np.ndarray) -> None:
        """Add the springs' forces (N) at the owned unknowns."""
        out += self.stiffness * (self._field.array[: len(out)] - self._place)

    def stiffen(self, tangent: PETSc.Mat) -> None:
        """Add the springs to the tangent. Collective."""
        diagonal = tangent.getDiagonal()
        diagonal.array[:] += self.stiffness
        tangent.setDiagonal(diagonal)
