"""The second eigenproblem on rings with closed forms and on random matrices of a tire's structure."""

import numpy as np
import pytest
from rings import inextensional_ring, random_tire, wave_ring
from scipy import linalg

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.basis import Projection
from tireroad.modal.campbell import critical_speed, growth, onset, sweep
from tireroad.modal.rotating import _invariant, checks, matrices, rotating, standing
from tireroad.modal.states import growing

WAVES = {0: 300.0, 1: 420.0, 2: 500.0, 3: 800.0, 4: 1300.0}


def states(modes) -> np.ndarray:
    """All 2m eigenvalues, those of the block included."""
    pairs = modes.eigenvalue[modes.eigenvalue.imag > 0]
    return np.concatenate([modes.eigenvalue, pairs.conj(), np.linalg.eigvals(modes.block)])


def nearest(found: np.ndarray, exact: np.ndarray) -> float:
    return max(np.abs(found - value).min() for value in exact)


@pytest.mark.parametrize("speed", [0.0, 20.0, 100.0, 400.0])
@pytest.mark.parametrize("damping", [0.0, 50.0])
def test_doppler_shift_is_exact(speed, damping):
    """s = -gamma/2 +- i sqrt(omega^2 - gamma^2/4) +- i n Omega, below and past the critical speed."""
    drag, stiffness = matrices(wave_ring(WAVES), speed, (damping, 0.0), "doppler")
    found = states(rotating(drag, stiffness))
    assert len(found) == 20
    exact = [
        -damping / 2 + 1j * (sign * np.sqrt(w**2 - damping**2 / 4) + way * n * speed)
        for n, w in WAVES.items()
        for sign in (1, -1)
        for way in (1, -1)
    ]
    assert nearest(found, np.array(exact)) < 1e-9 * 1300.0
    assert nearest(np.array(exact), found) < 1e-9 * 1300.0


@pytest.mark.parametrize("speed", [0.0, 100.0])
def test_inextensional_ring_of_endo(speed):
    """Both frames, against Endo's closed form and its figures for R = 0.3 m, h = 0.015 m."""
    waves = [2, 3, 4]
    bending = 4.8e8 * 0.015**2 / (12 * 1200.0 * 0.3**4)
    projection = inextensional_ring(waves, bending, speed)
    found = np.abs(states(rotating(*matrices(projection, speed, (0.0, 0.0), "full"))).imag)
    n = np.array(waves)
    root = np.sqrt(n**2 * (n**2 - 1) ** 2 / (n**2 + 1) * (bending + speed**2 / (n**2 + 1)))
    turn = 2 * n * speed / (n**2 + 1)
    fixed = np.concatenate([np.abs(turn + root - n * speed), np.abs(turn - root - n * speed)])
    assert nearest(found, fixed) < 1e-9 * root.max()
    printed = {
        0.0: [12.995, 36.755, 70.475],
        100.0: [42.199, 91.206, 146.295, 4.002, 14.812, 33.950],
    }
    assert nearest(found / (2 * np.pi), np.array(printed[speed])) < 6e-4


@pytest.mark.parametrize("speed", [0.0, 30.0])
@pytest.mark.parametrize("gamma", [0.0, 500.0, 3000.0, 1e5])
def test_identities_and_residuals(speed, gamma):
    """From undamped to all pairs overdamped; `checks` raises when an identity fails."""
    drag, stiffness = matrices(random_tire(40), speed, (gamma, 0.0), "full")
    modes = rotating(drag, stiffness)
    figures = checks(modes, drag, stiffness)
    assert figures["biorthogonality"] < 1e-9
    assert figures["sum identity 0"] < 1e-9
    assert figures["sum identity 1"] < 1e-9
    assert len(states(modes)) == 80
    if gamma == 1e5 and speed == 0:
        assert (modes.eigenvalue.imag == 0).all()


def test_checks_notice_a_wrong_left_vector():
    drag, stiffness = matrices(random_tire(10), 30.0, (500.0, 0.0), "full")
    modes = rotating(drag, stiffness)
    modes.left[3] *= 1.001
    with pytest.raises(ConvergenceError, match="sum identity"):
        checks(modes, drag, stiffness)


