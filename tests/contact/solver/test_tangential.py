"""Stick and slip: the compliance through the nodes, many points."""

import numpy as np
import pytest
from scipy import sparse

from tireroad.contact.solver.active_set import COMPILED
from tireroad.contact.solver.stick_slip import PlaneCompliance, stick_slip


@pytest.mark.parametrize("skew", [0.0, 1.0, 30.0])
@pytest.mark.parametrize("n", [1, 20, 300])
def test_gmres_solves_what_is_far_from_symmetric(skew: float, n: int) -> None:
    rng = np.random.default_rng(1)
    factor, turn = rng.standard_normal((2, n, n))
    matrix = factor @ factor.T / n + 0.1 * np.eye(n) + skew * (turn - turn.T) / n**0.5
    right, found = rng.standard_normal(n), np.zeros(n)

    @COMPILED.ffi.callback("int(void *, const double *, double *)")
    def apply(of, v, out) -> int:
        given = np.frombuffer(COMPILED.ffi.buffer(v, 8 * n))
        np.frombuffer(COMPILED.ffi.buffer(out, 8 * n))[:] = matrix @ given
        return 0

    def solved(right: np.ndarray, tolerance: float) -> int:
        vectors = COMPILED.doubles(right), tolerance, COMPILED.doubles(found)
        return COMPILED.lib.krylov(n, apply, COMPILED.ffi.NULL, *vectors)

    rough = solved(right, 1e-2)
    assert np.linalg.norm(matrix @ found - right) <= 1.01e-2 * np.linalg.norm(right)
    assert solved(right, 1e-10) >= rough
    assert np.linalg.norm(matrix @ found - right) < 1e-9 * np.linalg.norm(right)
    assert solved(0 * right, 1e-2) == 0 and not found.any()


def case(rng: np.random.Generator, points: int, nodes: int):
    """Nodes carry points: the same through the nodes and as one matrix, and springs."""
    factor = rng.standard_normal((2 * nodes, 2 * nodes))
    matrix = factor @ factor.T / nodes
    weights, spring = rng.random((points, nodes)), 0.1 + rng.random(points)
    weights /= weights.sum(axis=1, keepdims=True)
    lift = np.kron(np.eye(2), weights)
    return (
        PlaneCompliance(matrix, sparse.csr_matrix(weights)),
        PlaneCompliance(lift @ matrix @ lift.T),
        spring,
    )


def test_the_compliance_through_nodes_is_the_matrix() -> None:
    rng = np.random.default_rng(2)
    through, dense, _ = case(rng, 30, 7)
    force = rng.standard_normal((2, 30))
    assert np.allclose(through.sheared(force), dense.sheared(force), rtol=1e-12)
    assert np.allclose(through.own, dense.own, rtol=1e-12)
    assert through.bound >= dense.bound * (1 - 1e-12)


@pytest.mark.parametrize("bound", [0.5, 2.0, np.inf])
def test_hundreds_of_points_balance(bound: float) -> None:
    rng = np.random.default_rng(3)
    through, dense, spring = case(rng, 300, 40)
    constant, bounds = rng.standard_normal((300, 2)), bound * (0.2 + rng.random(300))
    force = stick_slip(through, constant, bounds, np.zeros((300, 2)), spring)
    other = stick_slip(dense, constant, bounds, force[::-1].copy(), spring)
    assert np.allclose(force, other, atol=1e-8 * abs(force).max())
    moved = (dense.tire @ force.T.ravel()).reshape(2, -1).T + spring[:, None] * force + constant
    pair, rate = force @ [1, 1j], moved @ [1, 1j]
    slips = np.abs(pair) > bounds * (1 - 1e-9)
    assert np.abs(rate[~slips]).max(initial=0.0) < 1e-8
    assert np.all((rate * pair.conj()).real[slips] <= 1e-8)
    assert np.abs((rate * pair.conj()).imag[slips]).max(initial=0.0) < 1e-8
    assert slips.sum() == 0 if np.isinf(bound) else 10 < slips.sum() < 300
