"""The same-step compliance of a patch, A = W A_tire W^T + C~, as a matrix or as a product."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contact.kernel import KernelTread

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Compliance(Protocol):
    """What the solvers need of A (c, c) m/N.

    `block` is its part between the points `index`; `spread` the approach (c,) m under forces that
    act on those points alone, `values` (a,) N; `precondition` roughly its inverse.
    """

    diagonal: Array

    def block(self, index: Index) -> Array: ...

    def spread(self, values: Array, index: Index) -> Array: ...

    def apply(self, force: Array) -> Array: ...

    def precondition(self, approach: Array) -> Array: ...


class SpreadCompliance:
    """`tire` (p, p) m/N between nodes, `weights` W (c, p), the tread a convolution; nothing dense.

    Preconditioned by the tread alone: the tire adds few large eigenvalues, one iteration each.
    """

    def __init__(self, tire: Array, weights: sparse.csr_matrix, tread: KernelTread) -> None:
        self._tire, self._weights, self._tread = tire, weights, tread
        self._transposed = weights.T.tocsr()
        own = weights.multiply(weights @ tire).sum(axis=1)
        self.diagonal = tread.diagonal + np.asarray(own).ravel()
        self.precondition = tread.precondition

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N."""
        own = self._weights[index]
        return own @ (own @ self._tire.T).T + self._tread.block(index)

    def spread(self, values: Array, index: Index) -> Array:
        """Approach (c,) m under forces `values` (a,) N on the points `index`."""
        force = np.zeros(len(self.diagonal))
        force[index] = values
        return self.apply(force)

    def apply(self, force: Array) -> Array:
        """Approach (c,) m under forces (c,) N."""
        return self._weights @ (self._tire @ (self._transposed @ force)) + self._tread.apply(force)


class MatrixCompliance:
    """A given matrix (c, c) m/N, preconditioned by its diagonal."""

    def __init__(self, matrix: Array) -> None:
        self._matrix = matrix
        # Rows of the transpose are the columns of A: picking some of them copies whole rows.
        self._columns = np.ascontiguousarray(matrix.T)
        self.diagonal = matrix.diagonal().copy()
        self._index: Index | None = None

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N, column-major as LAPACK takes it."""
        self._index, self._touching = index, self._columns[index]
        return self._touching[:, index].T

    def spread(self, values: Array, index: Index) -> Array:
        """Approach (c,) m under forces `values` (a,) N on the points `index`."""
        touching = self._touching if index is self._index else self._columns[index]
        return values @ touching

    def apply(self, force: Array) -> Array:
        """Approach (c,) m under forces (c,) N."""
        return self._matrix @ force

    def precondition(self, approach: Array) -> Array:
        """Forces (c,) N of an approach (c,) m, point by point."""
        return approach / self.diagonal
