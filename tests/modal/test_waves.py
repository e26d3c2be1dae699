"""Names of modes on a ring of masses whose shapes are known waves."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.modal.waves import label

COMM = MPI.COMM_WORLD


def field(angle: np.ndarray, n: int, phase: float, kind: str) -> np.ndarray:
    """A wave of one component of the ring's own axes, Cartesian (nodes, 3)."""
    axes = {
        "tangential": np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1),
        "axial": np.stack([0 * angle, 1 + 0 * angle, 0 * angle], axis=1),
        "radial": np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], axis=1),
    }
    return np.cos(n * angle - phase)[:, None] * axes[kind]


@pytest.mark.mpi
@pytest.mark.parametrize("spread", [True, False])
def test_waves_are_named(spread):
    """Two circles of 24 unit masses, spread over the processes or each on one of them (a third has none): n,
    pairs, section numbers, a mixture.
    """
    angle = np.tile(np.arange(24) * np.pi / 12, 2)
    ring = np.repeat([0, 1], 24)
    points = np.stack([np.sin(angle), ring + 0.0, -np.cos(angle)], axis=1)
    waves = [
        field(angle, 2, 0.3, "radial"),
        field(angle, 2, 0.3 + np.pi / 4, "radial"),
        field(angle, 0, 0.0, "tangential"),
        field(angle, 2, 0.0, "axial") * (1 - 2 * ring[:, None]),
        field(angle, 2, np.pi / 4, "axial") * (1 - 2 * ring[:, None]),
        field(angle, 5, 1.0, "axial"),
        field(angle, 1, 0.0, "radial") + field(angle, 3, 0.0, "radial"),
    ]
    vectors = np.stack([wave.ravel() for wave in waves], axis=1)
    vectors /= np.linalg.norm(vectors, axis=0)
    mine = np.arange(COMM.rank, 48, COMM.size)
    if not spread and COMM.size > 1:
        mine = np.flatnonzero(ring == COMM.rank)
    own = (3 * mine[:, None] + np.arange(3)).ravel()
    names = label(COMM, points[mine], ring[mine], np.ones(len(own)), vectors[own])
    assert names.wave.tolist() == [2, 2, 0, 2, 2, 5, -1]
    assert names.section.tolist() == [0, 0, 0, 1, 1, 0, -1]
    np.testing.assert_allclose(names.share[:6], 1.0, atol=1e-12)
    assert names.share[6] == pytest.approx(0.5)
