"""Unilateral contact by PETSc's SNESVI, a second method for the same problem."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from tireroad.contact.solver.conditions import (
    TOLERANCE,
    check_residual,
    checked_compliance,
    complementarity_residual,
    penetration,
)
from tireroad.contact.solver.projected_cg import Compliance, MatrixCompliance
from tireroad.fem.errors import ConvergenceError

Array = NDArray[np.float64]

Mask = NDArray[np.bool_]
PREFIX = "contact_"
MAX_ITERATIONS = 200


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
        shell = PETSc.Mat().createPython((size, size), self, comm=PETSc.COMM_SELF)
        shell.setUp()
        return shell

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


class SnesVI:
    """Reduced-space Newton (vinewtonrsls) for f >= 0, A (f - f_ref) + q >= 0, on this process.

    PETSc gets the problem without units, A / max diag(A) and q / max |q|, because SNES VI's own
    tolerance for active bounds is absolute. PETSc options with the prefix `contact_` are read last
    and take precedence: `-contact_snes_type vinewtonssls` is the semismooth method, which takes
    several times the steps and yields the same forces. A matrix is factorised in every Newton step;
    a product (thousands of points) is solved by GMRES, preconditioned by the tread's inverse, and
    never assembled. The line search can fail if the skew part of A outweighs the symmetric one; the
    tire's does not. Sources: Benson and Munson, Optim. Methods Softw. 21 (2006) 575; Munson,
    Facchinei, Ferris, Fischer and Kanzow, INFORMS J. Comput. 13 (2001) 294.
    """

    def __init__(self, matrix: Array | Compliance) -> None:
        if isinstance(matrix, np.ndarray):
            matrix = MatrixCompliance(checked_compliance(matrix))
        self._compliance = matrix
        n = len(matrix.diagonal)
        self.diagonal = matrix.diagonal.copy()
        self._unit = float(self.diagonal.max())
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self.penetration = 0.0
        self.residual = 0.0
        self.iterations = 0
        self.factorisations = 0
        self._offset = np.zeros(n)
        self._make_jacobian(n)
        self._make_vectors(n)
        self._make_snes()

    def _make_jacobian(self, n: int) -> None:
        every = np.arange(n)
        self._product = None
        if isinstance(self._compliance, MatrixCompliance):
            # Row-major: petsc4py interprets a column-major matrix as its transpose.
            self._dense = np.ascontiguousarray(self._compliance.block(every, every)) / self._unit
            self._jacobian = PETSc.Mat().createDense((n, n), comm=PETSc.COMM_SELF)
            self._jacobian.setUp()
        else:
            self._product = Product(self._compliance, self._unit, every)
            self._jacobian = self._product.matrix()

    def _make_vectors(self, n: int) -> None:
        self._force = PETSc.Vec().createSeq(n, comm=PETSc.COMM_SELF)
        self._function = self._force.duplicate()
        self._bounds = self._force.duplicate(), self._force.duplicate()
        self._bounds[0].set(0.0)
        self._bounds[1].set(PETSc.INFINITY)

    def _make_snes(self) -> None:
        snes = PETSc.SNES().create(comm=PETSc.COMM_SELF)
        snes.setType(PETSc.SNES.Type.VINEWTONRSLS)
        # Not bound methods: their reference cycle would outlive PETSc and crash the interpreter's
        # exit.
        own = weakref.proxy(self)
        snes.setFunction(lambda *given: own._evaluate(*given), self._function)
        snes.setJacobian(lambda *given: own._fill(*given), self._jacobian)
        snes.setVariableBounds(*self._bounds)
        snes.setTolerances(rtol=0.0, atol=1e-12, stol=0.0, max_it=MAX_ITERATIONS)
        if self._product is None:
            snes.ksp.setType(PETSc.KSP.Type.PREONLY)
            snes.ksp.pc.setType(PETSc.PC.Type.LU)
        else:
            snes.ksp.setType(PETSc.KSP.Type.GMRES)
            snes.ksp.setTolerances(rtol=1e-10, max_it=500)
            snes.ksp.setGMRESRestart(100)
            snes.ksp.pc.setType(PETSc.PC.Type.PYTHON)
            snes.ksp.pc.setPythonContext(Preconditioner())
        snes.setOptionsPrefix(PREFIX)
        # The default of 1e-8 exceeds our tolerance: smaller forces would count as zero.
        options = PETSc.Options(PREFIX)
        if not options.hasName("snes_vi_zero_tolerance"):
            options["snes_vi_zero_tolerance"] = 1e-12
        snes.setFromOptions()
        self._snes = snes

    def _fill(
        self, _snes: PETSc.SNES, _force: PETSc.Vec, jacobian: PETSc.Mat, _p: PETSc.Mat
    ) -> None:
        """Restore A, which the semismooth solver scales in place."""
        if self._product is not None:
            self._product.reset()
            return
        every = np.arange(len(self.diagonal), dtype=PETSc.IntType)
        jacobian.setValues(every, every, self._dense)
        jacobian.assemble()

    def _evaluate(self, _snes: PETSc.SNES, force: PETSc.Vec, function: PETSc.Vec) -> None:
        function.array[:] = self._moved(force.array_r)

    def _moved(self, force: Array) -> Array:
        """Gaps without units."""
        return self._compliance.apply(force) / self._unit + self._offset

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N with f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0; see ActiveSet.solve.

        `guess_active` restricts the initial guess to those points. ConvergenceError if SNES fails.
        """
        q = np.asarray(q, dtype=float)
        if not np.all(np.isfinite(q)):
            check_residual("snes-vi", np.nan)
        offset = q if reference is None else q - self._compliance.apply(reference)
        length = float(np.abs(offset).max()) or 1.0
        self._offset = offset / length
        if guess_active is not None:
            self._force.array[~np.asarray(guess_active, dtype=bool)] = 0.0
        self._snes.solve(None, self._force)
        self.iterations = self._snes.getIterationNumber()
        self.factorisations += self.iterations if self._product is None else 0
        return self._finish(length)

    def state(self) -> dict[str, Array]:
        """The state from which the next solve starts."""
        return {"scaled": self._force.array_r.copy()}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._force.array[:] = state["scaled"]

    def block(self, index: NDArray[np.intp]) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)

    def _finish(self, length: float) -> Array:
        """Forces in newtons and gaps in metres, with the residual measured as in ActiveSet."""
        force = np.maximum(self._force.array_r, 0.0)
        gap = self._moved(force)
        scale = float(np.abs(self._offset).max() + force.max())
        diagonal = self.diagonal / self._unit
        self.residual = complementarity_residual(force, gap, diagonal, scale)
        reason = self._snes.getConvergedReason()
        if reason < 0 and not self.residual <= TOLERANCE:
            raise ConvergenceError(
                f"contact (snes-vi): PETSc gave up after {self.iterations} iterations (reason "
                f"{reason}, residual {self.residual:.2g} of the largest gap); take solver = "
                '"active-set", or pass -contact_snes_monitor to watch it'
            )
        check_residual("snes-vi", self.residual)
        # The semismooth method leaves forces of rounding size on points that do not touch.
        self.active = diagonal * force > gap
        self.penetration = length * penetration(gap)
        self.gap = length * np.where(self.active, 0.0, gap)
        return np.where(self.active, force, 0.0) * (length / self._unit)

    def destroy(self) -> None:
        """Free PETSc's objects."""
        for thing in (self._snes, self._jacobian, self._force, self._function, *self._bounds):
            thing.destroy()
