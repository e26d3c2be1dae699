"""The ring duct against closed forms, a fine difference scheme, and identities of the coupled problem."""

import numpy as np
import pytest
from scipy import linalg

from tireroad.fem import cavity
from tireroad.fem.cavity import Gas, inflated
from tireroad.modal.basis import Air
from tireroad.modal.rotating import checks, rotating

GAS = inflated(2.2e5, 293.15)
RADIUS, AREA = 0.2445, 0.0135


def profile(depth=0.0, count=24, at=0.0, width=0.5):
    """A ring of mean radius RADIUS whose section is smaller by `depth` around the angle `at`."""
    t = 4096
    angle = 2 * np.pi * np.arange(t) / t
    distance = (angle - at + np.pi) % (2 * np.pi) - np.pi
    area = AREA * (1 - depth * np.exp(-((distance / width) ** 2)))
    chi = cavity.waves(count, angle) * 2 * np.pi / t
    return cavity.DuctProfile(chi.T @ (area * RADIUS), chi.T @ area), angle, area


def states(own: cavity.Duct, speed: float):
    return rotating(*own.pencil(speed))


def test_gas_of_a_passenger_tire():
    """Closed forms: sound at 20 C, density at 2.2 bar over the atmosphere."""
    assert GAS.sound_speed == pytest.approx(343.2, abs=0.1)
    assert GAS.density == pytest.approx(321325 / (287 * 293.15))
    assert GAS.viscosity == pytest.approx(1.81e-5, rel=0.01)


@pytest.mark.parametrize("speed", [0.0, 80.0])
def test_rigid_annulus_has_its_closed_form_rolling_too(speed):
    """f_n = n c / (2 pi r) +- n Omega / (2 pi), to 1e-9 (0.1 % is asked)."""
    own = cavity.modes(profile()[0], GAS, 1000.0, 0.0)
    assert len(own.circular) == 8
    found = np.sort(states(own, speed).eigenvalue.imag)
    n = np.arange(1, 5)
    still = n * GAS.sound_speed / RADIUS
    expected = np.sort(np.concatenate([still - n * speed, still + n * speed]))
    assert found == pytest.approx(expected, rel=1e-9)
    assert own.circular[0] / (2 * np.pi) == pytest.approx(223.4, abs=0.1)


def test_a_wave_that_runs_with_the_wheel_carries_the_momentum_of_moving_air():
    """(1 + M) rho0 A v of a wave v whose density and Coriolis terms come with the flow: closed form."""
    speed, own = 80.0, cavity.modes(profile()[0], GAS, 300.0, 0.0)
    drag, stiffness = own.pencil(speed)
    values, vectors = linalg.eig(np.block([[0 * drag, np.eye(2)], [-stiffness, -drag]]))
    fast = np.argmax(values.imag)
    g = vectors[:2, fast]
    # v = D xi is all of the speed: the rate as the air itself feels it.
    velocity = values[fast] * g + speed * own.gyroscopic @ g
    mach = speed * RADIUS / GAS.sound_speed
    carried, plain = own.momentum @ (values[fast] * g), own.momentum @ velocity
    assert np.linalg.norm(carried) == pytest.approx((1 + mach) * np.linalg.norm(plain), rel=1e-9)
    # It runs as the wheel does, towards smaller angles: int e^(i theta) (cos, sin) gives x and z.
    assert carried[2] / carried[0] == pytest.approx(1j, rel=1e-6)


def differences(area: np.ndarray) -> np.ndarray:
    """Frequencies (rad/s) of the duct by differences on its stations: another method."""
    t = len(area)
    step = 2 * np.pi * RADIUS / t
    between = (area + np.roll(area, -1)) / 2
    matrix = np.diag(between + np.roll(between, 1))
    matrix -= np.diag(between[:-1], 1) + np.diag(between[:-1], -1)
    matrix[0, -1] = matrix[-1, 0] = -between[-1]
    values = linalg.eigh(matrix / step**2, np.diag(area), eigvals_only=True, subset_by_index=[1, 6])
    return GAS.sound_speed * np.sqrt(values)


