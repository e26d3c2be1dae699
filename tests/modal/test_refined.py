"""States next to rest beside fast ones: as accurate on their own problem as all others."""

import numpy as np
import pytest

from tireroad.modal import rotating as room
from tireroad.modal.rotating import AT_REST, at_rest, checks, refined, residual, rotating


def free_rim(drift: float, count: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """D~ and K~ of a wheel that turns with its rim free: two motions that nothing holds, one of them damped
    by no more than `drift`, among modes up to 25 kHz, and the rounding that a projection leaves.
    """
    random = np.random.default_rng(5)
    squares = np.concatenate([[0.0, 0.0], np.geomspace(1e4, 2.5e10, count - 2)])
    part = random.standard_normal((count, count))
    gyroscopic = 30.0 * (part - part.T)
    gyroscopic[:2], gyroscopic[:, :2] = 0.0, 0.0
    drag = 60.0 * np.eye(count) + gyroscopic
    drag[1, 1] = drift
    stiffness = np.diag(squares) + 1e2 * gyroscopic
    stiffness[2:, 0] += 300.0 * random.standard_normal(
        count - 2
    )  # what the drift does to the others
    stiffness += 1e-10 * random.standard_normal((count, count)) * (squares[:, None] > 0)
    return drag, stiffness


@pytest.mark.parametrize("drift", [1e-7, 1e-4])
def test_motions_adrift_leave_all_states_accurate(drift: float) -> None:
    drag, stiffness = free_rim(drift)
    states = rotating(drag, stiffness)
    figures = checks(states, drag, stiffness)
    assert figures["worst residual"] < 1e-11 and figures["worst left residual"] < 1e-10
    assert max(figures.values()) < 1e-7
    expected = [0.0, 0.0, -drift]
    found = np.sort(np.linalg.eigvals(states.block).real)
    np.testing.assert_allclose(found, np.sort(expected), atol=1e-9)


def test_without_the_refinement_they_are_not(monkeypatch) -> None:
    """What the steps are for: with what rounding couples the drift to, straight from the companion matrix."""
    drag, stiffness = free_rim(1e-7)
    stiffness[:2, 2:] = 1e-6 * np.random.default_rng(2).standard_normal((2, len(drag) - 2))
    better = checks(rotating(drag, stiffness), drag, stiffness)
    monkeypatch.setattr(room, "at_rest", lambda matrix, span, shift: (_on(matrix, span), span))
    monkeypatch.setattr(room, "cleared", lambda matrix, values, vectors, *block: vectors)
    plain = checks(rotating(drag, stiffness), drag, stiffness)
    for name in ("worst residual", "sum identity 0", "sum identity 1"):
        assert plain[name] > 100 * better[name]


def _on(matrix: np.ndarray, span: np.ndarray) -> np.ndarray:
    return span.T @ matrix @ span


def test_a_slow_state_alone_is_found_to_its_own_digits() -> None:
    """One damped mode of 1e-3 rad/s beside one of 1e5: s = -d/2 +- ..., known in closed form."""
    drag, stiffness = np.diag([2.0, 50.0]), np.array([[1e-6, 0.0], [0.3, 1e10]])
    slow = -1e-6 / (1 + np.sqrt(1 - 1e-6))
    values = np.array([slow * (1 + 1e-6) + 0j])
    right = np.array([[1.0], [-0.3e-10]], complex)
    left = np.array([[0.5, 1e-9]], complex)
    s, u, w = refined(drag, stiffness, values, right, left)
    assert s[0].real == pytest.approx(slow, rel=1e-12)
    assert residual(drag, stiffness, s, u)[0] < 1e-10
    assert w[0] @ (2 * s[0] * u[:, 0] + drag @ u[:, 0]) == pytest.approx(1.0, rel=1e-12)


def test_what_is_next_to_rest_keeps_its_digits() -> None:
    """T of an invariant subspace to its own size, not to that of the matrix."""
    random = np.random.default_rng(3)
    slow, fast = np.array([[0.0, 1.0], [0.0, -3e-9]]), np.diag(-np.geomspace(50.0, 1e6, 10))
    turn = np.linalg.qr(random.standard_normal((12, 12)))[0]
    matrix = turn @ np.block([[slow, np.zeros((2, 10))], [np.zeros((10, 2)), fast]]) @ turn.T
    block, span = at_rest(matrix, turn[:, :2], AT_REST * 1e6)
    assert np.abs(matrix @ span - span @ block).max() < 1e-9
    assert np.abs(np.linalg.eigvals(block)).max() < 1e-4
