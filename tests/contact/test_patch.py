"""Which points of the tread take part, and which of them are the border."""

import numpy as np

from tireroad.contact.patch import make_patch


def test_points_within_reach_and_their_border() -> None:
    around, along = 12, 7
    ring, arc = np.meshgrid(np.arange(around), np.arange(along), indexing="ij")
    away = np.minimum(ring, around - ring) ** 2 + (arc - 3) ** 2
    positions = np.stack([ring, arc, away], axis=-1).reshape(-1, 3) * 0.01
    gap = np.where(away <= 1, 0.0, 1e-3 * away).ravel()
    force = np.where(away <= 1, 2.0, 0.0).ravel()
    halves = np.tile([0.005, 0.004], (around * along, 1))
    patch = make_patch(positions, halves, force, gap, (around, along), reach=4.5e-3)
    assert np.array_equal(patch.index[~patch.edge], np.flatnonzero(gap <= 4.5e-3))
    assert patch.force.sum() == force.sum()
    assert np.allclose(patch.area, 8e-5)
    # One row more watches: the neighbours of distance 4 along the lattice, across its seam too.
    beyond = away.ravel()[patch.index[patch.edge]]
    assert set(beyond) == {5, 9}
    assert (patch.index % along == patch.line).all()
    assert patch.extent == (0.0, 0.11, 0.0, 0.06)


def test_a_bead_is_no_border() -> None:
    around, along = 8, 3
    gap = np.where(np.arange(around) < 3, 0.0, 1.0).repeat(along)
    zeros = np.zeros((around * along, 3))
    halves = np.full((around * along, 2), 0.01)
    patch = make_patch(zeros, halves, 0 * gap, gap, (around, along), reach=0.5)
    assert patch.edge.reshape(5, along).tolist() == [[False] * 3] * 3 + [[True] * 3] * 2
