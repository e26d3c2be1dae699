"""Estimated error of the receptance within a band, due to the truncated modes.

Every truncated mode is faster than the last one kept, w_c. With a damping rate d, its static
response differs from its true one by at most the share
b(w) = |w^2 - i w d| / |w_c^2 - w^2 + i w d|.  Hence

    none          |G_t| (1 + b) / |H|     G_t: upper half of the modes, for the tail
    dirac, static |G_res| b / |H|         a bound for a standing wheel
    attachment, second-order: (|H_x(w) - H_x(0)| + |G_res|) b / |H|, H_x the states beyond w_c,

in Frobenius norms over all outputs and forces. The axle force, the sum of the loads less the second
rate of the first moment, lacks  w^2 |m_r| (1 + b)  per unit load, m_r being the static moment
outside the states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.greens.response import Response


@dataclass(frozen=True)
class Cutoff:
    """The highest kept mode, `circular` rad/s, and the damping `rate` 1/s of those beyond it."""

    circular: float
    rate: float

    def share(self, frequency: np.ndarray) -> np.ndarray:
        """b at the frequencies (f,) Hz; infinite at and beyond the cutoff."""
        omega = 2 * np.pi * frequency
        damped = 1j * omega * self.rate
        b = np.abs(omega**2 - damped) / np.abs(self.circular**2 - omega**2 + damped)
        return np.where(omega < self.circular, b, np.inf)


def estimate(response: Response, option: str, cutoff: Cutoff, frequency: np.ndarray) -> np.ndarray:
    """Estimated relative error (f,) of the receptance at the frequencies in Hz."""
    H = response.receptance(frequency)
    share = cutoff.share(frequency)
    beyond = np.abs(response.eigenvalue) > cutoff.circular
    if option == "none":
        upper = np.abs(response.eigenvalue) > np.median(np.abs(response.eigenvalue))
        off = _size(response.static() - response.keeping(~upper).static()) * (1 + share)
    elif option in ("dirac", "static"):
        off = _size(response.residual) * share
    else:
        lagging = H - response.keeping(~beyond).receptance(frequency)
        off = (_size(lagging) + _size(response.residual)) * share
    return relative(off, _size(H))


def relative(off: np.ndarray, size: np.ndarray) -> np.ndarray:
    """off / size (f,); 0 where both are, as for points that the road holds."""
    return np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0)


def estimate_axle(response: Response, cutoff: Cutoff, frequency: np.ndarray) -> np.ndarray | None:
    """Estimated error (f,) of the axle force per unit load, root mean square over the loads.

    None where the static moment outside the states is unknown. At 0 Hz a load reaches the axle
    entirely.
    """
    if response.left_out is None:
        return None
    inertia, *rest = np.split(response.left_out, len(response.left_out) // 3)
    s = 2j * np.pi * frequency[:, None, None]
    felt = s**2 * inertia + (s * rest[0] if rest else 0.0)
    lacking = _size(felt) / np.sqrt(response.left_out.shape[1])
    share = np.where(frequency > 0, cutoff.share(frequency), 0.0)
    return lacking * (1 + share)


def _size(matrices: np.ndarray) -> np.ndarray:
    return np.linalg.norm(matrices, axis=(-2, -1))
