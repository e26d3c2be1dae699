"""The same-step compliance of a patch, A = W A_tire W^T + C~, as a matrix or as a product."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tireroad.contact.tread.kernel import KernelTread
from tireroad.greens.recursion import LoadedColumns

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Around(Protocol):
    """A restricted to some points.

    `block` (a, a) is A between them, column-major for LAPACK; `spread` is A f (c,) for forces (c,)
    at those points and few others.
    """

    def block(self) -> Array: ...

    def spread(self, force: Array) -> Array: ...


class Compliance(Protocol):
    """The operations on A (c, c) m/N that the solvers need.

    `block` is its part between given points, column-major; `around` prepares many products with
    forces at about the same points; `precondition` is an approximate inverse.
    """

    diagonal: Array

    def block(self, rows: Index, columns: Index) -> Array: ...

    def around(self, index: Index) -> Around: ...

    def apply(self, force: Array) -> Array: ...

    def precondition(self, approach: Array) -> Array: ...


@dataclass(frozen=True)
class _ProductAround:
    """For a compliance that is a product, which costs the same for few forces as for many."""

    block: Callable[[], Array]
    spread: Callable[[Array], Array]


class SpreadCompliance:
    """`tire` (p, p) m/N between nodes, `weights` W (c, p), the tread a convolution; nothing dense.

    The tread alone is the preconditioner: the tire adds few large eigenvalues, one iteration each.
    """

    def __init__(self, tire: Array, weights: sparse.csr_matrix, tread: KernelTread) -> None:
        self._tire, self._weights, self._tread = tire, weights, tread
        self._transposed = weights.T.tocsr()
        own = weights.multiply(weights @ tire).sum(axis=1)
        self.diagonal = tread.diagonal + np.asarray(own).ravel()
        self.precondition = tread.precondition

    def block(self, rows: Index, columns: Index) -> Array:
        """A between the points `rows` (a,) and `columns` (b,), (a, b) m/N."""
        ahead = self._weights[columns] @ self._tire.T
        return np.asfortranarray(self._weights[rows] @ ahead.T + self._tread.block(rows, columns))

    def around(self, index: Index) -> Around:
        """A restricted to the points of `index` (a,)."""
        return _ProductAround(lambda: self.block(index, index), self.apply)

    def apply(self, force: Array) -> Array:
        """Displacement (c,) m under forces (c,) N."""
        moved = self._tire @ (self._transposed @ force)
        return self._weights @ moved + self._tread.apply(force)


class MatrixCompliance:
    """A given matrix (c, c) m/N, preconditioned by its diagonal."""

    def __init__(self, matrix: Array) -> None:
        self._matrix, self._columns = matrix, LoadedColumns(matrix)
        self.diagonal = matrix.diagonal().copy()

    def block(self, rows: Index, columns: Index) -> Array:
        """A between the points `rows` (a,) and `columns` (b,), (a, b) m/N."""
        if len(rows) < len(columns):
            return np.asfortranarray(self._matrix.take(rows, axis=0).take(columns, axis=1))
        return self._columns.between(rows, columns)

    def around(self, index: Index) -> Around:
        """A restricted to the points of `index` (a,)."""
        return self._columns.around(index)

    def apply(self, force: Array) -> Array:
        """Displacement (c,) m under forces (c,) N."""
        return self._matrix @ force

    def precondition(self, approach: Array) -> Array:
        """Forces (c,) N for a displacement (c,) m, point by point."""
        return approach / self.diagonal
