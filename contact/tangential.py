"""Stick and slip under given normal forces: minimise t.B t/2 + c.t with |t_i| <= b_i at each point.

t_i in the plane of the road. Where |t_i| < b_i: (B t + c)_i = 0, the point sticks; where
|t_i| = b_i: (B t + c)_i = -lambda_i t_i, lambda_i >= 0, it slips against its force. One solution
when the symmetric part of B is positive definite.
"""

import numpy as np
from numpy.typing import NDArray

from fem.errors import ConvergenceError

Array = NDArray[np.float64]

NEWTON_STEPS = 30
GRADIENT_STEPS = 5000
TOLERANCE = 1e-10  # of the largest bound, or of the largest force where nothing is bounded


def stick_slip(matrix: Array, constant: Array, bound: Array, guess: Array) -> Array:
    """Tangential forces t (a, 2) N.

    `matrix` B (2a, 2a) m/N, `constant` c (a, 2) m, `bound` (a,) N, infinite where nothing slips,
    `guess` (a, 2). Semismooth Newton on t = P_b(t - r (B t + c)), P_b the projection on the discs
    (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353); projected gradients, slow
    but sure for symmetric B, where Newton circles. Returns with a residual below 1e-10 of the
    forces or raises ConvergenceError.
    """
    if np.isinf(bound).all():
        return -np.linalg.solve(matrix, constant.ravel()).reshape(-1, 2)
    step = 1.0 / matrix.diagonal().reshape(-1, 2).mean(axis=1)
    force = _onto_discs(guess, bound)
    for _ in range(NEWTON_STEPS):
        residual, change = _newton(matrix, constant, bound, force, step)
        if _small(residual, force, bound):
            return _onto_discs(force, bound)
        force = force + change
    return _gradients(matrix, constant, bound, guess)


def _newton(matrix: Array, constant: Array, bound: Array, force: Array, step: Array):
    """The residual (a, 2) N and the step of semismooth Newton."""
    rate = (matrix @ force.ravel()).reshape(-1, 2) + constant
    trial = force - step[:, None] * rate
    length = np.linalg.norm(trial, axis=1)
    slips = length > bound
    # Derivative of the projection: identity where it sticks, else b/|t| (I - n n^T).
    normal = trial / np.where(length > 0.0, length, 1.0)[:, None]
    across = np.eye(2) - normal[:, :, None] * normal[:, None, :]
    share = np.where(slips, np.where(np.isinf(bound), 0.0, bound) / np.maximum(length, 1e-300), 0.0)
    derivative = np.where(slips[:, None, None], share[:, None, None] * across, np.eye(2))
    scaled = step[:, None, None] * derivative
    a = len(bound)
    jacobian = np.einsum("ikl,iljm->ikjm", scaled, matrix.reshape(a, 2, a, 2))
    diagonal = np.arange(a)
    jacobian[diagonal, :, diagonal, :] += np.eye(2) - derivative
    residual = force - _onto_discs(trial, bound)
    change = np.linalg.solve(jacobian.reshape(2 * a, 2 * a), -residual.ravel())
    return residual, change.reshape(-1, 2)


def _gradients(matrix: Array, constant: Array, bound: Array, guess: Array) -> Array:
    """Projected gradients with Nesterov's momentum, restarted where it points uphill."""
    step = 1.0 / np.linalg.norm(matrix, 2)
    force = ahead = _onto_discs(guess, bound)
    weight = 1.0
    for _ in range(GRADIENT_STEPS):
        rate = (matrix @ ahead.ravel()).reshape(-1, 2) + constant
        new = _onto_discs(ahead - step * rate, bound)
        if _small((new - ahead) * (matrix.diagonal().max() * step) ** -1.0, new, bound):
            return new
        if ((ahead - new) * (new - force)).sum() > 0.0:
            weight = 1.0
        later = 0.5 + np.sqrt(0.25 + weight**2)
        ahead = new + (weight - 1.0) / later * (new - force)
        force, weight = new, later
    raise ConvergenceError(
        "contact: stick and slip found no balance; take a smaller [time] step, a smaller friction "
        "or a softer brush"
    )


def _onto_discs(force: Array, bound: Array) -> Array:
    length = np.linalg.norm(force, axis=1)
    share = np.minimum(1.0, bound / np.where(length > 0.0, length, 1.0))
    return force * np.where(length > bound, share, 1.0)[:, None]


def _small(residual: Array, force: Array, bound: Array) -> bool:
    finite = bound[np.isfinite(bound)]
    scale = max(float(finite.max(initial=0.0)), float(np.abs(force).max(initial=0.0)))
    return bool(np.abs(residual).max(initial=0.0) <= TOLERANCE * scale)
