"""A compliance given as a product, in the form that PETSc's SNES VI needs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from tireroad.contact.solver.grid_compliance import Compliance

Array = NDArray[np.float64]


class Product:
    """A over `unit` between some points, or D_b A + D_a after scaling by the semismooth solver."""

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
        """Remove the scaling, back to A."""
        self._scale = self._added = None

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = (D_b A + D_a) x."""
        out = self._through(self._compliance.apply, x.array_r) / self._unit
        if self._scale is not None:
            out = self._scale * out
        y.array[:] = out if self._added is None else out + self._added * x.array_r

    def multTranspose(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = (A D_b + D_a) x, for the merit function's slope; A's skew part may be neglected."""
        scaled = x.array_r if self._scale is None else self._scale * x.array_r
        out = self._through(self._compliance.apply, scaled) / self._unit
        y.array[:] = out if self._added is None else out + self._added * x.array_r

    def diagonalScale(self, _matrix: PETSc.Mat, left: PETSc.Vec, _right: PETSc.Vec) -> None:
        """Set D_b."""
        self._scale = left.array_r.copy()

    def setDiagonal(self, _matrix: PETSc.Mat, diagonal: PETSc.Vec, _mode: object) -> None:
        """Set D_a, which is added."""
        self._added = diagonal.array_r.copy()

    def createSubMatrix(
        self, _matrix: PETSc.Mat, rows: PETSc.IS, _columns: PETSc.IS, _out: PETSc.Mat | None = None
    ) -> PETSc.Mat:
        """A between some of the points; the solver requests as many columns as rows."""
        return Product(self._compliance, self._unit, self._index[rows.indices]).matrix()

    def roughly_inverse(self, right: Array) -> Array:
        """A preconditioner: the compliance's own, or the diagonal once A is scaled."""
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
    """The preconditioner that PETSc calls for its current operator."""

    def apply(self, pc: PETSc.PC, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y: approximately the inverse of the operator times x."""
        y.array[:] = pc.getOperators()[0].getPythonContext().roughly_inverse(x.array_r)
