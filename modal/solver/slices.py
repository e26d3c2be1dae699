"""All eigenpairs of a symmetric matrix in one interval, by block Lanczos about a shift inside it.

    (A - sigma I)^-1 v = theta v,   lambda = sigma + 1 / theta

The largest |theta| belong to the eigenvalues nearest to the shift (modal.solver.lanczos). The
number of eigenvalues in the interval is known beforehand from inertia. A block finds as many
directions of a repeated eigenvalue as it has vectors, so the search continues with the found ones
deflated until the count is met, and never ends earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.solver.lanczos import nearest
from tireroad.modal.solver.shifted import Shifted
from tireroad.modal.solver.team import ALONE, Team

# Residual of a Ritz pair relative to theta: as small as the vectors of neighbouring slices must be
# orthogonal to each other, a few digits above rounding.
TOLERANCE = 1e-12
# With deflation: each search finds at least a block of each repeated eigenvalue.
_SEARCHES = 40
_SOFT = 1e-3  # of the matrix norm: noise of a hundred roundings is 1e-11 of an eigenvalue there
_DENSE = 200  # unknowns below which LAPACK takes no longer than one factorisation and its overhead
_MANY = 0.25  # share of all eigenvalues from which on LAPACK takes no longer
_LARGEST_DENSE = 3000


@dataclass(frozen=True)
class Interval:
    """Eigenvalues from `low` to `high`, `count` of them by inertia."""

    low: float
    high: float
    count: int


def eigenpairs(
    matrix: sparse.csr_matrix, interval: Interval, team: Team = ALONE
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` eigenvalues in the interval, ascending, and orthonormal vectors (n, count).

    Of the matrix and of the vectors, each process of the `team` has its rows. Small matrices, and
    those of which most eigenvalues are wanted, are solved densely. Raises ConvergenceError if the
    number found differs from the inertia count. Collective in the team.
    """
    rows, size = matrix.shape
    if interval.count == 0:
        return np.zeros(0), np.zeros((rows, 0))
    if size <= _DENSE or _MANY * size <= interval.count and size <= _LARGEST_DENSE:
        whole = team.whole(matrix).toarray()
        values, vectors = linalg.eigh(whole, subset_by_value=(interval.low, interval.high))
        _check_count(len(values), interval)
        return values, vectors[team.own(size)]
    shifted = _regular_shift(matrix, interval, team)
    try:
        values, vectors = _search(shifted, interval)
        _check_count(len(values), interval)
        order = np.argsort(values, kind="stable")
        values, vectors = values[order], vectors[:, order]
        _polish(matrix, shifted, values, vectors)
    finally:
        shifted.destroy()
    return values, vectors


def _check_count(found: int, interval: Interval) -> None:
    if found != interval.count:
        raise ConvergenceError(
            f"modes: {found} modes found from {_hertz(interval.low):.3f} to "
            f"{_hertz(interval.high):.3f} Hz, but the inertia of K - sigma M counts {interval.count}. "
            "The matrix may be far from symmetric, or scaled so that rounding hides the low modes."
        )


def _search(shifted: Shifted, interval: Interval) -> tuple[np.ndarray, np.ndarray]:
    """Eigenpairs inside the interval, unordered: all of them, or those found in `_SEARCHES`."""
    values, vectors = np.zeros(0), np.zeros((shifted.rows, 0))
    for _ in range(_SEARCHES):
        missing = interval.count - len(values)
        more = nearest(shifted, interval.low, interval.high, missing, vectors, TOLERANCE)
        values, vectors = np.append(values, more[0]), np.hstack([vectors, more[1]])
        if len(values) >= interval.count or not len(more[0]):
            break
    return values, vectors


def _polish(
    matrix: sparse.csr_matrix, shifted: Shifted, values: np.ndarray, vectors: np.ndarray
) -> None:
    """One step of inverse iteration, in place, where rounding would show in the residual.

    A Krylov basis carries noise in the stiffest directions, which the matrix multiplies by up to
    1e7 times the lowest eigenvalue: low modes are accurate in the inverse norm but not in the
    residual.
    """
    norm = shifted.team.comm.allreduce(float(abs(matrix).sum(axis=1).max()), MPI.MAX)
    soft = np.flatnonzero(values < _SOFT * norm)
    if len(soft):
        better = shifted.solve(vectors[:, soft])
        vectors[:, soft] = (
            better / shifted.team.lengths(better) * np.sign(values[soft] - shifted.shift)
        )


def _hertz(square: float) -> float:
    return float(np.sign(square) * np.sqrt(abs(square)) / (2 * np.pi))


def _regular_shift(matrix: sparse.csr_matrix, interval: Interval, team: Team) -> Shifted:
    """Factorised at a shift near the middle that is no eigenvalue; else ConvergenceError."""
    width = interval.high - interval.low
    for part in (0.5, 0.507, 0.489, 0.523):
        shift = interval.low + part * width
        shifted = Shifted(matrix, shift, team)
        if not shifted.singular:
            return shifted
        shifted.destroy()
    raise ConvergenceError(
        f"modes: K - sigma M is singular all around {_hertz(shift):.3f} Hz: the mesh has nodes "
        "without stiffness."
    )
