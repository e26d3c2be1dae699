"""Eigenpairs nearest to a shift by block Lanczos, which reads the factor once for many solves.

    W = (A - sigma I)^-1 V_j = V_1..j H_j + V_j+1 R_j,   H s = theta s,   lambda = sigma + 1 / theta

Every new block is orthogonalised twice against all earlier ones. The residual of a Ritz pair is
|R_j s_j|, with s_j the last block of s. A triangular solve with one right-hand side is
memory-bound: eight at once cost less than two one by one, and a third more of them are needed
(radial tire, 14,919 unknowns, 76 eigenvalues: 248 solves, 1.1 s; SLEPc's Krylov-Schur with one
vector: 2.8 s). Blocks of 4 and of 16 take 1.3 and 1.4 s. Sources: Golub and Underwood (1977);
Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228.
"""

from __future__ import annotations

import numpy as np

from tireroad.modal.solver.shifted import Shifted

BLOCK = 8
# Longest basis: this many vectors for each wanted one, and this many blocks more.
_LENGTH, _MORE = 6, 30
_EVERY = 3  # blocks between two checks of convergence
_LOST = 1e-8  # of the largest: a direction of a new block shorter than this is rounding


class Basis:
    """Orthonormal vectors (n, m), own rows, orthogonal to `known` (n, k), grown by blocks."""

    def __init__(self, shifted: Shifted, known: np.ndarray, most: int, seed: int) -> None:
        self._shifted, self._known, self._team = shifted, known, shifted.team
        self._random = shifted.team.random(seed)
        room = shifted.size - known.shape[1]
        self._most = min(most, room)
        self._vectors = np.empty((shifted.rows, self._most), order="F")
        self._projected = np.zeros((self._most, self._most))
        self.size = self._done = 0
        self._rest = np.zeros((0, 0))
        self._append(self._random.standard_normal((shifted.rows, min(BLOCK, self._most))))

    @property
    def full(self) -> bool:
        """Whether the basis cannot grow any more."""
        return self._done == self.size

    def grow(self) -> None:
        """Solve for one block, which yields the next block of the basis."""
        start, m = self._done, self.size
        ahead = self._shifted.solve(self._vectors[:, start:m])
        largest = self._team.lengths(ahead).max()
        part = np.zeros((m, m - start))
        for _ in range(2):
            ahead -= self._known @ self._team.inner(self._known, ahead)
            share = self._team.inner(self._vectors[:, :m], ahead)
            ahead -= self._vectors[:, :m] @ share
            part += share
        self._projected[:m, start:m] = part
        self._projected[start:m, :m] = part.T
        self._done = m
        self._rest = self._append(ahead, largest)

    def ritz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """theta (m,), residuals (m,) and vectors (m, m) in the part of the basis solved for."""
        m = self._done
        theta, vectors = np.linalg.eigh((self._projected[:m, :m] + self._projected[:m, :m].T) / 2)
        last = vectors[m - self._rest.shape[1] :]
        return theta, np.linalg.norm(self._rest @ last, axis=0), vectors

    def fields(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (n, k) from those in the basis (m, k)."""
        return self._vectors[:, : len(vectors)] @ vectors

    def _append(self, ahead: np.ndarray, largest: float = 1.0) -> np.ndarray:
        """Add the directions (n, b) as far as there is room; returns R (b', b) of their QR."""
        m = self.size
        block, rest = self._team.orthonormal(ahead)
        short = np.abs(rest.diagonal()) < _LOST * largest
        # Directions that are rounding mean an invariant subspace: replace them by random ones.
        block[:, short] = self._random.standard_normal((len(block), int(short.sum())))
        rest[short] = 0.0
        if short.any() or not m:
            for _ in range(2):
                block -= self._known @ self._team.inner(self._known, block)
                block -= self._vectors[:, :m] @ self._team.inner(self._vectors[:, :m], block)
                block = self._team.orthonormal(block)[0]
        end = min(m + block.shape[1], self._most)
        self._vectors[:, m:end] = block[:, : end - m]
        self.size = end
        return rest


def nearest(
    shifted: Shifted, low: float, high: float, wanted: int, known: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (k,) from `low` to `high`; orthonormal vectors (n, k) orthogonal to the `known`.

    The search ends when `wanted` have converged, to a residual below the tolerance relative to
    theta, or when the basis is full. Each process has its rows. Collective in the team.
    """
    basis = Basis(shifted, known, _LENGTH * wanted + _MORE * BLOCK, 7 + known.shape[1])
    blocks = 0
    while True:
        basis.grow()
        blocks += 1
        if not basis.full and (basis.size < 2 * wanted or blocks % _EVERY):
            continue
        theta, residual, vectors = basis.ritz()
        values = shifted.shift + 1 / np.where(theta == 0.0, np.finfo(float).tiny, theta)
        found = (values > low) & (values < high) & (residual <= tolerance * np.abs(theta))
        if found.sum() >= wanted or basis.full:
            return values[found], basis.fields(vectors[:, found])
