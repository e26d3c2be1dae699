"""Standing modes of spring chains against closed forms: count, inertia, residuals, multiplicity."""

import numpy as np
import pytest
from chains import chain, distributed, own_rows, ring, spatial
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import gram, multiply
from tireroad.modal.solver.slicing import Modes, merged
from tireroad.modal.solver.symmetry import DofPositions
from tireroad.modal.standing import solved

COMM = MPI.COMM_WORLD
ROUNDING = 1e-9  # relative error of an eigenvalue of a well-scaled chain


def ones(size: int, unit: int = 1) -> np.ndarray:
    low, high = own_rows(size, unit=unit)
    return np.ones(high - low)


def checked(matrix, mass, modes: Modes) -> None:
    """Residual and orthonormality, measured here once more with the unscaled matrices."""
    product = multiply(matrix, modes.vectors)
    weighted = mass[:, None] * modes.vectors
    np.testing.assert_allclose(
        gram(COMM, modes.vectors, weighted), np.eye(len(modes.squares)), atol=1e-10
    )
    defect = COMM.allreduce(((product - weighted * modes.squares) ** 2).sum(axis=0))
    assert np.sqrt(defect).max() <= 1e-8 * max(modes.squares.max(), 1.0)


@pytest.mark.mpi
@pytest.mark.parametrize("count", [1, 7, 150, 400])
def test_chain(count):
    """From one mode to all of them; a slice holds 160, so this crosses slices and fills the space."""
    stiffness, exact = chain(400)
    matrix, mass = distributed(stiffness), ones(400)
    modes = undamped.solve(matrix, mass, count)
    np.testing.assert_allclose(modes.squares, exact[:count], rtol=ROUNDING)
    assert modes.inertia_count == (exact < modes.counted_below).sum() >= count
    checked(matrix, mass, modes)


@pytest.mark.mpi
def test_careful_first_steps_become_one_slice():
    """Two factorisations a slice: 150 modes take one where no team waits for work, none larger than it may be."""
    stiffness, exact = chain(3000)
    modes = undamped.solve(distributed(stiffness), ones(3000), 150)
    np.testing.assert_allclose(modes.squares, exact[:150], rtol=1e-7)
    assert modes.slices == 1 if COMM.size == 1 else modes.slices > 1


@pytest.mark.parametrize("most", [10, 25, 1000])
def test_steps_that_are_merged(most):
    """No step above `most` unless it was; both ends stay, and every end is one of the counted values."""
    below = np.cumsum([[0, 0], [3, 4], [1, 0], [30, 9], [2, 2], [5, 5], [0, 1]], axis=0)
    steps = [(float(k), one) for k, one in enumerate(below)]
    kept = merged(steps, most)
    ends = [int(value) for value, _ in kept]
    assert ends[0] == 0 and ends[-1] == 6
    each = np.diff([one.sum() for _, one in kept])
    assert {10: [8, 39, 4, 10, 1], 25: [8, 39, 15], 1000: [62]}[most] == each.tolist()


@pytest.mark.mpi
def test_mass_scales_the_problem():
    """Unequal masses: the same eigenvalues as the dense generalised problem."""
    stiffness, _ = chain(90)
    weights = np.linspace(0.5, 3.0, 90)
    low, high = own_rows(90)
    matrix, mass = distributed(stiffness), weights[low:high]
    modes = undamped.solve(matrix, mass, 20)
    scaled = stiffness.toarray() / np.sqrt(np.outer(weights, weights))
    np.testing.assert_allclose(modes.squares, np.linalg.eigvalsh(scaled)[:20], rtol=ROUNDING)
    checked(matrix, mass, modes)


@pytest.mark.mpi
def test_all_modes_below_a_frequency():
    stiffness, exact = chain(300)
    limit = 0.11  # Hz
    modes = undamped.solve(distributed(stiffness), ones(300), up_to=limit)
    wanted = exact[exact < (2 * np.pi * limit) ** 2]
    assert 64 < len(wanted) < 300
    assert modes.inertia_count == len(modes.squares) == len(wanted)
    np.testing.assert_allclose(modes.squares, wanted, rtol=ROUNDING)


