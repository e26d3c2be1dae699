"""Force on the axle from the momentum, of a mass on a spring and damper, in closed form."""

import numpy as np
import pytest

from tireroad.greens.axle import by_momentum
from tireroad.greens.response import couple
from tireroad.modal.basis import Projection
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