@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_left_vectors_are_the_right_ones_of_the_other_turn(inertia):
    """With gamma2 = 0 the transposed pencil is that of -Omega."""
    projection = random_tire(30)
    one = rotating(*matrices(projection, 40.0, (500.0, 0.0), inertia))
    other = rotating(*matrices(projection, -40.0, (500.0, 0.0), inertia))
    for k, s in enumerate(one.eigenvalue):
        twin = np.argmin(np.abs(other.eigenvalue - s))
        assert abs(other.eigenvalue[twin] - s) < 1e-9 * abs(s)
        left, right = one.left[k], other.right[:, twin]
        cosine = abs(left.conj() @ right) / np.linalg.norm(left) / np.linalg.norm(right)
        assert cosine > 1 - 1e-9


def test_slow_rotation_goes_over_into_standing():
    """Two ways to one answer: the coupled problem at speed 0, and mode by mode."""
    projection = random_tire(25)
    coupled = rotating(*matrices(projection, 0.0, (900.0, 1e-5), "full"))
    single = standing(projection, (900.0, 1e-5))
    assert nearest(states(coupled), states(single)) < 1e-9 * 4000.0
    one = (coupled.right / coupled.eigenvalue @ coupled.left).real
    np.testing.assert_allclose(
        one, (single.right / single.eigenvalue @ single.left).real, atol=1e-9 * np.abs(one).max()
    )


@pytest.mark.parametrize(("offset", "size"), [(0.0, 4), (1e-14, 4), (1e-9, 0)])
def test_critical_damping_goes_into_a_block(offset, size):
    """gamma = 2 omega: two eigenvalues meet in one vector, and beside it they are still apart."""
    projection = wave_ring({0: 300.0, 2: 500.0})
    gamma = 600.0 * (1 + offset)
    drag, stiffness = matrices(projection, 0.0, (gamma, 0.0), "full")
    for modes in (rotating(drag, stiffness), standing(projection, (gamma, 0.0))):
        assert len(modes.block) == size
        checks(modes, drag, stiffness)


def test_exactly_repeated_eigenvalues_stay_biorthogonal():
    """Eight equal rings: every eigenvalue sixteenfold at rest, eightfold when they turn."""
    projection = wave_ring({2: 500.0, 3: 800.0}, repeats=8)
    for speed in (0.0, 60.0):
        drag, stiffness = matrices(projection, speed, (300.0, 0.0), "doppler")
        figures = checks(rotating(drag, stiffness), drag, stiffness)
        assert figures["biorthogonality"] < 1e-9


def test_critical_speed_of_a_ring():
    """omega_n = n Omega: the slowest wave of the ring is overtaken first."""
    projection = wave_ring(WAVES)
    exact = min(w / n for n, w in WAVES.items() if n)
    assert critical_speed(projection, "doppler") == pytest.approx(exact, rel=1e-12)
    _, stiffness = matrices(projection, exact, (0.0, 0.0), "doppler")
    assert np.linalg.eigvalsh(stiffness)[0] == pytest.approx(0.0, abs=1e-9 * 1300.0**2)


def test_onset_of_instability():
    """A ring held by a stiffer spring at one side: stable at rest, growing past a speed found by onset."""
    projection = wave_ring(WAVES)
    extra = np.zeros((10, 10))
    extra[2:6, 2:6] = 2e4  # couples n = 1 with n = 2, as a footprint does
    squares, turn = np.linalg.eigh(np.diag(projection.squares) + extra)
    rotated = {
        name: turn.T @ getattr(projection, name) @ turn
        for name in ("gyroscopic", "convective", "body", "body_convective")
    }
    tire = type(projection)(squares=squares, momentum=projection.momentum, **rotated)
    speeds = np.linspace(0.0, 600.0, 61)
    rates = np.array([growth(tire, speed, (1.0, 0.0), "doppler") for speed in speeds])
    assert rates[0] == 0.0
    assert (rates > 0).any()
    first = speeds[np.argmax(rates > 0)]
    found = onset(tire, (1.0, 0.0), "doppler", float(first))
    assert first - 10.0 <= found <= first
    assert growth(tire, found, (1.0, 0.0), "doppler") > 0
    assert growth(tire, 0.998 * found, (1.0, 0.0), "doppler") == 0


def test_branches_go_straight_through_crossings():
    """Lines omega_n +- n Omega cross many times; tracked by shape they stay straight."""
    speeds = np.linspace(1.0, 101.0, 41)
    lines = sweep(wave_ring(WAVES), (0.0, 0.0), "doppler", speeds, 10)
    slope = np.diff(lines.eigenvalue.imag, axis=0) / np.diff(speeds)[:, None]
    waves = np.rint(slope[0])
    np.testing.assert_allclose(slope, np.broadcast_to(waves, slope.shape), atol=1e-6)
    assert sorted(waves) == [-4, -3, -2, -1, 0, 0, 1, 2, 3, 4]
    order = np.argsort(lines.frequency[-1])
    assert (order != np.arange(10)).any(), "no crossing: the test tests nothing"