def test_no_mode_below_the_frequency():
    stiffness, _ = chain(30)
    with pytest.raises(ConvergenceError, match="no mode below"):
        undamped.solve(distributed(stiffness), ones(30), up_to=1e-4)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ({}, "give either count .* or up_to"),
        ({"count": 5, "up_to": 100.0}, "not both"),
        ({"count": 0}, "count must be ≥ 1, not 0"),
        ({"count": -3}, "count must be ≥ 1"),
        ({"count": 2.5}, "count must be a whole number, not 2.5"),
        ({"up_to": 0.0}, "up_to must be ≥ 0.001 Hz, not 0"),
        ({"up_to": -1.0}, "up_to must be ≥ 0.001 Hz"),
        ({"up_to": float("nan")}, "up_to must be a finite number"),
    ],
)
def test_which_modes_is_one_number_in_its_range(wanted: dict, message: str) -> None:
    """Before anything is solved: without a lowest mode or an upper limit a search never ends."""
    with pytest.raises(InputError, match=f"modes: .*{message}"):
        solved(None, **wanted)


@pytest.mark.mpi
def test_ring_has_a_rigid_mode_and_exact_pairs():
    stiffness, exact = ring(200)
    matrix, mass = distributed(stiffness), ones(200)
    modes = undamped.solve(matrix, mass, 75)
    assert modes.rigid == 1
    assert abs(modes.squares[0]) < 1e-12
    np.testing.assert_allclose(modes.squares[1:], exact[1:75], rtol=ROUNDING)
    checked(matrix, mass, modes)


def test_fewer_modes_than_rigid_ones():
    stiffness, _ = ring(40)
    three = sparse.kron(sparse.identity(3), stiffness, format="csr")
    modes = undamped.solve(distributed(three), np.ones(120), 2)
    assert modes.rigid == len(modes.squares) == 2
    assert modes.inertia_count >= 3


@pytest.mark.parametrize("copies", [3, 12, 20])
def test_multiplicity_beyond_the_block(copies):
    """More equal eigenvalues than a block has columns: none may be missed."""
    stiffness, exact = chain(25)
    many = sparse.kron(sparse.identity(copies), stiffness, format="csr")
    modes = undamped.solve(distributed(many), ones(25 * copies), 5 * copies)
    np.testing.assert_allclose(modes.squares, np.repeat(exact[:5], copies), rtol=ROUNDING)


@pytest.mark.parametrize("shift", [0.005, 0.05])
def test_negative_stiffness_is_named(shift):
    stiffness, exact = chain(50)
    lowered = stiffness - shift * sparse.identity(50, format="csr")
    count = int((exact < shift).sum())
    with pytest.raises(ConvergenceError, match=f"{count} negative eigenvalue.*buckles"):
        undamped.solve(distributed(lowered), ones(50), 4)


@pytest.mark.mpi
def test_mirror_planes_split_a_symmetric_chain():
    """Nodes on the x axis, symmetric about 0: y-mirror and x-mirror make four parts."""
    stiffness, exact = chain(61)
    matrix = spatial(stiffness, (1.0, 2.0, 3.0))
    low, high = own_rows(183, unit=3)
    points = np.zeros((61, 3))
    points[:, 0] = np.linspace(-1, 1, 61)
    modes = undamped.solve(
        distributed(matrix, unit=3),
        ones(183, unit=3),
        40,
        sites=DofPositions.of_nodes(points[low // 3 : high // 3]),
    )
    assert sorted(modes.sectors) == [30, 31, 61, 61]
    everything = np.sort(np.concatenate([exact, 2 * exact, 3 * exact]))
    np.testing.assert_allclose(modes.squares, everything[:40], rtol=ROUNDING)
    checked(distributed(matrix, unit=3), ones(183, unit=3), modes)


def test_one_odd_spring_breaks_the_mirror():
    """The nodes are symmetric, the matrix is not: only the plane it does have may be used."""
    stiffness, _ = chain(61)
    stiffness = stiffness.tolil()
    stiffness[7, 7] += 1e-6
    matrix = spatial(stiffness.tocsr(), (1.0, 2.0, 3.0))
    points = np.zeros((61, 3))
    points[:, 0] = np.linspace(-1, 1, 61)
    modes = undamped.solve(distributed(matrix), ones(183), 40, sites=DofPositions.of_nodes(points))
    assert sorted(modes.sectors) == [61, 122]
    dense = np.linalg.eigvalsh(matrix.toarray())
    np.testing.assert_allclose(modes.squares, dense[:40], rtol=ROUNDING)


@pytest.mark.mpi
def test_same_subspace_on_any_number_of_processes():
    """The projector on a spectral subspace, against the one from the dense problem."""
    stiffness, _ = ring(120)
    modes = undamped.solve(distributed(stiffness), ones(120), 31)  # 0 and fifteen pairs
    _, dense = np.linalg.eigh(stiffness.toarray())
    low, high = own_rows(120)
    whole = np.concatenate(COMM.allgather(modes.vectors))
    expected = dense[:, :31] @ dense[:, :31].T
    np.testing.assert_allclose(whole @ whole[low:high].T, expected[:, low:high], atol=1e-9)
