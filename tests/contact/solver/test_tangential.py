"""Stick and slip: the stiffness through the nodes, its linear solver, many points."""

import numpy as np
import pytest
from scipy import sparse

from tireroad.contact.solver.stick_slip import Carcass, SlidingStiffness, gmres, stick_slip


@pytest.mark.parametrize("skew", [0.0, 1.0, 30.0])
def test_gmres_solves_what_is_far_from_symmetric(skew: float) -> None:
    rng = np.random.default_rng(1)
    factor, turn = rng.standard_normal((2, 60, 60))
    matrix = factor @ factor.T / 60 + 0.1 * np.eye(60) + skew * (turn - turn.T)
    right = rng.standard_normal(60)
    calls = []

    def apply(v: np.ndarray) -> np.ndarray:
        calls.append(1)
        return matrix @ v

    found = gmres(apply, right, 1e-10)
    assert np.linalg.norm(matrix @ found - right) < 1e-9 * np.linalg.norm(right)
    assert len(calls) <= 61  # a step each, and one product that checks the residual
    rough = gmres(apply, right, 1e-2)
    assert np.linalg.norm(matrix @ rough - right) <= 1.01e-2 * np.linalg.norm(right)
    assert not gmres(apply, 0 * right, 1e-2).any()


def test_gmres_of_many_unknowns_goes_on_beyond_its_short_cycle() -> None:
    rng = np.random.default_rng(4)
    factor = rng.standard_normal((300, 300))
    matrix, right = factor @ factor.T / 300 + 0.01 * np.eye(300), rng.standard_normal(300)
    found = gmres(lambda v: matrix @ v, right, 1e-8)
    assert np.linalg.norm(matrix @ found - right) < 1e-7 * np.linalg.norm(right)


def case(rng: np.random.Generator, points: int, nodes: int):
    """Nodes carry points: A between nodes, weights, springs, the same as one matrix."""
    factor = rng.standard_normal((2 * nodes, 2 * nodes))
    matrix = factor @ factor.T / nodes
    weights, spring = rng.random((points, nodes)), 0.1 + rng.random(points)
    weights /= weights.sum(axis=1, keepdims=True)
    lift = np.kron(weights, np.eye(2))
    dense = lift @ matrix @ lift.T + np.diag(np.repeat(spring, 2))
    return SlidingStiffness(Carcass(matrix, sparse.csr_matrix(weights)), spring), SlidingStiffness(
        Carcass(dense)
    )


def test_stiffness_through_nodes_is_the_matrix() -> None:
    rng = np.random.default_rng(2)
    through, dense = case(rng, 30, 7)
    force = rng.standard_normal(30) + 1j * rng.standard_normal(30)
    assert np.allclose(through(force), dense(force), rtol=1e-12)
    assert np.allclose(through.inverse, dense.inverse, rtol=1e-12)
    assert through.norm() >= dense.norm() * (1 - 1e-12)


def test_between_some_points_it_is_their_block() -> None:
    """Nodes that carry none of them are left out; weights may be negative, as those of quadratic elements."""
    rng = np.random.default_rng(6)
    factor = rng.standard_normal((24, 24))
    weights = np.zeros((40, 12))
    for point, row in enumerate(weights):
        row[(point // 4 + np.arange(3)) % 12] = [0.6, -0.1, 0.5]
    whole = Carcass(factor @ factor.T, sparse.csr_matrix(weights))
    for index in (np.array([3, 4, 9, 17]), np.arange(8, 20), np.arange(40)):
        block, force = whole.between(index), np.zeros(40, dtype=complex)
        force[index] = rng.standard_normal(len(index)) + 1j * rng.standard_normal(len(index))
        assert np.allclose(block(force[index]), whole(force)[index], rtol=1e-12)
        assert np.array_equal(block.own, whole.own[index])


@pytest.mark.parametrize("bound", [0.5, 2.0, np.inf])
def test_hundreds_of_points_balance(bound: float) -> None:
    rng = np.random.default_rng(3)
    through, dense = case(rng, 300, 40)
    constant, bounds = rng.standard_normal((300, 2)), bound * (0.2 + rng.random(300))
    force = stick_slip(through, constant, bounds, np.zeros((300, 2)))
    assert np.allclose(
        force, stick_slip(dense, constant, bounds, force[::-1].copy()), atol=1e-8 * abs(force).max()
    )
    pair, rate = force @ [1, 1j], through(force @ [1, 1j]) + constant @ [1, 1j]
    slips = np.abs(pair) > bounds * (1 - 1e-9)
    assert np.abs(rate[~slips]).max(initial=0.0) < 1e-8
    assert np.all((rate * pair.conj()).real[slips] <= 1e-8)
    assert np.abs((rate * pair.conj()).imag[slips]).max(initial=0.0) < 1e-8
    assert slips.sum() == 0 if np.isinf(bound) else 10 < slips.sum() < 300
