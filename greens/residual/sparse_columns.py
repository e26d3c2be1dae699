"""Products of a matrix with forces of which few are not zero: only their columns are read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Picking rows costs half a read of them: beyond this share all of them are read at once.
FEW = 0.6


class LoadedColumns:
    """A (n, k), kept by `columns` (k, n); those of the loaded entries are laid side by side and kept.

    In contact the same points stay loaded for several steps: a product with a of k columns then
    reads 8 a n bytes instead of 8 k n. The sum's order depends on the loaded entries alone, not on
    what was loaded before: a run that goes on from a checkpoint finds the same bits.
    """

    def __init__(self, matrix: Array) -> None:
        self.columns = np.ascontiguousarray(matrix.T)
        self._buffer = np.empty_like(self.columns[: int(FEW * len(self.columns))])
        self._key = b""
        self._taken = self._buffer[:0]

    def __matmul__(self, force: Array) -> Array:
        """A f (n,) for f (k,)."""
        index = force.nonzero()[0]
        if len(index) > len(self._buffer):
            return force @ self.columns
        return force[index] @ self.take(index)

    def take(self, index: Index) -> Array:
        """The columns `index` as rows (a, n); valid until others are asked for."""
        key = index.tobytes()
        if key != self._key or len(self._taken) != len(index):
            if len(index) > len(self._buffer):
                self._taken = self.columns[index]
            else:
                self._taken = self._buffer[: len(index)]
                # Unlike the default, "clip" writes without a copy; the indices are in range.
                np.take(self.columns, index, axis=0, out=self._taken, mode="clip")
            self._key = key
        return self._taken

    def between(self, rows: Index, columns: Index) -> Array:
        """A (a, b) between `rows` (a,) and `columns` (b,), column-major."""
        # By whole columns first: a third of the time of picking entry by entry.
        return self.take(columns).take(rows, axis=1).T
