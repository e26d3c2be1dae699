"""A drag on the body of an equilibrium problem: what holds it back on its fall through a snap."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from tireroad.fem.tire.body import Body


class Drag:
    """Springs `stiffness` (owned unknowns,) N/m between the body's present place and that in which it is to be soon."""

    def __init__(self, body: Body, stiffness: float) -> None:
        """In proportion to the nodes' mass, of `stiffness` (N/m) an unknown in the mean. Collective."""
        mass = body.nodal_mass()
        total, count = body.comm.allreduce(np.array([mass.sum(), len(mass)]))
        self._field = body.u.x
        self.stiffness = stiffness * mass * (count / total)
        self.here()

    def here(self) -> None:
        """Hold the body back from where it is now."""
        self._place = self._field.array[: len(self.stiffness)].copy()

    def add_to(self, out: np.ndarray) -> None:
        """Add the springs' forces (N) at the owned unknowns."""
        out += self.stiffness * (self._field.array[: len(out)] - self._place)

    def stiffen(self, tangent: PETSc.Mat) -> None:
        """Add the springs to the tangent. Collective."""
        diagonal = tangent.getDiagonal()
        diagonal.array[:] += self.stiffness
        tangent.setDiagonal(diagonal)
