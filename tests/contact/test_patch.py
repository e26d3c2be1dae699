"""Which points of the tread take part, and which of them are the border."""

import numpy as np

from contact.patch import make_patch


def test_points_within_reach_and_their_border() -> None:
    around, along = 12, 7
    ring, arc = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    away = np.minimum(ring, around - ring) ** 2 + (arc - 3) ** 2
    positions = np.stack([ring, arc, away], axis=-1).reshape(-1, 3) * 0.01
    gap = np.where(away <= 1, 0.0, 1e-3 * away).ravel()
    force = np.where(away <= 1, 2.0, 0.0).ravel()
    halves = np.tile([0.005, 0.004], (around * along, 1))
    patch = make_patch(positions, halves, force, gap, (around, along), reach=4.5e-3)
    assert np.array_equal(patch.index, np.flatnonzero(gap <= 4.5e-3))
    assert patch.force.sum() == force.sum()
    assert np.allclose(patch.area, 8e-5)
    # The centre has all its neighbours across the seam of the ring; distance 4 has not.
    assert not patch.edge[patch.force > 0].any()
    assert patch.edge[away.ravel()[patch.index] == 4].all()
    assert patch.extent == (0.0, 0.11, 0.01, 0.05)


def test_a_bead_is_no_border() -> None:
    around, along = 8, 3
    gap = np.where(np.arange(around) < 3, 0.0, 1.0).repeat(along)
    zeros = np.zeros((around * along, 3))
    halves = np.full((around * along, 2), 0.01)
    patch = make_patch(zeros, halves, 0 * gap, gap, (around, along), reach=0.5)
    assert patch.edge.reshape(3, along).tolist() == [[True] * 3, [False] * 3, [True] * 3]
