"""States made accurate on the problem they came from, s^2 + s D + K, where the companion matrix left them rough.

The companion matrix of a wide spectrum knows its slow states to rounding of the fast ones: those of a free
rim, next to rest, most of all. For such a state one step of inverse iteration on the quadratic itself,

    Q(s) u+ = u,   Q(s)^T w+ = w,   Q(s) = s^2 + s D + K,

then w^T (2 s + D) u = 1 again, and the two-sided quotient  s+ = s - w^T Q(s) u  (Lancaster's, of the second
order in the vectors' errors).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

Array = np.ndarray

# States slower than this part of the fastest have terms of rounding alone: a faster one is their yardstick.
AT_REST = 1e-5
_ROUGH = 1e-11  # residual from which a state is made better
_MOST = 20  # such states, of which each costs a factorisation: more are no case of a few slow ones
_SAME = 1e-4  # relative change beyond which inverse iteration has left the state for a neighbour


def residual(drag: Array, stiffness: Array, values: Array, vectors: Array) -> Array:
    """||(s^2 + s D + K) u|| over the sum of its terms' norms, column by column."""

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
    """Values (q,), right vectors (m, q) and left ones (q, m) with w^T (2 s + D) u = 1, the roughest of them
    made better. A state next to another one, which one step cannot tell from it, stays as it is.
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
    """One state after a step, real if it was; None where it became another."""
    if s.imag == 0:
        s, u, w = s.real, u.real, w.real
    unit = np.eye(len(u))
    matrix = s * (s * unit + drag) + stiffness
    try:
        u, before, w, also = np.linalg.solve(matrix, u), u, np.linalg.solve(matrix.T, w), w
    except np.linalg.LinAlgError:  # the state is exact
        return None
    u, w = (x / np.abs(x).max() for x in (u, w))  # next to singular they may be of any size
    u = u * (np.vdot(u, before) / np.vdot(u, u))  # of the same length and phase
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
    """Eigenvectors (n, q) of a real matrix (n, n) without what they have of an invariant subspace `span` (n, b),
    T = `block` (b, b) on it, that is none of theirs; `inverse` (b, n) its left basis.

    A step of first order: with r = A v - s v,  v+ = v + span (s - T)^-1 inverse r. What drifts is so long on the
    left that rounding of fast vectors is seen along it a million times larger.
    """
    if not len(block):
        return vectors
    rest = matrix @ vectors.real + 1j * (matrix @ vectors.imag) - vectors * values
    shifted = values[:, None, None] * np.eye(len(block)) - block
    share = np.linalg.solve(shifted, (inverse @ rest).T[:, :, None])[:, :, 0]
    return vectors + span @ share.T


def at_rest(matrix: Array, span: Array, shift: float) -> tuple[Array, Array]:
    """(T, V): a real matrix (n, n) on its invariant subspace next to rest, `span` (n, b) orthonormal, and that
    subspace, by inverse iteration at the `shift`, far below all other eigenvalues.

    T = shift + (V^T (A - shift)^-1 V)^-1: what is small beside the matrix is not lost in A V.
    """
    factor = linalg.lu_factor(matrix - shift * np.eye(len(matrix)))
    for _ in range(2):
        span = np.linalg.qr(linalg.lu_solve(factor, span))[0]
    inverse = span.T @ linalg.lu_solve(factor, span)
    return shift * np.eye(len(inverse)) + np.linalg.inv(inverse), span
