"""Signs, order and bases of modes by rule: from any basis of the same spaces, on any number of processes."""

import numpy as np
import pytest
from chains import chain, distributed, own_rows, ring, spatial
from mpi4py import MPI
from scipy import linalg

from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import normalise_modes, ordered
from tireroad.modal.solver.symmetry import DofPositions

COMM = MPI.COMM_WORLD


def space(size: int, columns: int) -> np.ndarray:
    """An orthonormal random basis, the same on every process."""
    return np.linalg.qr(np.random.default_rng(4).standard_normal((size, columns)))[0]


@pytest.mark.mpi
@pytest.mark.parametrize("width", [1, 2, 5])
def test_the_basis_depends_on_the_space_alone(width):
    """Groups of `width` columns turned by a random orthogonal matrix end in the same vectors."""
    low, high = own_rows(60)
    fields, group = space(60, 10), np.arange(10) // width
    turns = [linalg.qr(np.random.default_rng(k).standard_normal((width, width)))[0] for k in (1, 2)]
    found = []
    for turn in turns:
        mine = (fields @ np.kron(np.eye(10 // width), turn))[low:high].copy()
        normalise_modes(COMM, mine, np.arange(low, high), group)
        found.append(np.concatenate(COMM.allgather(mine)))
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    largest = found[0][np.abs(found[0]).argmax(axis=0), np.arange(10)]
    assert (largest[::width] > 0).all()
    np.testing.assert_allclose(found[0].T @ found[0], np.eye(10), atol=1e-12)


@pytest.mark.mpi
def test_equal_components_are_told_apart_by_position():
    """An antisymmetric vector has two largest components: the one that comes first in rank is positive."""
    low, high = own_rows(40)
    rank = np.random.default_rng(1).permutation(40)
    vector = np.zeros(40)
    vector[[11, 28]] = 1.0, -1.0 - 1e-9
    mine = -np.sign(rank[28] - rank[11]) * vector[low:high, None]
    normalise_modes(COMM, mine, rank[low:high], np.array([0]))
    whole = np.concatenate(COMM.allgather(mine))[:, 0]
    assert whole[11 if rank[11] < rank[28] else 28] > 0


def test_order_of_equal_values_is_by_family():
    values = np.array([2.0, 1.0, 1.0 + 1e-13, 3.0, 1.0 - 1e-13, 2.0])
    order, group = ordered(values, np.array([0, 2, 0, 1, 2, 1]), 1e-10)
    assert order.tolist() == [2, 4, 1, 0, 5, 3]
    assert group.tolist() == [0, 1, 1, 2, 3, 4]


def numbered(order: np.ndarray) -> np.ndarray:
    """Modes (183, 40) of a symmetric chain in space whose unknowns the matrix has in another order."""
    matrix = spatial(chain(61)[0], (1.0, 2.0, 3.0)).tocsr()[order][:, order]
    points = np.zeros((61, 3))
    points[:, 0] = np.linspace(-1, 1, 61)
    every = DofPositions.of_nodes(points)
    low, high = own_rows(183, unit=3)
    mine = order[low:high]
    modes = undamped.solve(
        distributed(matrix, unit=3),
        np.ones(len(mine)),
        40,
        sites=DofPositions(every.place[mine], every.component[mine]),
    )
    out = np.empty((183, 40))
    out[order] = np.concatenate(COMM.allgather(modes.vectors))
    return out


@pytest.mark.mpi
def test_modes_do_not_depend_on_the_numbering():
    """Another number of processes numbers unknowns otherwise: vectors, signs and order stay."""
    nodes = np.random.default_rng(3).permutation(61)
    mixed = numbered((3 * nodes[:, None] + np.arange(3)).ravel())
    np.testing.assert_allclose(mixed, numbered(np.arange(183)), atol=1e-9)


def test_a_repeated_frequency_without_symmetry_has_one_basis():
    """A ring of springs, no sites: pairs are turned by the rule, from whatever the solver returned."""
    stiffness, _ = ring(120)
    modes = undamped.solve(distributed(stiffness), np.ones(120), 31)
    for k in range(1, 31, 2):
        pair = modes.vectors[:, k : k + 2].copy()
        again = pair @ np.array([[0.6, -0.8], [0.8, 0.6]])
        normalise_modes(COMM, again, np.arange(120), np.zeros(2, int))
        np.testing.assert_allclose(again, pair, atol=1e-6)
