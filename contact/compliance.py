"""The same-step compliance of a patch, A = W A_tire W^T + C~, as a matrix or as a product."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contact.kernel import KernelTread

Array = NDArray[np.float64]


class Compliance(Protocol):
    """What the iterative solver needs of A (c, c) m/N."""

    diagonal: Array

    def apply(self, force: Array) -> Array: ...

    def precondition(self, approach: Array) -> Array: ...


class SpreadCompliance:
    """`tire` (p, p) m/N between nodes, `weights` W (c, p), the tread a convolution; nothing dense.

    Preconditioned by the tread alone: the tire adds few large eigenvalues, one iteration each.
    """

    def __init__(self, tire: Array, weights: sparse.csr_matrix, tread: KernelTread) -> None:
        self._tire, self._weights, self._tread = tire, weights, tread
        self._transposed = weights.T.tocsr()
        own = weights @ tire
        self.diagonal = tread.diagonal + np.asarray(weights.multiply(own).sum(axis=1)).ravel()
        self.precondition = tread.precondition

    def apply(self, force: Array) -> Array:
        """Approach (c,) m under forces (c,) N."""
        return self._weights @ (self._tire @ (self._transposed @ force)) + self._tread.apply(force)


class MatrixCompliance:
    """A given matrix (c, c) m/N, preconditioned by its diagonal."""

    def __init__(self, matrix: Array) -> None:
        self._matrix = matrix
        self.diagonal = matrix.diagonal().copy()

    def apply(self, force: Array) -> Array:
        """Approach (c,) m under forces (c,) N."""
        return self._matrix @ force

    def precondition(self, approach: Array) -> Array:
        """Forces (c,) N of an approach (c,) m, point by point."""
        return approach / self.diagonal
