"""A compliance that is only a product, as PETSc's SNES VI takes it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from tireroad.contact.solver.grid_compliance import Compliance

Array = NDArray[np.float64]


class Product:
    """A over `unit` between some points, then as D_b A + D_a where the semismooth solver scales it."""

    def __init__(self, compliance: Compliance, unit: float, index: NDArray[np.intp]) -> None:
        self._compliance, self._unit, self._index = compliance, unit, index
        self._whole = np.zeros(len(compliance.diagonal))
        self._scale: Array | None = None
        self._added: Array | None = None

    def matrix(self) -> PETSc.Mat:
        """The PETSc matrix, on this process."""
        size = len(self._index)
        made = PETSc.Mat().createPython((size, size), self, comm=PETSc.COMM_SELF)
        made.setUp()
        return made

    def reset(self) -> None:
        """Back to A."""
        self._scale = self._added = None

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = (D_b A + D_a) x."""
        out = self._through(self._compliance.apply, x.array_r) / self._unit
        if self._scale is not None:
            out = self._scale * out
        y.array[:] = out if self._added is None else out + self._added * x.array_r

    def multTranspose(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = (A D_b + D_a) x: for the slope of the merit function, which may leave out A's skew part."""
        scaled = x.array_r if self._scale is None else self._scale * x.array_r
        out = self._through(self._compliance.apply, scaled) / self._unit
        y.array[:] = out if self._added is None else out + self._added * x.array_r

    def diagonalScale(self, _matrix: PETSc.Mat, left: PETSc.Vec, _right: PETSc.Vec) -> None:
        """D_b."""
        self._scale = left.array_r.copy()

    def setDiagonal(self, _matrix: PETSc.Mat, diagonal: PETSc.Vec, _mode: object) -> None:
        """D_a, added."""
        self._added = diagonal.array_r.copy()

    def createSubMatrix(
        self, _matrix: PETSc.Mat, rows: PETSc.IS, _columns: PETSc.IS, _out: PETSc.Mat | None = None
    ) -> PETSc.Mat:
        """Between some of the points; the solver asks for as many columns as rows."""
        return Product(self._compliance, self._unit, self._index[rows.indices]).matrix()

    def roughly_inverse(self, right: Array) -> Array:
        """A preconditioner: the compliance's own, or the diagonal once it is scaled."""
        if self._scale is None:
            return self._through(self._compliance.precondition, right) * self._unit
        own = np.broadcast_to(self._compliance.diagonal, self._whole.shape)[self._index]
        added = 0.0 if self._added is None else self._added
        return right / (self._scale * own / self._unit + added)

    def _through(self, product: Callable[[Array], Array], values: Array) -> Array:
        self._whole[:] = 0.0
        self._whole[self._index] = values
        return product(self._whole)[self._index]


class Preconditioner:
    """What PETSc calls for the operator it has."""

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y, roughly the operator's inverse of x."""
        y.array[:] = pc.getOperators()[0].getPythonContext().roughly_inverse(x.array_r)
