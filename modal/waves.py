"""Modes of an axisymmetric state by name: circumferential wave number n and number in the section.

    u(theta) = sum_n c_n e^{i n theta},   share of n = |c_n|^2 / sum |c|^2, in mass

with u in the components along and across the ring, which turn with the angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import summed

PURE = 0.99  # least share of one wave number; a footprint or a coarse ring mixes several


@dataclass(frozen=True)
class Labels:
    """`wave` (m,) the wave number n, `section` (m,) 0, 1, ... by frequency among those of the same n, the
    two of a pair alike; both -1 where no wave number holds 99 % of the mode. `share` (m,) of that n.
    """

    wave: np.ndarray
    section: np.ndarray
    share: np.ndarray

    def first(self, count: int) -> Labels:
        """Of the first `count` modes."""
        return Labels(self.wave[:count], self.section[:count], self.share[:count])


def label(
    comm: MPI.Comm, points: np.ndarray, ring: np.ndarray, mass: np.ndarray, vectors: np.ndarray
) -> Labels:
    """Names of the modes `vectors` (own rows n, m), ascending in frequency, kg^-1/2.

    `points` (own n / 3, 3) m, undeformed; `ring` (own n / 3,) the index of the circle each node is on,
    counted over all processes; `mass` (own rows) kg. Collective.
    """
    angle = np.arctan2(points[:, 0], -points[:, 2])
    circles = comm.allreduce(int(ring.max(initial=-1)), op=MPI.MAX) + 1
    number = np.arange(comm.allreduce(len(angle)) // circles // 2)
    shares = np.zeros((len(number), vectors.shape[1]))
    # Circle by circle, all wave numbers in one product: no copy of all fields.
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
    """Components tangential, along the axle and radial, of (nodes, 3, m)."""
    x, y, z = field.transpose(1, 0, 2)
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    return np.stack([cosine * x + sine * z, y, sine * x - cosine * z], axis=1)
