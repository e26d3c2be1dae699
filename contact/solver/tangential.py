"""Stick and slip under given normal forces: minimise t.B t/2 + c.t with |t_i| <= b_i at each point.

t_i lies in the plane of the road. Where |t_i| < b_i, (B t + c)_i = 0 and the point sticks; where
|t_i| = b_i, (B t + c)_i = -lambda_i t_i, lambda_i >= 0, and it slips against its force. The
solution is unique if the symmetric part of B is positive definite.
"""

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.solver.krylov import gmres
from tireroad.contact.tread.shear import Between
from tireroad.fem.errors import ConvergenceError

Array = NDArray[np.float64]
Plane = NDArray[np.complex128]

NEWTON_STEPS = 30
GRADIENT_STEPS = 5000
TOLERANCE = 1e-10  # of the largest bound, or of the largest force where nothing is bounded
INNER = 1e-3  # residual reduction in a Newton step; the slipping points are not known any better


class Stiffness:
    """B = W A W^T + diag(spring), plus S of the `tread`, between the points.

    `matrix` A (2n, 2n) m/N, x and y of each node adjacent; `weights` W (a, n) from nodes to points,
    None where they are the same; `spring` (a,) m/N. Forces and displacements in the plane are
    complex, x + iy.
    """

    def __init__(
        self,
        matrix: Array,
        weights: Array | None = None,
        spring: Array | float = 0.0,
        tread: Between | None = None,
    ) -> None:
        self._matrix, self._weights, self._tread = matrix, weights, tread
        # Own compliance of each point (a,), the mean of both directions.
        if weights is None:
            own = matrix.diagonal().reshape(-1, 2).mean(axis=1)
        else:
            mean = 0.5 * (matrix[::2, ::2] + matrix[1::2, 1::2])
            own = (weights @ mean * weights).sum(axis=1)
        self._spring = np.broadcast_to(np.asarray(spring, dtype=float), own.shape)
        self.inverse = 1.0 / (own + self._spring + (tread.own if tread else 0.0))

    def __call__(self, force: Plane) -> Plane:
        """B t (a,) m for t (a,) N."""
        moved = self._carcass(force) + self._spring * force
        return moved + self._tread.apply(force) if self._tread else moved

    def _carcass(self, force: Plane) -> Plane:
        """W A W^T t."""
        if self._weights is None:
            return (self._matrix @ force.view(float)).view(complex)
        nodal = self._weights.T @ force.view(float).reshape(-1, 2)
        moved = self._weights @ (self._matrix @ nodal.ravel()).reshape(-1, 2)
        return moved.view(complex)[:, 0]

    def norm(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        largest = float(np.linalg.norm(self._matrix, 2))
        if self._weights is not None:
            largest *= float(np.linalg.norm(self._weights, 2)) ** 2
        return largest + float(self._spring.max()) + (self._tread.bound if self._tread else 0.0)


def stick_slip(
    stiffness: Stiffness,
    constant: Array,
    bound: Array,
    guess: Array,
    within: float = TOLERANCE,
) -> Array:
    """Tangential forces t (a, 2) N.

    `stiffness` B, `constant` c (a, 2) m, `bound` (a,) N, infinite where nothing slips, `guess`
    (a, 2). Semismooth Newton on t = P_b(t - r (B t + c)), P_b the projection on the discs (Alart
    and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353), r the inverse of B's diagonal. Its
    linear problems are close to the identity if the bristles are softer than the tire, and GMRES
    solves them in a few products with B. If Newton cycles, projected gradients follow: slow but
    safe for symmetric B. The residual is below `within` of the forces, or ConvergenceError is
    raised.
    """
    begin, moved = (np.ascontiguousarray(a).view(complex)[:, 0] for a in (guess, constant))
    force = _onto_discs(begin, bound)
    for _ in range(NEWTON_STEPS):
        trial = force - stiffness.inverse * (stiffness(force) + moved)
        residual = force - _onto_discs(trial, bound)
        if _small(residual, force, bound, within):
            return _onto_discs(force, bound).view(float).reshape(-1, 2)
        force = force + _newton(stiffness, trial, bound, residual)
    return _gradients(stiffness, moved, bound, begin).view(float).reshape(-1, 2)


def _newton(stiffness: Stiffness, trial: Plane, bound: Array, residual: Plane) -> Plane:
    """The step d of semismooth Newton: d + P' (r B d - d) = -residual."""
    length = np.abs(trial)
    slips = length > bound
    # Derivative P' of the projection: the identity where a point sticks, else b/|t| (I - n n^T).
    long = np.where(slips, length, 1.0)
    normal, share = np.where(slips, trial, 0.0) / long, np.where(slips, bound, 1.0) / long

    def apply(flat: Array) -> Array:
        step = flat.view(complex)
        moved = stiffness.inverse * stiffness(step) - step
        moved -= normal * (normal.real * moved.real + normal.imag * moved.imag)
        return (step + share * moved).view(float)

    return gmres(apply, -residual.view(float), INNER).view(complex)


def _gradients(stiffness: Stiffness, constant: Plane, bound: Array, guess: Plane) -> Plane:
    """Projected gradients with Nesterov's momentum, restarted where it points uphill."""
    step = 1.0 / stiffness.norm()
    force = ahead = _onto_discs(guess, bound)
    weight = 1.0
    for _ in range(GRADIENT_STEPS):
        new = _onto_discs(ahead - step * (stiffness(ahead) + constant), bound)
        if _small((new - ahead) * stiffness.inverse / step, new, bound):
            return new
        if np.vdot(ahead - new, new - force).real > 0.0:
            weight = 1.0
        later = 0.5 + np.sqrt(0.25 + weight**2)
        ahead = new + (weight - 1.0) / later * (new - force)
        force, weight = new, later
    raise ConvergenceError(
        "contact: no equilibrium of stick and slip was found; take a smaller [time] step, a smaller friction "
        "or a softer brush"
    )


def _onto_discs(force: Plane, bound: Array) -> Plane:
    length = np.abs(force)
    outside = length > bound
    return np.where(outside, bound / np.where(outside, length, 1.0), 1.0) * force


def _small(residual: Plane, force: Plane, bound: Array, within: float = TOLERANCE) -> bool:
    largest = float(bound.max(initial=0.0))
    scale = max(largest if np.isfinite(largest) else 0.0, float(np.abs(force).max(initial=0.0)))
    return bool(np.abs(residual).max(initial=0.0) <= within * scale)
