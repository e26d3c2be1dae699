"""Modal damping: proportional to the matrices, or by the strain energy of the rubber.

    D_mod = diag(gamma1 + gamma2 omega_k^2)  or that of the losses (modal.basis.Projection), with the diagonal

    d_k = 2 zeta_k omega_k = eta_k omega_k,  eta_k = sum_r eta_r (phi_k . K_r phi_k) / (phi_k . K phi_k),

where K_r is the material part of the tangent of region r and eta_r its loss factor. Cords, pressure
and geometric stiffness store energy and dissipate none (Ungar and Kerwin 1962; Johnson and Kienholz
1982, doi 10.2514/3.51195). Where compounds lose differently, their losses couple modes besides:
without it a tire moves up to 4 dB too little far from the force, from 250 Hz on
(docs/verification/mobility.md). D_mod acts on the body rate, which adds Omega D_mod B to the
stiffness of the rolling tire.

Motions outside the modal basis are damped too: by gamma1 and gamma2 or, with loss factors, at the
uniform rate of the highest modes,

    D = M Phi (D_mod - d_c) Phi^T M + d_c M,   d_c = eta_c omega_m,

where eta_c is the mean loss factor of the upper quarter of the modes. Their moduli, where these
depend on frequency, are those in the middle of the band and grow as in the upper quarter: the
stiffness is

    K' = g_c K + M Phi (stiffness - g_c diag(squares_k)) Phi^T M.
"""

from __future__ import annotations

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.wheel import Damping, Proportional, StrainEnergy
from tireroad.modal.basis import Projection


def modal_damping(damping: Damping, projection: Projection) -> np.ndarray:
    """D_mod (m, m) 1/s of the modes. InputError if loss factors are missing."""
    if isinstance(damping, StrainEnergy):
        if projection.losses is None:
            raise InputError(
                "damping: no compound of the tire has a loss_factor: give one, or a [damping] table"
            )
        return projection.losses
    mass, stiffness = damping
    return np.diag(mass + stiffness * projection.squares)


def rates(damping: Damping, projection: Projection) -> np.ndarray:
    """Damping rates d_k (m,) 1/s of the modes, each alone. InputError if loss factors are missing."""
    return np.diag(modal_damping(damping, projection)).copy()


def ratios(damping: Damping, projection: Projection) -> np.ndarray:
    """Damping ratios zeta_k = d_k / 2 omega_k (m',) of the m' standing modes; NaN for rigid ones."""
    circular = 2 * np.pi * projection.frequency
    given = rates(damping, projection)[: projection.modes]
    return np.divide(given, 2 * circular, out=np.full(len(circular), np.nan), where=circular > 0)


def beyond(damping: Damping, projection: Projection) -> Proportional:
    """The damping of motions that the modes do not contain."""
    if isinstance(damping, StrainEnergy):
        highest = np.sqrt(max(float(projection.own_squares[: projection.modes].max()), 0.0))
        return Proportional(tail_loss(projection) * highest, 0.0)
    return Proportional(*damping)


def tail_loss(projection: Projection) -> float:
    """Loss factor eta_c of motions beyond the modes: the mean over their upper quarter."""
    assert projection.loss_factor is not None, "modal_damping refuses modes without losses"
    return float(projection.loss_factor[_upper(projection)].mean())


def tail_growth(projection: Projection) -> float:
    """g_c, growth of the stiffness of motions beyond the modes: the mean over their upper quarter."""
    upper = _upper(projection)
    if projection.band_rise is None or not (projection.squares[upper] > 0).all():
        return 1.0
    return float(1 + (projection.band_rise[upper] / projection.squares[upper]).mean())


def _upper(projection: Projection) -> slice:
    count = projection.modes
    return slice(count - max(count // 4, 1), count)