@pytest.mark.slow
def test_narrowed_duct_against_differences_and_first_order_split():
    """Six frequencies to 1e-4 of 2,000 differences; the n = 1 pair splits by the share eps of
    its second harmonic in the section, as first-order perturbation says."""
    given, _, _ = profile(depth=0.3)
    angle = 2 * np.pi * np.arange(2000) / 2000
    area = given.at(angle)[1]
    own = cavity.modes(given, GAS, 800.0, 0.0)
    assert own.circular[:6] == pytest.approx(differences(area), rel=1e-4)
    small = cavity.modes(profile(depth=0.03)[0], GAS, 300.0, 0.0)
    shrunk = profile(depth=0.03)[0].area
    second = 2 * shrunk[3] / shrunk[0]
    split = np.diff(small.circular)[0] / small.circular.mean()
    assert split == pytest.approx(abs(second), rel=0.02)


def test_pressure_on_the_enclosure_is_the_rate_of_momentum_of_the_air():
    """Standing: -rho0 int A v t ds and the closed surface's pressure integral have one set of numbers;
    a round duct's first pair carries rho0 V times the mean of its velocity, higher ones nothing."""
    own = cavity.modes(profile()[0], GAS, 1000.0, 0.0)
    air_mass = GAS.density * 2 * np.pi * RADIUS * AREA
    assert np.linalg.norm(own.momentum[:, :2]) ** 2 == pytest.approx(air_mass, rel=1e-9)
    assert np.abs(own.momentum[:, 2:]).max() < 1e-9 * np.sqrt(air_mass)
    assert np.abs(own.momentum[1]).max() == 0.0


@pytest.mark.parametrize("n", [2, 3, 8])
def test_waves_far_above_the_band_add_their_mass_to_the_wall(n):
    """Area q cos(n theta) of the wall: pi r rho0 c^2 s^2 / (A (w_n^2 + s^2)), by the wave equation.

    Cut at the tire's highest mode, the air gave these motions no mass.
    """
    own = cavity.modes(profile()[0], GAS, None, 0.0)
    assert len(own.circular) == 2 * cavity.WAVES
    flux = np.zeros((49, 1))
    flux[2 * n - 1] = np.pi * RADIUS
    e, s = own.coupling(flux), 2j * np.pi * 80.0
    found = (e.T @ own.dynamic_stiffness(s, 0.0) @ e).item()
    bulk, circular = GAS.density * GAS.sound_speed**2, n * GAS.sound_speed / RADIUS
    expected = np.pi * RADIUS * bulk / AREA * s**2 / (circular**2 + s**2)
    assert found == pytest.approx(expected, rel=1e-9)


def coupled(depth=0.2, m=6, seed=4):
    """A tire of m modes in the narrowed duct, its flux of the size of a passenger tire's."""
    rng = np.random.default_rng(seed)
    own = cavity.modes(profile(depth)[0], GAS, 1000.0, 0.0)
    flux = rng.normal(size=(49, m)) * 0.02 / (1 + np.arange(49))[:, None]
    skew = rng.normal(size=(m, m))
    squares = (2 * np.pi * np.linspace(60, 300, m)) ** 2
    return Air(own, own.coupling(flux)), own, flux, np.diag(squares), skew - skew.T


def test_standing_coupled_problem_is_symmetric_and_positive():
    found, _, _, stiffness, _ = coupled()
    drag, whole = found.with_tire(np.zeros((6, 6)), stiffness, 0.0)
    assert np.array_equal(whole, whole.T)
    assert not drag.any()
    assert np.linalg.eigvalsh(whole).min() > 0


