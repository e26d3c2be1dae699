"""Residual flexibility with inertia and damping: states that represent the truncated modes.

The columns x = K_Omega^-1 b and the rows y = K_Omega^-T b of the probes, less their component in
the kept modes, are the residual attachment modes. On them the full matrices become

    q'' M_r + q' E_r + q G_0 = G_0 f,   u_r = G_0 q,
    G_0 = y^T K_Omega x - modal,  E_r = y^T (D + 2 Omega G) x - modal,  M_r = y^T M x - modal,

whose receptance has the exact value and slope of the truncated part at 0 Hz, and its leading
inertia. Standing, M_r and G_0 are positive and the states cannot grow; rolling, a state that grows
is made static. (MacNeal, Comput. Struct. 1 (1971) 581; Rubin, AIAA J. 13 (1975) 995; decoupled
here.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from tireroad.greens.hub import reading
from tireroad.greens.response import Response, couple
from tireroad.modal.rotating import checks, rotating
from tireroad.modal.states import StateModes, growing

# Share of the largest static flexibility below which a direction is rounding of the solver.
_ROUNDING = 1e-9
# Directions a thousand times faster than the slowest stay massless: no step resolves them.
_MASSLESS = 1e-6


@dataclass(frozen=True)
class Moments:
    """y^T (K_Omega, D + 2 Omega G, M) x between p probes, (p, p): m/N, m s/N, m s2/N.

    `momentum` (3, p) kg m/N: int rho x; or (12, p), followed by A_0 x, A_1 x and A_2 x of
    greens.hub.
    """

    compliance: np.ndarray
    damping: np.ndarray
    inertia: np.ndarray
    momentum: np.ndarray

    def plus(self, other: Moments) -> Moments:
        """Sum, term by term."""
        return Moments(*(a + b for a, b in zip(_parts(self), _parts(other), strict=True)))

    def minus(self, other: Moments) -> Moments:
        """Difference, term by term."""
        return Moments(*(a - b for a, b in zip(_parts(self), _parts(other), strict=True)))


def _parts(moments: Moments) -> tuple[np.ndarray, ...]:
    return moments.compliance, moments.damping, moments.inertia, moments.momentum


def modal_moments(
    drag: np.ndarray,
    stiffness: np.ndarray,
    outputs: np.ndarray,
    loads: np.ndarray,
    carried: np.ndarray,
) -> Moments:
    """Moments between outputs (r, m) and loads (k, m) of a pencil D~, K~ of unit mass."""
    x, y = np.linalg.solve(stiffness, loads.T), np.linalg.solve(stiffness.T, outputs.T).T
    return Moments(outputs @ x, y @ drag @ x, y @ x, carried @ x)


def second_order(
    response: Response,
    modes: StateModes,
    shape: np.ndarray,
    carried: np.ndarray,
    moments: Moments,
    loss: tuple[float, float] | None = None,
    hub: sparse.csr_matrix | None = None,
    felt: Callable[[np.ndarray], np.ndarray] = np.asarray,
) -> Response:
    """The response of p probes (outputs = forces) with residual states and an exact static limit.

    `shape` (p, m): the modal shapes at the probes; `carried` (3, m): the momentum of the modes.
    `loss`: the uniform damping rate (1/s) in the moments, and the loss factor eta that replaces it,
    each state being damped at eta times its own circular frequency. `hub` (p, 3): the weights by
    which probes read hub moments, which `response` lacks; `carried` and the momentum of the moments
    then have the rows of greens.hub. The immediate moments of the loads are not included. `felt`:
    what the axle feels of a first moment (Basis.felt).
    """
    missing = _missing(response, modes, shape, carried, moments)
    flexibility = missing.compliance
    hub = sparse.csr_matrix((len(flexibility), 3)) if hub is None else hub
    whole = reading(response, modes, hub, carried[3:])
    answers = moments.compliance - hub @ moments.momentum[3:6] if hub.nnz else moments.compliance
    sizes, directions = np.linalg.eigh((flexibility + flexibility.T) / 2)
    kept = sizes > _ROUNDING * np.abs(np.diag(moments.compliance)).max()
    if not kept.any():
        return replace(whole, residual=answers - whole.static())
    basis = directions[:, kept] / np.sqrt(sizes[kept])
    inertia = basis.T @ missing.inertia @ basis
    sizes, directions = np.linalg.eigh((inertia + inertia.T) / 2)
    kept = sizes > _MASSLESS * sizes.max()
    basis = basis @ directions[:, kept] / np.sqrt(sizes[kept])
    inverse = np.linalg.inv(basis.T @ missing.inertia @ basis)
    drag, stiffness = (
        inverse @ (basis.T @ matrix @ basis) for matrix in (missing.damping, flexibility)
    )
    if loss is not None:
        drag = drag + _by_loss_factor(stiffness, *loss)
    states = rotating(drag, stiffness)
    checks(states, drag, stiffness)
    output = flexibility @ basis
    forces = inverse @ (basis.T @ flexibility)
    beside = missing.momentum @ basis
    extra = couple(states, output, forces.T, felt(beside[:3]))
    extra = reading(extra, states, hub, beside[3:])
    whole = whole.joined(extra.keeping_where(lambda s: ~growing(s)))
    return replace(whole, residual=answers - whole.static())


def _by_loss_factor(stiffness: np.ndarray, rate: float, factor: float) -> np.ndarray:
    """eta sqrt(K) - rate: damping by a loss factor in place of a uniform rate, for unit mass."""
    squares, turn = np.linalg.eigh((stiffness + stiffness.T) / 2)
    own = factor * np.sqrt(np.maximum(squares, 0.0))
    return (turn * own) @ turn.T - rate * np.eye(len(squares))


def _missing(
    response: Response, modes: StateModes, shape: np.ndarray, carried: np.ndarray, moments: Moments
) -> Moments:
    """The moments less the modes' part of them."""
    x = _statics(modes, modes.left @ shape.T, modes.block_left @ shape.T)
    y = _adjoints(modes, shape @ modes.right, shape @ modes.block_right)
    return Moments(
        moments.compliance - response.static(),
        moments.damping - response.spectral_moment(),
        moments.inertia - y @ x,
        moments.momentum - carried @ x,
    )


def _statics(modes: StateModes, push: np.ndarray, block_push: np.ndarray) -> np.ndarray:
    """K~^-1 Phi^T (m, p): the modal coordinates under constant unit forces."""
    static = -((modes.right / modes.eigenvalue) @ push).real
    k = len(modes.block) - modes.rigid
    if k:
        static -= modes.block_right[:, :k] @ np.linalg.solve(modes.block[:k, :k], block_push[:k])
    return static


def _adjoints(modes: StateModes, reading: np.ndarray, block_reading: np.ndarray) -> np.ndarray:
    """Phi K~^-1 (p, m)."""
    static = -((reading / modes.eigenvalue) @ modes.left).real
    k = len(modes.block) - modes.rigid
    if k:
        static -= block_reading[:, :k] @ np.linalg.solve(modes.block[:k, :k], modes.block_left[:k])
    return static
