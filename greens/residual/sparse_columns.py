"""Products of a matrix with mostly zero forces, which read only the columns of nonzero ones."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# Numbers in a run of columns, on average, above which each run is multiplied on its own instead of
# first copying all columns side by side: 16 columns of 430 numbers, 7 of 1,000, 3 of 2,000; at
# least two columns.
LONG, FEWEST = 7000, 2


class SharedRows:
    """This process's share `mine` of `count` rows, and their collection by `gathered`."""

    def __init__(self, count: int, comm: MPI.Comm) -> None:
        ends = count * np.arange(comm.size + 1) // comm.size
        self.comm = comm
        self.mine = slice(int(ends[comm.rank]), int(ends[comm.rank + 1]))
        self._count, self._shares = count, (np.diff(ends), ends[:-1])

    def gathered(self, own: Array) -> Array:
        """The numbers (count,) of all processes, bitwise equal on each, from this one's.
        Collective.
        """
        if self.comm.size == 1:
            return own
        every = np.empty(self._count)
        self.comm.Allgatherv(np.ascontiguousarray(own), [every, self._shares, MPI.DOUBLE])
        return every


class LoadedColumns:
    """A (n, k), stored by `columns` (k, n); products read only columns of nonzero forces.

    Runs of adjacent nonzero entries, such as the touching points of a line, are read in place:
    copying them side by side first takes twice as long. The order of summation depends on the
    nonzero entries alone, so that a run restarted from a checkpoint yields the same bits. With a
    `comm` of several processes, each computes its share of the n rows.
    """

    def __init__(self, matrix: Array, comm: MPI.Comm = MPI.COMM_SELF) -> None:
        self.columns = np.ascontiguousarray(matrix.T)
        self.rows = SharedRows(len(matrix), comm)
        self._own = self.columns[:, self.rows.mine]

    @staticmethod
    def of(matrix: Array | LinearOperator, comm: MPI.Comm) -> LoadedColumns | LinearOperator:
        """A matrix wrapped for such products; a linear operator is returned as it is."""
        return LoadedColumns(matrix, comm) if isinstance(matrix, np.ndarray) else matrix

    def __matmul__(self, force: Array) -> Array:
        """A f (n,) for f (k,). Collective where the rows are shared."""
        return self.rows.gathered(self.product(force))

    def product(self, force: Array) -> Array:
        """This process's rows of A f for f (k,)."""
        index = force.nonzero()[0]
        breaks = np.flatnonzero(index[1:] - index[:-1] > 1)
        loaded, runs = len(index), len(breaks) + 1
        if loaded < FEWEST * runs or loaded * self._own.shape[1] < LONG * runs:
            return force[index] @ self._own[index]
        begins = [index[0], *index[breaks + 1].tolist()]
        ends = [*(index[breaks] + 1).tolist(), index[-1] + 1]
        out = np.zeros(self._own.shape[1])
        for begin, end in zip(begins, ends, strict=True):
            out += force[begin:end] @ self._own[begin:end]
        return out

    def between(self, rows: Index, columns: Index) -> Array:
        """A (a, b) between `rows` (a,) and `columns` (b,), column-major."""
        # Whole columns first: a third of the time of picking entry by entry.
        return self.columns.take(columns, axis=0).take(rows, axis=1).T

    def around(self, index: Index) -> ColumnsAround:
        """The columns (a,) of `index`, for forces that are nonzero there and at few others."""
        return ColumnsAround(self, index)


class ColumnsAround:
    """Columns of A (n, n), rows not shared, at `index` (a,), copied once for many products.

    Finding and copying them is half the cost of a product.
    """

    def __init__(self, whole: LoadedColumns, index: Index) -> None:
        self._whole, self._index = whole, index
        self._columns = whole.columns.take(index, axis=0)

    def block(self) -> Array:
        """A (a, a) between them, column-major."""
        return self._columns.take(self._index, axis=1).T

    def spread(self, force: Array) -> Array:
        """A f (n,) for f (n,), fastest if f is nonzero at `index` and few others."""
        moved = force[self._index] @ self._columns
        rest = force.copy()
        rest[self._index] = 0.0
        if rest.any():
            moved += self._whole.product(rest)
        return moved
