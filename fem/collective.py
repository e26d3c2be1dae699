"""Collective operations on arrays: sums, gathering, and broadcast of objects that hold arrays.

Arrays are sent as buffers. Pickling would make two further copies and is limited to 2 GB, the
largest byte count of an MPI message. Messages counted in numbers or rows may hold 16 GB and more;
of an object only the small remainder without its arrays is pickled.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from mpi4py import MPI
from mpi4py.util import dtlib, pkl5

T = TypeVar("T")


def summed(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """Sum of arrays of equal shape over all processes, on all of them. Collective."""
    if comm.size == 1:
        return values
    total = np.array(values, order="C")
    comm.Allreduce(MPI.IN_PLACE, total)
    return total


def joined(comm: MPI.Comm, values: np.ndarray) -> np.ndarray:
    """The arrays (n, ...) of all processes concatenated, on every process. Collective."""
    if comm.size == 1:
        return values
    rows = np.array(comm.allgather(len(values)))
    each = int(np.prod(values.shape[1:], dtype=int))
    every = np.empty((rows.sum(), *values.shape[1:]), values.dtype)
    one = dtlib.from_numpy_dtype(values.dtype).Create_contiguous(max(each, 1)).Commit()
    try:  # counts are rows: below 2^31 where the number of values is not
        comm.Allgatherv(
            [np.ascontiguousarray(values), one], [every, rows if each else 0 * rows, one]
        )
    finally:
        one.Free()
    return every


def alike(comm: MPI.Comm, value: object) -> bool:
    """Whether a small object is equal on all processes. Collective."""
    return comm.size == 1 or len(set(comm.allgather(value))) == 1


def broadcast(comm: MPI.Comm, value: T, root: int = 0) -> T:
    """The object of `root` on every process; its arrays are sent as buffers. Collective."""
    if comm.size == 1:
        return value
    sent = pkl5.Intracomm(comm).bcast(value, root)
    # Root returns its own object, so that resources reached through it stay open.
    return value if comm.rank == root else sent
