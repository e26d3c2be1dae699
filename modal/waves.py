"""Names for modes of an axisymmetric state: circumferential wave number n, cross-section order.

    u(theta) = sum_n c_n e^{i n theta},   share of n = |c_n|^2 / sum |c|^2, mass-weighted

where u has tangential, axial and radial components.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import summed

PURE = 0.99  # least share of the leading wave number; a footprint or a coarse ring mixes several


@dataclass(frozen=True)
class Labels:
    """Names of m modes.

    `wave` (m,) is the wave number n and `section` (m,) the order 0, 1, ... by frequency among the
    modes of that n, equal for the two of a pair; both are -1 where no wave number holds 99 % of the
    mode. `share` (m,) is the share of n.
    """

    wave: np.ndarray
    section: np.ndarray
    share: np.ndarray

    def first(self, count: int) -> Labels:
        """The names of the first `count` modes."""
        return Labels(self.wave[:count], self.section[:count], self.share[:count])


def label(
    comm: MPI.Comm, points: np.ndarray, ring: np.ndarray, mass: np.ndarray, vectors: np.ndarray
) -> Labels:
    """Names of the modes `vectors` (own rows n, m), kg^-1/2, ascending in frequency.

    `points` (own n / 3, 3) m, undeformed; `ring` (own n / 3,) the index of the circle that each
    node lies on, over all processes; `mass` (own rows) kg. Collective.
    """
    angle = np.arctan2(points[:, 0], -points[:, 2])
    circles = comm.allreduce(int(ring.max(initial=-1)), op=MPI.MAX) + 1
    number = np.arange(comm.allreduce(len(angle)) // circles // 2)
    shares = np.zeros((len(number), vectors.shape[1]))
    # One circle at a time, all wave numbers in one product: avoids a copy of all fields.
    for circle in range(circles):
        on = np.flatnonzero(ring == circle)
        root = np.sqrt(mass[3 * on])
        field = (
            _along_ring(angle[on], vectors.reshape(len(angle), 3, vectors.shape[1])[on])
            * root[:, None, None]
        )
        waves = root * np.exp(-1j * number[:, None] * angle[on])
        amplitude = summed(comm, waves @ field.reshape(len(on), 3 * vectors.shape[1]))
        square = (np.abs(amplitude) ** 2).reshape(len(number), 3, -1).sum(axis=1)
        shares += square / comm.allreduce(float((root**2).sum()))
    shares[1:] *= 2
    wave, share = shares.argmax(axis=0), shares.max(axis=0)
    wave = np.where(share >= PURE, wave, -1)
    section = np.full(len(wave), -1)
    for n in np.unique(wave[wave >= 0]):
        same = np.flatnonzero(wave == n)
        section[same] = np.arange(len(same)) // (2 if n else 1)
    return Labels(wave, section, share)


def _along_ring(angle: np.ndarray, field: np.ndarray) -> np.ndarray:
    """Tangential, axial and radial components of a field (nodes, 3, m)."""
    x, y, z = field.transpose(1, 0, 2)
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    return np.stack([cosine * x + sine * z, y, sine * x - cosine * z], axis=1)
