"""The same-step compliance of a patch, A = W A_tire W^T + C~, as a matrix or as a product.

Projected conjugate gradients for the contact problem of a step with thousands of points.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tireroad.contact.solver.conditions import (
    TOLERANCE,
    check_residual,
    complementarity_residual,
    penetration,
)
from tireroad.contact.tread.kernel import EMPTY, Box, KernelTread, widened
from tireroad.fem.errors import ConvergenceError

Array = NDArray[np.float64]
Index = NDArray[np.intp]

Mask = NDArray[np.bool_]
TARGET = 1e-10  # a tenth of the tolerance, since the residual is evaluated again for the record
MAX_ITERATIONS = 1000


class Compliance(Protocol):
    """The operations on A (c, c) m/N that the solvers need.

    `block` is its part between given points, column-major; `precondition` is an approximate inverse.
    """

    diagonal: Array

    def block(self, rows: Index, columns: Index) -> Array: ...

    def apply(self, force: Array) -> Array: ...

    def precondition(self, approach: Array) -> Array: ...


class SpreadCompliance:
    """`tire` (p, p) m/N between nodes, `weights` W (c, p), the tread a convolution; nothing dense.

    The tread alone is the preconditioner: the tire adds few large eigenvalues, one iteration each.
    """

    def __init__(self, tire: Array, weights: sparse.csr_matrix, tread: KernelTread) -> None:
        self._tire, self._weights, self.tread = tire, weights, tread
        self._transposed = weights.T.tocsr()
        own = weights.multiply(weights @ tire).sum(axis=1)
        self.diagonal = tread.diagonal + np.asarray(own).ravel()
        self.precondition = tread.precondition

    def block(self, rows: Index, columns: Index) -> Array:
        """A between the points `rows` (a,) and `columns` (b,), (a, b) m/N."""
        ahead = self._weights[columns] @ self._tire.T
        return np.asfortranarray(self._weights[rows] @ ahead.T + self.tread.block(rows, columns))

    @property
    def cells(self) -> tuple[Index, Index]:
        """Row and column (c,) of each point in the grid."""
        return self.tread.cells

    def inside(self, box: Box) -> tuple[SpreadCompliance, Index]:
        """The same between the points in a box of the grid, and which those are (a,)."""
        tread, index = self.tread.inside(box)
        rows = self._weights[index]
        nodes = np.unique(rows.indices)
        return SpreadCompliance(self._tire[np.ix_(nodes, nodes)], rows[:, nodes], tread), index

    def apply(self, force: Array) -> Array:
        """Displacement (c,) m under forces (c,) N."""
        moved = self._tire @ (self._transposed @ force)
        return self._weights @ moved + self.tread.apply(force)


class MatrixCompliance:
    """A given matrix (c, c) m/N, preconditioned by its diagonal."""

    def __init__(self, matrix: Array) -> None:
        self._matrix = np.ascontiguousarray(matrix)
        self.diagonal = matrix.diagonal().copy()

    @property
    def stored(self) -> tuple[Array, Array]:
        """A by rows and by columns, (c, c) each."""
        return self._matrix, np.ascontiguousarray(self._matrix.T)

    def block(self, rows: Index, columns: Index) -> Array:
        """A between the points `rows` (a,) and `columns` (b,), (a, b) m/N."""
        return np.asfortranarray(self._matrix[np.ix_(rows, columns)])

    def apply(self, force: Array) -> Array:
        """Displacement (c,) m under forces (c,) N."""
        return self._matrix @ force

    def precondition(self, approach: Array) -> Array:
        """Forces (c,) N for a displacement (c,) m, point by point."""
        return approach / self.diagonal


def _gap(compliance: Compliance, force: Array, base: Array, q: Array) -> Array:
    return q + compliance.apply(force - base)


class ProjectedCG:
    """f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0 for A a product with a preconditioner.

    Conjugate gradients (Polak-Ribiere) on the touching points. Forces that turn negative are set to
    zero and their points leave, points with a negative gap join, and either restarts the
    directions. Symmetry of A is assumed only in the length of steps: a slight skew part slows
    convergence, but the gap is always that of A itself. Warm start by linear extrapolation of the
    last forces; a step that is solved again, for which the points that touch are given, begins with
    its own. Sources: Polonsky and Keer, Wear 231 (1999) 206; Vollebregt, J. Comput. Phys. 257 (2014) 333.

    On a grid only the points of a box around those that touch take part. The gaps of all others are
    found afterwards; where one is negative the box grows and the step is solved again.
    """

    def __init__(self, compliance: Compliance) -> None:
        self._compliance = compliance
        self.diagonal = compliance.diagonal
        n = len(self.diagonal)
        self._grid = compliance if isinstance(compliance, SpreadCompliance) else None
        self.tread = self._grid.tread if self._grid else None
        self._cells = self._grid.cells if self._grid else ()
        self._shape = tuple(int(cells.max()) + 1 for cells in self._cells)
        self._box = EMPTY
        self._inner, self._index = compliance, np.arange(n)
        self._last: Array | None = None
        self._before: Array | None = None
        self._again = False  # the last step is solved once more
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self.penetration = 0.0
        self.residual = 0.0
        self.iterations = 0
        self.factorisations = 0

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N; see ActiveSet.solve. ConvergenceError after 1000 iterations."""
        if not np.all(np.isfinite(q)):
            check_residual("projected-cg", np.nan)
        base = np.zeros(len(q)) if reference is None else reference
        force = self._begin(base, guess_active)
        near = (base != 0.0) | (force > 0.0)
        self._cover(near if guess_active is None else near | guess_active)
        self.iterations = 0
        while True:
            force, largest = self._iterate(q, force, base)
            gap = _gap(self._compliance, force, base, q)
            scale = largest + float((self.diagonal * force).max())
            self.residual = complementarity_residual(force, gap, self.diagonal, scale)
            if self.residual <= TOLERANCE or not self._cover(gap < -TARGET * scale):
                self._finish(force, gap)
                return force

    def _cover(self, points: Mask) -> bool:
        """Let the box contain these points; whether it grew."""
        if not self._cells or not points.any():
            return False
        touching = self._cells[0][points], self._cells[1][points]
        return self._take_box(widened(self._box, touching, self._shape))

    def _take_box(self, box: Box) -> bool:
        """Solve between the points of this box from now on; whether it is another."""
        if box == self._box or self._grid is None:
            return False
        self._box = box
        self._inner, self._index = self._grid.inside(box)
        return True

    def _iterate(self, q: Array, force: Array, base: Array) -> tuple[Array, float]:
        """The forces of the box's points, and the largest of all gaps q."""
        inner, index, largest = self._inner, self._index, float(np.abs(q).max())
        diagonal = self.diagonal[index]
        force, base, q = force[index], base[index], q[index]
        gap = _gap(inner, force, base, q)
        touching = (force > 0.0) | (gap < 0.0)
        direction, old, old_product = None, None, 0.0
        for _ in range(MAX_ITERATIONS):
            scale = float(largest + (diagonal * force).max())
            self.residual = complementarity_residual(force, gap, diagonal, scale)
            if self.residual <= TARGET:
                forces = np.zeros(len(self.diagonal))
                forces[index] = force
                return forces, largest
            self.iterations += 1
            defect = np.where(touching, -gap, 0.0)
            raised = np.where(touching, inner.precondition(defect), 0.0)
            product = float(raised @ defect)
            if direction is None:
                direction = raised
            else:
                share = max((product - float(raised @ old)) / old_product, 0.0)
                direction = raised + share * direction
            moved = inner.apply(direction)
            length = self._length(float(direction @ defect), float(direction @ moved))
            force = force + length * direction
            if force.min() < 0.0:
                force = np.maximum(force, 0.0)
                gap = _gap(inner, force, base, q)
            else:
                gap = gap + length * moved
            now = (force > 0.0) | (gap < 0.0)
            restart = bool(np.any(now != touching))
            touching = now
            direction = None if restart else direction
            old, old_product = defect, product
        raise ConvergenceError(
            f"contact (projected-cg): residual {self.residual:.2g} of the largest gap after "
            f"{MAX_ITERATIONS} iterations; take a coarser grid of points with solver = "
            '"active-set", or a softer tread'
        )

    def state(self) -> dict[str, Array]:
        """The state from which the next solve starts."""
        state = {
            "last": self._last,
            "before": self._before,
            "box": np.array(self._box, dtype=float),
        }
        return {name: value for name, value in state.items() if value is not None}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._last, self._before = state.get("last"), state.get("before")
        if "box" in state:
            top, bottom, left, right = (int(value) for value in state["box"])
            self._take_box((top, bottom, left, right))

    def block(self, index: NDArray[np.intp]) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)

    def _begin(self, base: Array, guess_active: Mask | None) -> Array:
        self._again = self._last is not None and guess_active is not None
        if self._last is None:
            return base.copy()
        if self._before is None or self._again:
            return self._last.copy()
        ahead: Array = np.maximum(2.0 * self._last - self._before, 0.0)
        return np.where(self._last > 0.0, ahead, 0.0)

    def _length(self, along: float, curvature: float) -> float:
        if not curvature > 0.0:
            raise ConvergenceError(
                "contact (projected-cg): the compliance is not positive definite; add tread "
                'compliance or take [greens] residual = "static"'
            )
        return along / curvature

    def _finish(self, force: Array, gap: Array) -> None:
        check_residual("projected-cg", self.residual)
        self.active = force > 0.0
        if not self._again:
            self._before = self._last
        self._last = force
        self.penetration = penetration(gap)
        self.gap = np.where(self.active, 0.0, gap)
