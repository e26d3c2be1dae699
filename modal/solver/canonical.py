"""One order, one sign and one basis of each repeated frequency for the modes, by rule.

An eigensolver leaves the sign undetermined, and for a repeated eigenvalue the whole basis V (n, k).
Here

    r = the unknown whose row of V is longest,   v_1 = V V_r^T / |V_r|

and so on in the remainder of V. This depends on the space alone; v_1 has its largest component at
r, and it is positive. Lengths within a thousandth count as equal, and the first by position is
taken, so that a symmetric mode has a unique sign too. The modes are the same on any number of
processes to rounding, sign and order included.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.modal.solver.fields import CHUNK

_SAME_LENGTH = 1e-3  # relative


def ordered(values: np.ndarray, family: np.ndarray, same: float) -> tuple[np.ndarray, np.ndarray]:
    """The order of the values (k,), and the group (k,) of each in that order.

    Values ascend; equal ones (to the relative distance `same` from one to the next) are ordered by
    family (k,). A group is the equal values of one family.
    """
    order = np.argsort(values, kind="stable")
    step = np.diff(values[order]) > same * np.abs(values[order][1:])
    level = np.concatenate([[0], np.cumsum(step)])
    order = order[np.lexsort((family[order], level))]
    change = step | (np.diff(family[order]) != 0)
    return order, np.concatenate([[0], np.cumsum(change)])


def turn_to_rule(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray, group: np.ndarray) -> None:
    """Fix signs, and bases of groups (m,) of more than one column, of own rows (n, m) in place.
    Collective.

    `rank` (n,) of own rows in an order of all rows that does not depend on the processes.
    """
    first, size = np.unique(group, return_index=True, return_counts=True)[1:]
    alone = first[size == 1]
    for start in range(0, len(alone), CHUNK):
        some = alone[start : start + CHUNK]
        vectors[:, some] *= _signs(comm, vectors[:, some], rank)
    for begin, count in zip(first[size > 1], size[size > 1], strict=True):
        vectors[:, begin : begin + count] = _based(comm, vectors[:, begin : begin + count], rank)


def _signs(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """Signs (m,) of the largest component of each column, the first by rank among equals.
    Collective.
    """
    size = np.abs(vectors)
    largest = _over_all(comm, size.max(axis=0, initial=0.0), MPI.MAX)
    place = np.where(size >= (1 - _SAME_LENGTH) * largest, rank[:, None], np.iinfo(int).max)
    foremost = place.min(axis=0, initial=np.iinfo(int).max)
    winner = _over_all(comm, foremost, MPI.MIN)
    sign = np.zeros(vectors.shape[1])
    mine = np.flatnonzero(foremost == winner)
    if len(vectors):
        sign[mine] = np.sign(vectors[place.argmin(axis=0)[mine], mine])
    return _over_all(comm, sign, MPI.SUM)


def _based(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """V (n, k) rotated to the basis that the rule gives its space. Collective."""
    k = vectors.shape[1]
    turn, left = np.zeros((k, 0)), vectors
    for _ in range(k):
        row = _longest_row(comm, left, rank)
        row = row - turn @ (turn.T @ row)
        turn = np.column_stack([turn, row / np.linalg.norm(row)])
        left = vectors - (vectors @ turn) @ turn.T
    return vectors @ turn


def _longest_row(comm: MPI.Comm, vectors: np.ndarray, rank: np.ndarray) -> np.ndarray:
    """The longest row (k,) over all processes, the first by rank among equals. Collective."""
    length = np.linalg.norm(vectors, axis=1)
    largest = comm.allreduce(float(length.max(initial=0.0)), op=MPI.MAX)
    place = np.where(length >= (1 - _SAME_LENGTH) * largest, rank, np.iinfo(int).max)
    foremost = int(place.min(initial=np.iinfo(int).max))
    row = np.zeros(vectors.shape[1])
    if foremost == comm.allreduce(foremost, op=MPI.MIN):
        row = vectors[place.argmin()].copy()
    return _over_all(comm, row, MPI.SUM)


def _over_all(comm: MPI.Comm, values: np.ndarray, operation: MPI.Op) -> np.ndarray:
    out = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), out, op=operation)
    return out
