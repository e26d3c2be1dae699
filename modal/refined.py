"""Refinement of inaccurate states of the companion matrix on the quadratic problem itself.

The companion matrix of a wide spectrum determines its slow states only to rounding of the fast
ones; the states of a free rim, close to rest, suffer most. Such a state gets one step of inverse
iteration on the quadratic problem,

    Q(s) u+ = u,   Q(s)^T w+ = w,   Q(s) = s^2 + s D + K,

is normalised again, w^T (2 s + D) u = 1, and its eigenvalue follows from Lancaster's two-sided
quotient,  s+ = s - w^T Q(s) u,  whose error is of second order in those of the vectors.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray

# States slower than this fraction of the fastest have terms of rounding alone; a residual is
# relative to at least this fraction of the fastest |s|^2.
AT_REST = 1e-5
_ROUGH = 1e-11  # residual above which a state is refined
_MOST = 20  # refinements, a factorisation each; only a few slow states ever need one
_SAME = 1e-4  # relative change beyond which inverse iteration has moved on to a neighbouring state


def residual(drag: Array, stiffness: Array, values: Array, vectors: Array) -> Array:
    """||(s^2 + s D + K) u|| over the sum of the norms of its terms, column by column."""

    # Real by complex, without a complex copy of the matrix.
    def times(matrix: Array) -> Array:
        return matrix @ vectors.real + 1j * (matrix @ vectors.imag)

    terms = (vectors * values**2, times(drag) * values, times(stiffness))
    size = sum(np.linalg.norm(term, axis=0) for term in terms)
    least = AT_REST * np.abs(values).max(initial=0.0) ** 2 * np.linalg.norm(vectors, axis=0)
    return np.linalg.norm(sum(terms), axis=0) / np.maximum(size, least)


def refined(
    drag: Array,
    stiffness: Array,
    values: Array,
    right: Array,
    left: Array,
) -> tuple[Array, Array, Array]:
    """Values (q,), right (m, q) and left vectors (q, m), w^T (2 s + D) u = 1, the worst refined.

    A state too close to another for one step to separate them is left unchanged.
    """
    rough = np.maximum(
        residual(drag, stiffness, values, right), residual(drag.T, stiffness.T, values, left.T)
    )
    chosen = [k for k in np.argsort(-rough)[:_MOST] if rough[k] > _ROUGH]
    values, right, left = values.copy(), right.copy(), left.copy()
    for k in chosen:
        better = _better(drag, stiffness, values[k], right[:, k], left[k])
        if better is not None:
            values[k], right[:, k], left[k] = better
    return values, right, left


def _better(
    drag: Array, stiffness: Array, s: complex, u: Array, w: Array
) -> tuple[complex, Array, Array] | None:
    """One state after a refinement step, real if it was real; None if it turned into another."""
    if s.imag == 0:
        s, u, w = s.real, u.real, w.real
    unit = np.eye(len(u))
    matrix = s * (s * unit + drag) + stiffness
    try:
        u, before, w, also = np.linalg.solve(matrix, u), u, np.linalg.solve(matrix.T, w), w
    except np.linalg.LinAlgError:  # the state is exact
        return None
    u, w = (x / np.abs(x).max() for x in (u, w))  # a nearly singular solve can return any length
    u = u * (np.vdot(u, before) / np.vdot(u, u))  # the original length and phase
    w = w / (w @ (2 * s * u + drag @ u))
    same = np.linalg.norm(u - before) < _SAME * np.linalg.norm(before)
    if not (same and np.linalg.norm(w - also) < _SAME * np.linalg.norm(also)):
        return None
    return s - w @ (s * (s * u + drag @ u) + stiffness @ u), u, w


def cleared(
    matrix: Array,
    values: Array,
    vectors: Array,
    block: Array,
    span: Array,
    inverse: Array,
) -> Array:
    """Eigenvectors (n, q) of a real matrix (n, n), cleared of an invariant subspace.

    The subspace, which contains none of them, is spanned by `span` (n, b), on which the matrix is
    T = `block` (b, b); `inverse` (b, n) is its left basis. One first-order step: with
    r = A v - s v,  v+ = v + span (s - T)^-1 inverse r. The left vectors of drifting motions are so
    long that the rounding of fast vectors is amplified a million times along them.
    """
    if not len(block):
        return vectors
    rest = matrix @ vectors.real + 1j * (matrix @ vectors.imag) - vectors * values
    shifted = values[:, None, None] * np.eye(len(block)) - block
    share = np.linalg.solve(shifted, (inverse @ rest).T[:, :, None])[:, :, 0]
    return vectors + span @ share.T


def at_rest(matrix: Array, span: Array, shift: float) -> tuple[Array, Array]:
    """(T, V) of a real matrix (n, n) on its invariant subspace of nearly zero eigenvalues.

    `span` (n, b), orthonormal, is improved by inverse iteration at the `shift`, far below all other
    eigenvalues. T = shift + (V^T (A - shift)^-1 V)^-1, so entries that are small beside the matrix
    are not lost in A V.
    """
    factor = linalg.lu_factor(matrix - shift * np.eye(len(matrix)))
    for _ in range(2):
        span = np.linalg.qr(linalg.lu_solve(factor, span))[0]
    inverse = span.T @ linalg.lu_solve(factor, span)
    return shift * np.eye(len(inverse)) + np.linalg.inv(inverse), span