def test_potential_form_with_gyroscopic_coupling_has_the_same_frequencies():
    """The published form, potentials coupled through the damping matrix, as another method."""
    found, own, flux, stiffness, _ = coupled()
    _, whole = found.with_tire(np.zeros((6, 6)), stiffness, 0.0)
    e = own.coupling(flux)
    size = 6 + found.count
    gyroscopic = np.zeros((size, size))
    gyroscopic[:6, 6:], gyroscopic[6:, :6] = e[1:].T, -e[1:]
    plain = linalg.block_diag(stiffness + np.outer(e[0], e[0]), np.diag(own.circular**2))
    companion = np.block([[np.zeros((size, size)), np.eye(size)], [-plain, -gyroscopic]])
    values = np.linalg.eigvals(companion)
    assert np.sort(values.imag[values.imag > 0]) == pytest.approx(
        np.sqrt(np.linalg.eigvalsh(whole)), rel=1e-9
    )


def test_uniform_compression_has_the_adiabatic_stiffness():
    """gamma p / V (dV)^2 at rest, whatever the duct's other modes do: exact."""
    found, own, flux, stiffness, _ = coupled()
    _, whole = found.with_tire(np.zeros((6, 6)), stiffness, 0.0)
    condensed = whole[:6, :6] - whole[:6, 6:] @ np.linalg.solve(whole[6:, 6:], whole[6:, :6])
    adiabatic = 1.4 * GAS.pressure / own.volume * np.outer(flux[0], flux[0])
    assert condensed - stiffness == pytest.approx(adiabatic, rel=1e-9, abs=1e-9 * adiabatic.max())
    w = own.dynamic_stiffness(0.0, 0.0)
    assert found.coupling.T @ w @ found.coupling == pytest.approx(adiabatic, rel=1e-9, abs=1e-6)


def test_energy_is_kept_standing_and_only_the_turning_wheel_feeds_it():
    """Undamped: every state on the axis, standing and rolling; identities of the decoupled states."""
    found, _, _, stiffness, skew = coupled()
    for speed in (0.0, 60.0):
        pencil = found.with_tire(2 * speed * skew, stiffness, speed)
        modes = rotating(*pencil)
        assert np.abs(modes.eigenvalue.real).max() < 1e-9 * np.abs(modes.eigenvalue).max()
        checks(modes, *pencil)


def test_one_mode_and_the_air_veer_as_two_oscillators_do():
    """A mode of the tire near the air's first pair: 2 x 2 closed form of two coupled oscillators."""
    own = cavity.modes(profile()[0], GAS, 300.0, 0.0)
    flux = np.zeros((49, 1))
    flux[1] = 0.01  # a cos theta
    found = Air(own, own.coupling(flux))
    square = np.array([[own.circular[0] ** 2 * 1.02]])
    _, whole = found.with_tire(np.zeros((1, 1)), square, 0.0)
    e, w = np.linalg.norm(found.coupling[1:]), own.circular[0]
    two = np.array([[square[0, 0] + e**2, -e * w], [-e * w, w**2]])
    expected = np.sort(np.append(np.linalg.eigvalsh(two), w**2))
    assert np.linalg.eigvalsh(whole) == pytest.approx(expected, rel=1e-9)
    assert e / w == pytest.approx(GAS.density * 0.01 / w * own.pressure[1:].max(), rel=1e-9)


def test_losses_turn_with_the_wheel_and_walls_take_what_kirchhoff_says():
    """A loss of the body rate shifts the states by n Omega and damps each alike at any speed."""
    own = cavity.modes(profile()[0], GAS, 1000.0, 0.02)
    rest, turning = (states(own, speed) for speed in (0.0, 60.0))
    assert np.sort(rest.eigenvalue.real) == pytest.approx(
        np.sort(turning.eigenvalue.real), rel=1e-8
    )
    damped = -2 * rest.eigenvalue.real / np.abs(rest.eigenvalue)
    assert damped == pytest.approx(0.02, rel=1e-9)
    walls = Gas(101325.0, 293.15).wall_loss(0.01, np.array([2 * np.pi * 1000.0]))
    # Textbook tubes of air at 20 C: 3.0e-5 sqrt(f) / radius in 1/m, SI units; the rate is 2 alpha c.
    assert walls[0] == pytest.approx(2 * 3.0e-5 * np.sqrt(1000) / 0.01 * 343.2, rel=0.05)
