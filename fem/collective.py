"""What processes share of arrays: sums, whole arrays and objects that hold them, as buffers and not pickled.

A pickle is a second and a third copy of what it holds, and ends at 2 GB, the largest count of bytes of a message.
Sums and rows are messages of numbers (16 GB and more); objects go as their arrays, one after the other, and the
little that is left of them.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from mpi4py import MPI
from mpi4py.util import dtlib, pkl5

T = TypeVar("T")


def summed(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """The sum of arrays of numbers, of one shape, over the processes, on all of them. Collective."""
    if comm.size == 1:
        return values
    total = np.array(values, order="C")
    comm.Allreduce(MPI.IN_PLACE, total)
    return total


def joined(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """The arrays (n, ...) of all processes, one after the other, on every one. Collective."""
    if comm.size == 1:
        return values
    rows = np.array(comm.allgather(len(values)))
    each = int(np.prod(values.shape[1:], dtype=int))
    every = np.empty((rows.sum(), *values.shape[1:]), values.dtype)
    one = dtlib.from_numpy_dtype(values.dtype).Create_contiguous(max(each, 1)).Commit()
    try:  # counts are rows: they stay below 2^31 where numbers do not
        comm.Allgatherv(
            [np.ascontiguousarray(values), one], [every, rows if each else 0 * rows, one]
        )
    finally:
        one.Free()
    return every


def alike(comm: MPI.Comm, value: object) -> bool:
    """Whether all processes have the same of a small thing. Collective."""
    return comm.size == 1 or len(set(comm.allgather(value))) == 1


def broadcast(comm: MPI.Comm, value: T, root: int = 0) -> T:
    """The object that `root` has, on every process; its arrays are sent as they are. Collective."""
    if comm.size == 1:
        return value
    sent = pkl5.Intracomm(comm).bcast(value, root)
    # Root keeps its own: what the others open by way of it stays open.
    return value if comm.rank == root else sent
