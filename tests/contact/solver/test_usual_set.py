"""The active set as what differs from the usual set, against the plain active set, and a checkpoint of it."""

import numpy as np
import pytest

from tireroad.contact.solver import active_set
from tireroad.contact.solver.active_set import ActiveSet, Pivot, UsualSet
from tireroad.contact.solver.projected_cg import MatrixCompliance
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.fem.errors import ConvergenceError, InputError

SHAPE, PITCH = (22, 14), 0.004


def compliance() -> np.ndarray:
    """Half-space on a grid, with the slight skew part of a rolling tire."""
    points = np.stack(np.indices(SHAPE), axis=-1).reshape(-1, 2) * PITCH
    matrix = half_space_compliance(points, np.full(points.shape, PITCH / 2), 1e7, 0.49)
    turn = np.random.default_rng(2).standard_normal(matrix.shape)
    return matrix + 1e-3 * matrix.max() * (turn - turn.T)


def gaps(steps: int) -> np.ndarray:
    """Of a bowl on a rough road that moves by half a point a step, (steps, n) m; it sinks in on the way."""
    i, j = np.indices(SHAPE)
    bowl = 4e-6 * ((i - 10.5) ** 2 + (j - 6.5) ** 2)
    rough = 2e-4 * np.random.default_rng(3).standard_normal((SHAPE[0] + steps, SHAPE[1]))
    out = [bowl - 2e-4 - 1e-6 * k - rough[k // 2 : k // 2 + SHAPE[0]] for k in range(steps)]
    return np.array(out).reshape(steps, -1)


def test_pivoted_forces_are_those_of_the_matrix() -> None:
    """Of a base far from what touches, and from any guess, with a reference that presses on more than the base."""
    rng, matrix = np.random.default_rng(4), compliance()
    n, plain = len(matrix), ActiveSet(compliance())
    taken = rng.random(n) < 0.7
    base, guess = taken & (rng.random(n) < 0.6), taken & (rng.random(n) < 0.5)
    q, reference = rng.standard_normal((2, n)) * [[1e-4], [1.0]]
    reference = np.where(taken, np.abs(reference), 0.0)
    q[~taken] = 1.0  # so that they are clear of the road
    pivot = Pivot(MatrixCompliance(matrix), taken, base)
    pivot.refer(reference)
    wanted = plain.solve(q, reference=reference)
    assert 20 < (wanted > 0).sum() < taken.sum() - 20
    assert np.abs(pivot.solve(q, guess) - wanted).max() < 1e-11 * wanted.max()


@pytest.mark.parametrize("price", [6.0, 1e-3])
def test_agrees_with_the_plain_active_set(price: float, monkeypatch) -> None:
    """Also where the base is chosen anew again and again, and points dropped."""
    monkeypatch.setattr(active_set, "PRICE", price)
    monkeypatch.setattr(active_set, "SELDOM", 0.5)
    matrix = compliance()
    usual, plain = UsualSet(MatrixCompliance(matrix)), ActiveSet(matrix)
    counts = []
    for q in gaps(60):
        force, wanted = usual.solve(q), plain.solve(q)
        assert np.array_equal(usual.active, plain.active)
        assert np.abs(force - wanted).max() < 1e-10 * wanted.max()
        assert np.abs(usual.gap - plain.gap).max() < 1e-14
        assert usual.residual < 1e-12
        counts.append(usual.active.sum())
    assert 20 < min(counts) < max(counts) < 0.9 * len(matrix)


def test_the_state_at_rest_stays_to_the_bit() -> None:
    matrix, q = compliance(), gaps(1)[0]
    plain = ActiveSet(matrix)
    static = plain.solve(q)
    solver, rest = UsualSet(MatrixCompliance(matrix)), np.where(static > 0, 0.0, plain.gap)
    for guess in (static > 0, None, None):
        assert np.array_equal(solver.solve(rest, guess, reference=static), static)


def test_goes_on_from_a_checkpoint_with_the_same_bits() -> None:
    matrix, q = compliance(), gaps(30)
    static = ActiveSet(matrix).solve(q[0])
    first, second = (UsualSet(MatrixCompliance(matrix)) for _ in range(2))
    second.set_state(first.state())  # nothing was solved yet
    for k in range(30):
        force = first.solve(q[k] + matrix @ static, static > 0 if k == 0 else None, static)
        if k >= 12:
            assert np.array_equal(second.solve(q[k] + matrix @ static, None, static), force)
        elif k == 11:
            second.set_state({name: value.copy() for name, value in first.state().items()})


def test_no_contact_and_nonsense() -> None:
    matrix, q = compliance(), gaps(1)[0]
    solver = UsualSet(MatrixCompliance(matrix))
    assert not solver.solve(q + 1.0).any()
    assert np.allclose(solver.solve(q), ActiveSet(matrix).solve(q), rtol=1e-10)
    with pytest.raises(ConvergenceError, match="not finite"):
        solver.solve(q * np.nan)
    with pytest.raises(InputError, match="positive definite"):
        UsualSet(MatrixCompliance(-matrix)).solve(q)
