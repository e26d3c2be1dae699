"""All eigenpairs of a symmetric matrix in one interval: block Lanczos about a shift inside it.

    Op = (A - sigma I)^-1,   Op V = V T + Q B E^T,   T s = theta s,   lambda = sigma + 1 / theta

Grimes, Lewis and Simon (1994), doi 10.1137/S0895479888151111, with full reorthogonalisation and thick
restarts: the interval is narrow, so the basis is small. How many eigenvalues it holds is known from
inertia before; the solver ends when it has found them all, and never earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.shifted import Shifted

# Residual of a Ritz pair of Op relative to theta: as small as vectors of neighbouring slices must
# be orthogonal to each other, a few digits above rounding.
_TOLERANCE = 1e-12
_BLOCK = 8  # columns a solve: at 16 the solve is no cheaper and the Krylov degree halves
_RESTARTS = 20
_SOFT = 1e-3  # of the matrix norm: noise of a hundred roundings is 1e-11 of an eigenvalue there


@dataclass(frozen=True)
class Interval:
    """Eigenvalues from `low` to `high`, `count` of them by inertia."""

    low: float
    high: float
    count: int


def eigenpairs(matrix: sparse.csr_matrix, interval: Interval) -> tuple[np.ndarray, np.ndarray]:
    """The `count` eigenvalues inside, ascending, and their orthonormal vectors (n, count). Not collective.

    Raises ConvergenceError when fewer are found than inertia counts. The start is the same random
    block each time: equal runs give equal vectors.
    """
    if interval.count == 0:
        return np.zeros(0), np.zeros((matrix.shape[0], 0))
    shift, shifted = _regular_shift(matrix, interval)
    krylov = _Krylov(shifted, interval.count)
    wanted = np.zeros(0, int)
    while krylov.restarts < _RESTARTS:
        krylov.expand()
        if krylov.filled < interval.count:
            continue
        theta, ritz, residual = krylov.ritz()
        near = np.abs(theta) > np.finfo(float).tiny
        values = np.where(near, shift + 1 / np.where(near, theta, 1.0), np.inf)
        inside = (values > interval.low) & (values < interval.high)
        floor = 10 * np.finfo(float).eps * np.abs(theta).max()
        done = residual <= np.maximum(_TOLERANCE * np.abs(theta), floor)
        wanted = np.flatnonzero(inside & done)
        if len(wanted) >= interval.count or krylov.exhausted:
            break
        krylov.restart_when_full(theta, ritz)
    if len(wanted) != interval.count:
        shifted.destroy()
        raise ConvergenceError(
            f"modes: {len(wanted)} modes found from {_hertz(interval.low):.3f} to "
            f"{_hertz(interval.high):.3f} Hz, but the inertia of K - sigma M counts {interval.count}. "
            "The matrix may be far from symmetric, or scaled so that rounding hides the low modes."
        )
    order = wanted[np.argsort(values[wanted])]
    values, vectors = values[order], krylov.vectors(theta, ritz, order)
    _polish(matrix, shifted, values, vectors)
    shifted.destroy()
    return values, vectors


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


def _regular_shift(matrix: sparse.csr_matrix, interval: Interval) -> tuple[float, Shifted]:
    """A shift at the middle, moved a little while it is an eigenvalue itself."""
    width = interval.high - interval.low
    for part in (0.5, 0.507, 0.489, 0.523):
        shift = interval.low + part * width
        shifted = Shifted(matrix, shift)
        if not shifted.singular:
            return shift, shifted
        shifted.destroy()
    raise ConvergenceError(
        f"modes: K - sigma M is singular all around {_hertz(shift):.3f} Hz: the mesh has nodes "
        "without stiffness."
    )


class _Krylov:
    """Orthonormal basis V (n, filled), T = V^T Op V, and the next block Q with its coupling B."""

    def __init__(self, shifted: Shifted, count: int):
        self._shifted = shifted
        n = shifted.size
        self._block = min(_BLOCK, n)
        self._keep = min(2 * count + self._block, n)
        room = min(2 * self._keep + 12 * self._block, n)
        self._room = room
        self._basis = np.empty((n, room + self._block), order="F")
        self._projected = np.zeros((room + self._block,) * 2)
        self._random = np.random.default_rng(7)
        self.filled = self.restarts = 0
        self._next = np.linalg.qr(self._random.standard_normal((n, self._block)))[0]

    @property
    def exhausted(self) -> bool:
        """Whether the basis spans the whole space: T is then exact."""
        return self._next.shape[1] == 0

    def expand(self) -> None:
        """Take the next block in, apply Op to it, and orthogonalise twice."""
        k, width = self.filled, self._next.shape[1]
        self._basis[:, k : k + width] = self._next
        self.filled = k = k + width
        basis = self._basis[:, :k]
        moved = self._shifted.solve(self._next)
        part = basis.T @ moved
        moved -= basis @ part
        again = basis.T @ moved
        moved -= basis @ again
        part += again
        self._projected[:k, k - width : k] = part
        self._projected[k - width : k, :k] = part.T
        self._next, self._coupling = self._orthonormal(moved)

    def _orthonormal(self, moved: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """moved = Q B with Q orthogonal to the basis; directions lost to rounding become random ones."""
        width = min(moved.shape[1], moved.shape[0] - self.filled)
        if width < moved.shape[1]:
            moved = moved[:, :width]
        q, coupling = np.linalg.qr(moved)
        scale = np.abs(self._projected[: self.filled, : self.filled].diagonal()).max(initial=0.0)
        lost = np.abs(coupling.diagonal()) <= 100 * np.finfo(float).eps * scale
        if lost.any():
            q[:, lost] = self._random.standard_normal((len(q), lost.sum()))
            coupling[lost] = 0.0
            basis = self._basis[:, : self.filled]
            for _ in range(2):
                q -= basis @ (basis.T @ q)
                q, turn = np.linalg.qr(q)
                coupling = turn @ coupling
        return q, coupling

    def ritz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """theta, s (columns) and the residual norms ||B s_last||."""
        k = self.filled
        theta, vectors = np.linalg.eigh(self._projected[:k, :k])
        self._tail = self._coupling @ vectors[k - self._coupling.shape[1] :]
        return theta, vectors, np.linalg.norm(self._tail, axis=0)

    def restart_when_full(self, theta: np.ndarray, ritz: np.ndarray) -> None:
        """Keep the Ritz vectors nearest to the shift when there is no room for a further block."""
        if self.filled + self._block <= self._room or self._room == self._shifted.size:
            return
        best = np.argsort(-np.abs(theta))[: self._keep]
        k = len(best)
        self._basis[:, :k] = self._basis[:, : self.filled] @ ritz[:, best]
        self._projected[:] = 0.0
        self._projected[:k, :k] = np.diag(theta[best])
        self.filled, self.restarts = k, self.restarts + 1

    def vectors(self, theta: np.ndarray, ritz: np.ndarray, chosen: np.ndarray) -> np.ndarray:
        """Ritz vectors after one more inverse iteration, Op y / theta, which needs no further solve."""
        out = self._basis[:, : self.filled] @ ritz[:, chosen]
        out += self._next @ (self._tail[:, chosen] / theta[chosen])
        return out / np.linalg.norm(out, axis=0)
