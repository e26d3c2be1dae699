"""Force on the axle from the momentum, of a mass on a spring and damper, in closed form."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.wheel import Turning
from tireroad.greens.basis import Basis
from tireroad.greens.coupling import with_left_out
from tireroad.greens.outputs import by_momentum
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import couple
from tireroad.modal.basis import Projection
from tireroad.modal.rolling import decouple
from tireroad.modal.rotating import standing

MASS, STIFFNESS, DAMPING = 2.0, 800.0, 3.0  # kg, N/m, N s/m


def test_transmissibility_of_an_oscillator() -> None:
    """(k + i omega c) / (k - omega^2 m + i omega c): what spring and damper pass on."""
    frequency = np.linspace(0.5, 12.0, 24)
    shape = np.ones((1, 1)) / np.sqrt(MASS)  # mass-normalised
    projection = Projection(squares=np.array([STIFFNESS / MASS]), momentum=np.zeros((3, 1)))
    states = standing(projection, (DAMPING / MASS, 0.0))
    carried = np.array([[0.0], [0.0], [np.sqrt(MASS)]])  # int rho u per unit coordinate
    response = couple(states, shape, shape, carried)
    found = by_momentum(response, np.array([[0.0], [0.0], [1.0]]), frequency)
    omega = 2 * np.pi * frequency
    passed = STIFFNESS + 1j * omega * DAMPING
    assert found[:, 2, 0] == pytest.approx(passed / (passed - omega**2 * MASS), rel=1e-12)
    assert not found[:, :2].any()


def test_what_no_state_has_follows_statically() -> None:
    """A second oscillator far above the band, known by its static moment alone."""
    from dataclasses import replace

    frequency = np.array([1.0, 2.0])
    one = np.ones((1, 1))
    nothing = replace(
        couple(
            standing(Projection(squares=np.ones(1), momentum=np.zeros((3, 1))), (0.1, 0.0)),
            0 * one,
            0 * one,
            np.zeros((3, 1)),
        ),
        left_out=np.array([[0.0], [0.0], [MASS / 4e6]]),  # m / k of a stiff spring
    )
    found = by_momentum(nothing, np.array([[0.0], [0.0], [1.0]]), frequency)[:, 2, 0]
    omega = 2 * np.pi * frequency
    assert found == pytest.approx(4e6 / (4e6 - omega**2 * MASS), rel=1e-8)


SPEED, DRAG = 12.0, 15.0  # rad/s, below the 20 where inner damping drives a mass round; N s/m
LOADS = np.eye(3)[[0, 2]]  # a force along x and one along z
SWEPT = SPEED * np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # Omega e_y x


def turning_mass(inertia: str) -> Basis:
    """A mass on an isotropic spring, free along x and z, in a wheel of this inertia of rotation."""
    body = -np.array([[0.0, 1.0], [-1.0, 0.0]])  # of the body rate s - Omega e_y x
    projection = Projection(
        squares=np.full(2, STIFFNESS / MASS),
        momentum=np.sqrt(MASS) * LOADS.T,
        gyroscopic=np.zeros((2, 2)),
        convective=np.zeros((2, 2)),
        body=body,
        body_convective=body @ body,
    )
    turning = Turning(speed=SPEED, damping=(DRAG / MASS, 0.0), inertia=inertia)
    states = decouple(projection, turning, MPI.COMM_SELF)
    return Basis(shape=LOADS.T / np.sqrt(MASS), projection=projection, states=states).at(turning)


def passed_on(frequency: np.ndarray, inertia: str) -> np.ndarray:
    """What spring and damper pass on (f, 3, 2); the damper acts on the body rate."""
    out = []
    for s in 2j * np.pi * frequency:
        body = s * np.eye(3) - SWEPT
        inner = STIFFNESS * np.eye(3) + DRAG * body
        mass = MASS * (body @ body if inertia == "doppler" else s**2 * np.eye(3))
        out.append(inner @ np.linalg.solve(mass + inner, LOADS.T))
    return np.stack(out)


@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_transmissibility_of_a_mass_that_turns(inertia: str) -> None:
    """With the doppler inertia the force by s^2 of the momentum was not in balance along x and z."""
    frequency = np.linspace(0.5, 12.0, 24)
    probes = sparse.csr_matrix(LOADS)
    response = turning_mass(inertia).couple(probes, probes)
    assert len(response.momentum) == (3 if inertia == "full" else 9)
    found = by_momentum(response, LOADS.T, frequency)
    assert found == pytest.approx(passed_on(frequency, inertia), rel=1e-11, abs=1e-11)


@pytest.mark.parametrize("inertia", ["full", "doppler"])
@pytest.mark.parametrize("dynamic", [True, False])
def test_axle_force_in_time_of_a_mass_that_turns(inertia: str, dynamic: bool) -> None:
    """In steady state under a sine as the transmissibility; statically what follows a force as at 0 Hz."""
    probes = sparse.csr_matrix(LOADS)
    basis = turning_mass(inertia)
    response = basis.couple(probes, probes)
    response = with_left_out(response, response.static_moment())
    assert not response.left_out.any()
    frequency, step = 1.5 if dynamic else 0.0, 2e-3
    if not dynamic:
        response = response.keeping_where(lambda s: np.abs(s) < 0)
    tire = Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF)
    tire.start(np.array([0.3, 1.0]))
    phase = 2j * np.pi * frequency * step * np.arange(1, 4001 if dynamic else 3)
    found = []
    for force in np.cos(phase.imag)[:, None] * [0.3, 1.0]:
        tire.predict()
        tire.advance(force)
        found.append(LOADS.T @ force - tire.inertia_force())
    exact = np.exp(phase)[:, None] * (passed_on(np.array([frequency]), inertia)[0] @ [0.3, 1.0])
    assert np.abs(found - exact.real)[-150:].max() < 3e-4 * np.abs(exact).max()
