"""Rings of equal segments: split by wave number against the dense problem, and refused when not equal."""

import numpy as np
import pytest
from chains import distributed, own_rows
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.solver import undamped
from tireroad.modal.solver.symmetry import DofPositions, repeated

COMM = MPI.COMM_WORLD


def ring(segments: int, mirrored: bool, soft: float = 0.0) -> tuple[sparse.csr_matrix, np.ndarray]:
    """A made-up tire: 2 nodes a segment on 2 circles, springs of any direction to all of the next segment.

    `mirrored`: the same run the other way round the ring. `soft` is added to the diagonal.
    """
    random = np.random.default_rng(2)
    angle = 2 * np.pi * (np.arange(segments)[:, None] + np.array([0.0, 0.3, 0.0, 0.3])) / segments
    if mirrored:
        angle = (
            2 * np.pi * (np.arange(segments)[:, None] + np.array([0.0, 0.5, 0.0, 0.5])) / segments
        )
    reach = np.array([1.0, 1.0, 1.3, 1.3])
    points = np.stack(
        [
            reach * np.sin(angle),
            np.tile([0.0, 0.1, 0.2, 0.1], (segments, 1)),
            -reach * np.cos(angle),
        ],
        axis=-1,
    )
    size = 12 * segments
    matrix = np.zeros((size, size))
    stiffness = random.uniform(0.5, 2.0, (4, 8))
    for s in range(segments):
        for a in range(4):
            for b in range(8):
                one, other = (s, a), ((s + b // 4) % segments, b % 4)
                apart = b // 4 + (b % 2 - a % 2) / 2  # in segments
                if one == other or (mirrored and not 0 <= apart <= 1):
                    continue
                way = points[one] - points[other]
                length = np.linalg.norm(way)
                rule = stiffness[a, b] if not mirrored else np.rint(4 * length) / 4 + 0.2
                spring = rule * np.outer(way, way) / length**2
                i, j = (12 * k[0] + 3 * k[1] + np.arange(3) for k in (one, other))
                matrix[np.ix_(i, i)] += spring
                matrix[np.ix_(j, j)] += spring
                matrix[np.ix_(i, j)] -= spring
                matrix[np.ix_(j, i)] -= spring
    matrix += (0.05 + soft) * np.eye(size)
    return sparse.csr_matrix(matrix), points.reshape(-1, 3)


@pytest.mark.mpi
@pytest.mark.parametrize("mirrored", [True, False])
@pytest.mark.parametrize("segments", [8, 9])
@pytest.mark.parametrize("count", [1, 20, 10**6])
def test_against_the_dense_problem(segments, mirrored, count):
    matrix, points = ring(segments, mirrored)
    low, high = own_rows(matrix.shape[0], unit=3)
    mine = DofPositions.of_nodes(points[low // 3 : high // 3])
    stiffness = distributed(matrix, unit=3)
    modes = undamped.solve(stiffness, np.ones(high - low), count, sites=mine)
    exact, shapes = np.linalg.eigh(matrix.toarray())
    m = len(modes.squares)
    assert modes.segments == segments
    assert m == min(count, len(exact))
    np.testing.assert_allclose(modes.squares, exact[:m], rtol=1e-9)
    assert modes.inertia_count == (exact < modes.counted_below).sum() >= m
    assert modes.residual.max() < 1e-9
    assert modes.orthonormality < 1e-12
    if count == 20:
        whole = np.concatenate(COMM.allgather(modes.vectors))
        end = 20 if exact[20] - exact[19] > 1e-6 else 19
        expected = shapes[:, :end] @ shapes[:, :end].T
        np.testing.assert_allclose(whole[:, :end] @ whole[:, :end].T, expected, atol=1e-8)


def test_the_mirrored_ring_needs_no_complex_numbers():
    for mirrored in (True, False):
        matrix, points = ring(8, mirrored)
        found = repeated(distributed(matrix), DofPositions.of_nodes(points))
        assert (found.kept is not None) == mirrored
        assert found.wave(2).matrix.shape == ((12, 12) if mirrored else (24, 24))


def twisted(segments: int) -> tuple[sparse.csr_matrix, np.ndarray]:
    """A ring as belts at +-alpha make it: no mirror plane, the half turn about z; nodes at uneven angles, as
    elements of order 3 have them.
    """
    random = np.random.default_rng(5)
    fraction, y = np.array([0.0, 0.28, 0.72, 0.28, 0.72]), np.array([0.0, 0.1, -0.1, -0.1, 0.1])
    angle = 2 * np.pi * (np.arange(segments)[:, None] + fraction) / segments
    points = np.stack([np.sin(angle), np.tile(y, (segments, 1)), -np.cos(angle)], axis=-1)
    points = points.reshape(-1, 3)
    matrix = np.zeros((len(points), 3, len(points), 3))
    strength = random.uniform(0.5, 2.0, (5, 10))
    for s in range(segments):
        for a in range(5):
            for b in range(10):
                i, j = 5 * s + a, (5 * s + b) % len(points)
                if i == j:
                    continue
                way = points[i] - points[j]
                spring = strength[a, b] * np.outer(way, way) / (way @ way)
                for first, second, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                    matrix[first, :, second] += sign * spring
    flip = np.array([-1.0, -1.0, 1.0])
    distance = np.linalg.norm(points[:, None] - points * flip, axis=2)
    image = distance.argmin(axis=1)
    assert distance.min(axis=1).max() < 1e-12
    turned = matrix[image][:, :, image] * flip[:, None, None] * flip
    whole = (matrix + turned).reshape((3 * len(points),) * 2) / 2
    return sparse.csr_matrix(whole + 0.05 * np.eye(len(whole))), points


@pytest.mark.parametrize("segments", [8, 9])
def test_belts_at_an_angle_leave_the_half_turn(segments):
    """Real symmetric problems of one segment's size all the same; the half turn splits the ring where
    the period is not used. Against the dense problem.
    """
    matrix, points = twisted(segments)
    sites, stiffness = DofPositions.of_nodes(points), distributed(matrix)
    found = repeated(stiffness, sites)
    assert found.segments == segments
    assert found.kept is not None
    exact = np.linalg.eigvalsh(matrix.toarray())
    ones = np.ones(len(exact))
    by_waves = undamped.solve(stiffness, ones, 50, sites=sites)
    by_turn = undamped.solve(stiffness, ones, 50, sites=sites, waves=False)
    assert by_waves.segments == segments
    assert by_turn.symmetries == ("half turn about z",)
    assert len(by_turn.sectors) == 2
    for modes in (by_waves, by_turn):
        np.testing.assert_allclose(modes.squares, exact[:50], rtol=1e-9)
        assert modes.residual.max() < 1e-9
        assert modes.orthonormality < 1e-11


def test_pairs_are_cos_and_sin_about_the_lowest_point():
    """Of each pair the first is its own image in the half turn about z, the second its own negative one."""
    matrix, points = twisted(9)
    modes = undamped.solve(
        distributed(matrix), np.ones(135), 40, sites=DofPositions.of_nodes(points)
    )
    flip = np.array([-1.0, -1.0, 1.0])
    image = np.linalg.norm(points[:, None] - points * flip, axis=2).argmin(axis=1)
    shapes = modes.vectors.reshape(-1, 3, 40)
    turned = (flip[:, None] * shapes[image]).reshape(-1, 40)
    parity = (turned * modes.vectors).sum(axis=0)
    np.testing.assert_allclose(np.abs(parity), 1.0, atol=1e-9)
    k, pairs = 6, 0  # after the rigid ones
    while k < 39:
        if modes.squares[k + 1] - modes.squares[k] < 1e-9 * modes.squares[k]:
            np.testing.assert_allclose(parity[k : k + 2], [1.0, -1.0], atol=1e-9)
            k, pairs = k + 1, pairs + 1
        k += 1
    assert pairs > 10


def test_one_odd_spring_is_noticed():
    matrix, points = ring(8, True)
    assert repeated(distributed(matrix), DofPositions.of_nodes(points)).segments == 8
    matrix[30, 30] += 1e-8
    assert repeated(distributed(matrix), DofPositions.of_nodes(points)) is None
    matrix, points = ring(8, True)
    assert repeated(distributed(matrix), DofPositions.of_nodes(points + [0.01, 0.0, 0.0])) is None


def test_all_below_a_frequency_and_none():
    matrix, points = ring(9, False)
    exact = np.linalg.eigvalsh(matrix.toarray())
    sites, ones, stiffness = (
        DofPositions.of_nodes(points),
        np.ones(matrix.shape[0]),
        distributed(matrix),
    )
    limit = np.sqrt((exact[24] + exact[25]) / 2) / (2 * np.pi)
    wanted = exact[exact < (2 * np.pi * limit) ** 2]
    modes = undamped.solve(stiffness, ones, up_to=limit, sites=sites)
    np.testing.assert_allclose(modes.squares, wanted, rtol=1e-9)
    assert modes.inertia_count == len(wanted)
    with pytest.raises(ConvergenceError, match="no mode below 0.001"):
        undamped.solve(stiffness, ones, up_to=1e-3, sites=sites)


def test_negative_stiffness_is_named():
    matrix, points = ring(8, True, soft=-0.3)
    count = int((np.linalg.eigvalsh(matrix.toarray()) < 0).sum())
    assert count > 0
    with pytest.raises(ConvergenceError, match=f"{count} negative eigenvalue.*buckles"):
        undamped.solve(distributed(matrix), np.ones(96), 4, sites=DofPositions.of_nodes(points))
