"""The bordered factor against a fresh one, and a checkpoint in the middle of its life."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import MatrixCompliance
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import LoadedColumns


def compliance(rng: np.random.Generator, n: int) -> np.ndarray:
    factor, turn = rng.standard_normal((2, n, n))
    return factor @ factor.T / n + 0.1 * np.eye(n) + 0.02 * (turn - turn.T)


def touching(matrix: np.ndarray, active: np.ndarray, right: np.ndarray) -> np.ndarray:
    """q (n,) m for which just these points touch, with forces A_NN^-1 r on them, if these are positive."""
    q = np.ones(len(active))
    q[active] = -right
    force = np.zeros(len(active))
    force[active] = np.linalg.solve(matrix[np.ix_(active, active)], right)
    q[~active] = 1.0 - (matrix @ force)[~active]
    return q


def test_points_come_and_go_without_a_new_factor_each_time() -> None:
    rng = np.random.default_rng(4)
    n, steps = 120, 200
    matrix = compliance(rng, n)
    solver = ActiveSet(matrix)
    active = rng.random(n) < 0.6
    for _ in range(steps):
        active[rng.integers(0, n, 2)] ^= True
        wanted = np.where(active, 0.1 + rng.random(n), 0.0)
        found = solver.solve(touching(matrix, active, (matrix @ wanted)[active]), active)
        assert np.abs(found - wanted).max() < 1e-11 * np.abs(wanted).max()
    assert solver.factorisations < steps / 2


def test_from_nothing_to_everything_and_back() -> None:
    rng = np.random.default_rng(5)
    matrix = compliance(rng, 30)
    solver = ActiveSet(matrix)
    for count in (0, 1, 2, 0, 30, 29, 0, 3):
        active = np.arange(30) < count
        wanted = np.where(active, 0.1 + rng.random(30), 0.0)
        q = touching(matrix, active, (matrix @ wanted)[active])
        assert np.allclose(solver.solve(q, active), wanted, atol=1e-11)


def test_singular_set_is_refused_and_forgotten() -> None:
    solver = ActiveSet(MatrixCompliance(np.diag([1.0, 0.0, 1.0])))
    with pytest.raises(ConvergenceError, match="singular"):
        solver.solve(-np.ones(3), np.array([False, True, True]))
    force = solver.solve(np.array([-1.0, 1.0, -1.0]), np.array([True, False, True]))
    assert np.array_equal(force, [1.0, 0.0, 1.0])


def test_goes_on_from_a_checkpoint_with_the_same_bits() -> None:
    rng = np.random.default_rng(6)
    matrix = compliance(rng, 80)
    first, second = ActiveSet(matrix), ActiveSet(matrix)
    q = rng.standard_normal(80) - 0.5
    for k in range(60):
        q = q + 0.02 * rng.standard_normal(80)
        force = first.solve(q)
        if k >= 30:
            assert np.array_equal(second.solve(q), force)
        if k == 29:
            assert not np.array_equal(first.active, first.state()["factorised"])
            second.set_state({name: value.copy() for name, value in first.state().items()})


@pytest.mark.mpi
@pytest.mark.parametrize(("loaded", "run"), [(0, 1), (1, 1), (7, 1), (40, 1), (1, 9), (4, 5)])
def test_loaded_columns_are_the_whole_product(loaded: int, run: int) -> None:
    """`loaded` runs of `run` points, on all processes together and on each alone; more processes than rows too."""
    rng = np.random.default_rng(loaded)
    for rows in (3000, 2):
        matrix, force = rng.standard_normal((rows, 40)), np.zeros(40)
        alone, shared = LoadedColumns(matrix), LoadedColumns(matrix, MPI.COMM_WORLD)
        for _ in range(3):
            force[:] = 0.0
            begins = rng.choice(40, loaded, replace=False)
            index = (begins[:, None] + np.arange(run)) % 40
            force[index] = rng.standard_normal(index.shape)
            assert np.allclose(alone @ force, matrix @ force, atol=1e-13)
            assert np.allclose(shared @ force, matrix @ force, atol=1e-13)
            assert np.array_equal(alone @ force, LoadedColumns(matrix) @ force)
