"""Teams of processes that factorise together: the same modes for any grouping, and less on each process."""

import math

import numpy as np
import pytest
from chains import chain, distributed, own_rows, spatial
from mpi4py import MPI
from test_circulant import ring

from tireroad.modal.solver import undamped
from tireroad.modal.solver.slicing import ProcessGroup, Shifted, how_many
from tireroad.modal.solver.symmetry import DofPositions, sectors, symmetries

COMM = MPI.COMM_WORLD
NODES, COUNT = 520, 90


def beam() -> tuple[np.ndarray, DofPositions, np.ndarray]:
    """Three chains along x, of unlike stiffness: the matrix, own sites, exact eigenvalues, all simple."""
    stiffness, exact = chain(NODES)
    low, high = own_rows(3 * NODES, unit=3)
    points = np.zeros((NODES, 3))
    points[:, 0] = np.linspace(-1, 1, NODES)
    factors = (1.0, math.sqrt(2.1), math.sqrt(3.3))
    everything = np.sort(np.concatenate([factor * exact for factor in factors]))
    sites = DofPositions.of_nodes(points[low // 3 : high // 3])
    return distributed(spatial(stiffness, factors), unit=3), sites, everything


@pytest.mark.mpi
@pytest.mark.parametrize("mirrors", [True, False])
def test_the_same_modes_for_any_grouping(mirrors: bool) -> None:
    matrix, sites, exact = beam()
    low, high = own_rows(3 * NODES, unit=3)
    given = matrix, np.ones(high - low), COUNT
    found = [
        undamped.solve(*given, sites=sites if mirrors else None, teams=teams)
        for teams in range(1, COMM.size + 1)
    ]
    for modes in found:
        np.testing.assert_allclose(modes.squares, exact[:COUNT], rtol=1e-9)
        assert modes.inertia_count == (exact < modes.counted_below).sum() >= COUNT
        assert modes.residual.max() < 1e-8 and modes.orthonormality < 1e-10
        np.testing.assert_allclose(modes.vectors, found[0].vectors, atol=1e-7)


@pytest.mark.mpi
def test_wave_numbers_in_any_grouping() -> None:
    matrix, points = ring(9, True)
    low, high = own_rows(matrix.shape[0], unit=3)
    sites = DofPositions.of_nodes(points[low // 3 : high // 3])
    exact = np.linalg.eigvalsh(matrix.toarray())
    for teams in range(1, COMM.size + 1):
        modes = undamped.solve(
            distributed(matrix, unit=3), np.ones(high - low), 20, sites=sites, teams=teams
        )
        assert modes.segments == 9
        np.testing.assert_allclose(modes.squares, exact[:20], rtol=1e-9)


@pytest.mark.mpi
def test_a_process_holds_its_share() -> None:
    """Rows of every part, and of what is solved for; inertia is that of the whole."""
    matrix, sites, exact = beam()
    found = symmetries(matrix, sites.everywhere(COMM))
    team = ProcessGroup.of(COMM, 1)
    parts = sectors(matrix, [one.image for one in found], team)
    assert len(parts) == 4 and sum(part.matrix.shape[1] for part in parts) == 3 * NODES
    below = 0
    for part in parts:
        rows, size = part.matrix.shape
        assert rows <= size // COMM.size + 1
        shifted = Shifted(part.matrix, 0.01, team)
        right = np.random.default_rng(COMM.rank).standard_normal((rows, 3))
        answer = shifted.solve(right)
        whole = np.concatenate(COMM.allgather(answer))
        np.testing.assert_allclose(part.matrix @ whole - 0.01 * answer, right, atol=1e-7)
        below += shifted.negative
        shifted.destroy()
    assert below == (exact < 0.01).sum()
    team.disband()


@pytest.mark.mpi
def test_as_many_teams_as_memory_holds() -> None:
    assert how_many(COMM, 1e9, math.inf) == COMM.size
    assert how_many(COMM, 1e9, COMM.size * 1e9) == COMM.size
    assert how_many(COMM, 1e9, 1.5e9) == 1
    assert how_many(COMM, 1e9, 1e6) == 1
