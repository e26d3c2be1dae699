"""The oscillator of the thesis's appendix D: u'' + u' + u = f, put right in its second eigenvalue."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response, couple
from tireroad.modal.basis import Projection
from tireroad.modal.rotating import rotating, standing

ONE = np.ones((1, 1))


def oscillators() -> list[Response]:
    """By the uncoupled formula and by the second eigenproblem."""
    projection = Projection(squares=np.ones(1), momentum=np.ones((3, 1)))
    both = standing(projection, (1.0, 0.0)), rotating(ONE, ONE)
    return [couple(modes, ONE, ONE, np.ones((3, 1))) for modes in both]


@pytest.mark.parametrize("response", oscillators(), ids=["standing", "rotating"])
def test_greens_function_of_appendix_d(response) -> None:
    times = np.linspace(0, 20, 101)
    half = np.sqrt(3) / 2
    exact = np.exp(-times / 2) * np.sin(half * times) / half
    assert response.eigenvalue == pytest.approx([-0.5 + half * 1j], abs=1e-14)
    assert np.abs(response.impulse(times)[:, 0, 0] - exact).max() < 1e-14


@pytest.mark.parametrize("response", oscillators(), ids=["standing", "rotating"])
def test_step_response(response) -> None:
    """1 - e^{-t/2} (cos + sin / sqrt 3) under a constant force: exact for any step."""
    for step in (0.01, 0.7, 11.0):
        tire = Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF)
        tire.start(np.ones(1))
        half = np.sqrt(3) / 2
        for k in range(1, 6):
            found = tire.predict() + tire.same_step @ np.ones(1)
            tire.advance(np.ones(1))
            t = k * step
            turn = np.cos(half * t) + np.sin(half * t) / np.sqrt(3)
            assert found[0] == pytest.approx(1 - np.exp(-t / 2) * turn, abs=1e-13)


@pytest.mark.parametrize("response", oscillators(), ids=["standing", "rotating"])
def test_receptance(response) -> None:
    frequency = np.linspace(0, 2, 21)
    omega = 2 * np.pi * frequency
    exact = 1 / (1 - omega**2 + 1j * omega)
    assert np.abs(response.receptance(frequency)[:, 0, 0] - exact).max() < 1e-14
