"""All eigenpairs of a symmetric matrix in one interval, by SLEPc's Krylov-Schur about a shift inside it.

    (A - sigma I)^-1 v = theta v,   lambda = sigma + 1 / theta

The largest |theta| belong to the eigenvalues nearest to the shift. (Stewart, SIAM J. Matrix Anal. Appl.
23 (2001) 601; Hernandez, Roman, Vidal, ACM TOMS 31 (2005) 351.) How many eigenvalues the interval holds is
known from inertia before. Krylov spaces of one vector see one direction of a repeated eigenvalue, so
the search goes on with what was found deflated until the count is met, and never ends earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc
from scipy import linalg, sparse
from slepc4py import SLEPc

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.solver.shifted import Shifted

# Residual of a Ritz pair relative to theta: as small as vectors of neighbouring slices must be
# orthogonal to each other, a few digits above rounding.
_TOLERANCE = 1e-12
_SEARCHES = 40  # with what was found deflated: one of each repeated eigenvalue at least every time
_RESTARTS = 100
_SOFT = 1e-3  # of the matrix norm: noise of a hundred roundings is 1e-11 of an eigenvalue there
_DENSE = 200  # unknowns below which LAPACK takes no longer than one factorisation and its overhead
_MANY = 0.25  # share of all eigenvalues from which LAPACK takes no longer
_LARGEST_DENSE = 3000


@dataclass(frozen=True)
class Interval:
    """Eigenvalues from `low` to `high`, `count` of them by inertia."""

    low: float
    high: float
    count: int


def eigenpairs(matrix: sparse.csr_matrix, interval: Interval) -> tuple[np.ndarray, np.ndarray]:
    """The `count` eigenvalues inside, ascending, and their orthonormal vectors (n, count). Not collective.

    Small matrices and those of which most is wanted are solved densely. Raises ConvergenceError when
    fewer are found than inertia counts.
    """
    size = matrix.shape[0]
    if interval.count == 0:
        return np.zeros(0), np.zeros((size, 0))
    if size <= _DENSE or _MANY * size <= interval.count and size <= _LARGEST_DENSE:
        found = linalg.eigh(matrix.toarray(), subset_by_value=(interval.low, interval.high))
        _check_count(len(found[0]), interval)
        return found
    shifted = _regular_shift(matrix, interval)
    try:
        values, vectors = _search(matrix, shifted, interval)
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


def _search(
    matrix: sparse.csr_matrix, shifted: Shifted, interval: Interval
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenpairs inside the interval, in no order, as many as there are or as are found."""
    operator = PETSc.Mat().createPython(matrix.shape, _Inverse(shifted), comm=PETSc.COMM_SELF)
    operator.setUp()
    start = operator.createVecRight()
    start.array[:] = np.random.default_rng(7).standard_normal(shifted.size)
    values, inside = np.zeros(0), 0
    vectors: list[PETSc.Vec] = []
    for search in range(_SEARCHES):
        # The start is the same each time: equal runs give equal vectors.
        more = _nearest(operator, interval.count - inside, [start] if search == 0 else [], vectors)
        found = shifted.shift + 1 / more[0]
        values, vectors = np.concatenate([values, found]), vectors + more[1]
        inside = int(_within(values, interval).sum())
        if inside >= interval.count or not len(found):
            break
    kept = _within(values, interval)
    out = np.empty((shifted.size, inside), order="F")
    for column, place in enumerate(np.flatnonzero(kept)):
        out[:, column] = vectors[place].array_r
    for thing in (operator, start, *vectors):
        thing.destroy()
    return values[kept], out


def _within(values: np.ndarray, interval: Interval) -> np.ndarray:
    return (values > interval.low) & (values < interval.high)


class _Inverse:
    """(A - sigma I)^-1 as PETSc applies it."""

    def __init__(self, shifted: Shifted) -> None:
        self._shifted = shifted

    def mult(self, _: PETSc.Mat, right: PETSc.Vec, out: PETSc.Vec) -> None:
        """out = (A - sigma I)^-1 right."""
        self._shifted.apply(right, out)


def _nearest(
    operator: PETSc.Mat, wanted: int, start: list[PETSc.Vec], known: list[PETSc.Vec]
) -> tuple[np.ndarray, list[PETSc.Vec]]:
    """At least `wanted` eigenpairs (theta, v) of largest |theta| orthogonal to the known ones, if they converge."""
    room = operator.getSize()[0] - len(known)
    eps = SLEPc.EPS().create(PETSc.COMM_SELF)
    eps.setOptionsPrefix("modes_")
    eps.setOperators(operator)
    eps.setProblemType(SLEPc.EPS.ProblemType.HEP)
    eps.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    wanted = min(wanted, room)
    # Measured: 1.5 times the wanted ones and twenty cost least, two or three restarts.
    eps.setDimensions(wanted, min(wanted + wanted // 2 + 20, room))
    eps.setTolerances(_TOLERANCE, _RESTARTS)
    if start:
        eps.setInitialSpace(start)
    if known:
        eps.setDeflationSpace(known)
    eps.setFromOptions()
    eps.solve()
    values, vectors = [], []
    for k in range(eps.getConverged()):
        vector = operator.createVecRight()
        theta = eps.getEigenpair(k, vector).real
        if theta == 0.0:
            vector.destroy()
            continue
        values.append(theta)
        vectors.append(vector)
    eps.destroy()
    return np.array(values), vectors


def _polish(
    matrix: sparse.csr_matrix, shifted: Shifted, values: np.ndarray, vectors: np.ndarray
) -> None:
    """One step of inverse iteration, in place, where rounding would show in the residual.

    A Krylov basis carries noise in the stiffest directions, which the matrix multiplies by up to 1e7
    times the lowest eigenvalue: low modes are good in the inverse norm and not in the residual's.
    """
    soft = np.flatnonzero(values < _SOFT * float(abs(matrix).sum(axis=1).max()))
    if len(soft):
        better = shifted.solve(vectors[:, soft])
        vectors[:, soft] = (
            better / np.linalg.norm(better, axis=0) * np.sign(values[soft] - shifted.shift)
        )


def _hertz(square: float) -> float:
    return float(np.sign(square) * np.sqrt(abs(square)) / (2 * np.pi))


def _regular_shift(matrix: sparse.csr_matrix, interval: Interval) -> Shifted:
    """Factorised at a shift at the middle, moved a little while it is an eigenvalue itself."""
    width = interval.high - interval.low
    for part in (0.5, 0.507, 0.489, 0.523):
        shift = interval.low + part * width
        shifted = Shifted(matrix, shift)
        if not shifted.singular:
            return shifted
        shifted.destroy()
    raise ConvergenceError(
        f"modes: K - sigma M is singular all around {_hertz(shift):.3f} Hz: the mesh has nodes "
        "without stiffness."
    )