def test_rounding_is_no_growth():
    """Undamped states lie on the axis to rounding, on either side: none grows, and one that does is seen."""
    drag, stiffness = matrices(random_tire(20), 20.0, (0.0, 0.0), "full")
    found = rotating(drag, stiffness)
    assert (found.every.real > 0).any()
    assert found.unstable == 0
    assert not growing(found.every).any()
    drag = drag - 1e-3 * np.eye(20)
    found = rotating(drag, stiffness)
    assert found.unstable == growing(found.every).sum() > 0
    assert found.fastest_growth == pytest.approx(5e-4, rel=0.5)


def test_critical_speed_of_a_free_ring() -> None:
    """Of a ring that nothing holds, n = 0, 1 (rigid: 2 translations) and n >= 2, k_n = w_n²/n² per wave
    number: at speed V the translations' stiffness is V² (centrifugal terms of the static state) and
    they stand still at V, whatever V is; the waves do at min w_n/n."""
    waves = np.repeat(np.arange(1, 5), 2)
    frequency = {1: 0.0, 2: 90.0, 3: 200.0, 4: 350.0}
    for speed in (10.0, 40.0):
        squares = np.array([frequency[n] ** 2 if n > 1 else speed**2 for n in waves])
        zero = np.zeros((len(waves), len(waves)))
        convective = -np.diag(waves.astype(float) ** 2)
        free = Projection(
            squares=squares,
            momentum=zero[:3],
            gyroscopic=zero,
            convective=convective,
            body=zero,
            body_convective=convective,
        )
        assert critical_speed(free, "full") == pytest.approx(speed)
        assert critical_speed(free, "full", speed) == pytest.approx(45.0)


def test_states_come_in_one_order_and_phase():
    """The same pencil in coordinates of other order: the same eigenvalues in place, the same vectors."""
    drag, stiffness = matrices(random_tire(20), 20.0, (30.0, 0.0), "full")
    plain = rotating(drag, stiffness)
    assert (np.diff(plain.eigenvalue.imag) >= 0).all()
    mixed = np.random.default_rng(2).permutation(20)
    other = rotating(drag[np.ix_(mixed, mixed)], stiffness[np.ix_(mixed, mixed)])
    np.testing.assert_allclose(other.eigenvalue, plain.eigenvalue, rtol=1e-10)
    right, left = np.empty_like(plain.right), np.empty_like(plain.left)
    right[mixed], left[:, mixed] = other.right, other.left
    np.testing.assert_allclose(right, plain.right, atol=1e-9)
    np.testing.assert_allclose(left, plain.left, atol=1e-9 * np.abs(left).max())


def test_rigid_motions_drift_and_do_not_grow():
    """s^2 = 0 of a free wheel, computed among modes of up to 1250 1/s: +-1e-5 1/s, on two of its motions."""
    rigid = np.array([1.04e-5, -1.04e-5, 3e-6j, -3e-6j])
    assert not growing(np.concatenate([rigid, [88j, -88j, 1254j, -1254j]])).any()
    for rate in (0.01, 1e-3 + 88j, 1e-3 + 1254j):
        assert growing(np.array([rate, 88j, 1254j])).sum() == 1


def test_a_slow_state_between_drifting_ones_goes_with_them():
    """What a free wheel without damping has: s^2 = 0 within rounding, and between it and a slow state one more
    whose vector is fine. Another algorithm could not tell it from the zeros, and the run ended.
    """
    pairs = [[0, 5510.0], [1.6e-15, 0]], [[0, 5.4e-4], [-5.4e-4, 0]], [[0, 0.0157], [-0.0157, 0]]
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((8, 8)))[0]
    companion = turn @ linalg.block_diag(*pairs, [[0, 2400.0], [-2400.0, 0]]) @ turn.T
    values = linalg.eigvals(companion)
    values = values[values.imag >= 0]
    size = np.abs(values)
    good = (size > 1.0) | ((size > 3e-4) & (size < 1e-2))
    block, basis, good = _invariant(companion, values, good)
    assert block.shape == (6, 6) and good.sum() == 1
    np.testing.assert_allclose(companion @ basis, basis @ block, atol=1e-11 * 5510.0)
