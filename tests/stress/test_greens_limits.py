"""Green's functions at the edges: extreme steps, no damping, double and defective eigenvalues."""

import math

import numpy as np
import pytest
from mpi4py import MPI
from scipy import linalg

from tireroad.greens.recursion import Recursion, _phi
from tireroad.greens.response import couple
from tireroad.modal.basis import Projection
from tireroad.modal.rotating import rotating, standing


def phi_exact(x: complex) -> tuple[complex, complex]:
    """phi1 and phi2 by their series in exact fractions of doubled length, or far out, closed."""
    if abs(x) > 30:
        return (np.exp(x) - 1) / x, (np.exp(x) - 1 - x) / x**2
    small = linalg.expm(np.array([[x, 1, 0], [0, 0, 1], [0, 0, 0]]))
    return small[0, 1], small[0, 2]


@pytest.mark.parametrize("angle", [0.5, 0.6, 0.9, 1.0])
@pytest.mark.parametrize("size", [1e-300, 1e-12, 1e-5, 1e-2, 0.2999, 0.3001, 1.0, 8.0, 25.0, 1e3])
def test_phi_functions(size, angle) -> None:
    """Full precision from s dt -> 0 over the switch of formulas to s dt -> -infinity."""
    x = size * np.exp(1j * np.pi * angle)
    for found, exact in zip(_phi(np.array([x])), phi_exact(x), strict=True):
        assert abs(found[0] - exact) < 2e-14 * abs(exact)


def test_phi_at_zero_and_at_minus_infinity() -> None:
    first, second = _phi(np.array([0.0, -1e-320, -1e12], complex))
    assert first == pytest.approx([1, 1, 1e-12], rel=1e-15)
    assert second == pytest.approx([0.5, 0.5, 1e-12], rel=1e-11)
    assert math.isfinite(abs(first[1]))


def responses(squares: np.ndarray, damping: float, points: int = 3):
    """Standing modes by the closed formula and by the second eigenproblem."""
    rng = np.random.default_rng(3)
    m = len(squares)
    shape = rng.normal(size=(points, m))
    projection = Projection(squares=squares, momentum=np.ones((3, m)))
    modes = standing(projection, (damping, 0.0)), rotating(damping * np.eye(m), np.diag(squares))
    return shape, [couple(found, shape, shape, np.ones((3, m))) for found in modes]


SQUARES = np.array([50.0, 400.0, 2.6e4]) ** 2
DAMPING = {"none": 0.0, "light": 5.0, "critical": 800.0, "nearly": 800.0 * (1 + 1e-14), "over": 5e3}


@pytest.mark.parametrize("damping", DAMPING.values(), ids=DAMPING.keys())
@pytest.mark.parametrize("step", [1e-7, 1e-5, 1e-3, 1e-2])
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_any_step_and_any_damping(step, damping, scheme) -> None:
    shape, both = responses(SQUARES, damping)
    m, k = len(SQUARES), len(shape)
    companion = np.block([[np.zeros((m, m)), np.eye(m)], [-np.diag(SQUARES), -damping * np.eye(m)]])
    wide = np.zeros((2 * m + 2 * k, 2 * m + 2 * k))
    wide[: 2 * m, : 2 * m] = companion
    wide[m : 2 * m, 2 * m : 2 * m + k] = shape.T
    wide[2 * m : 2 * m + k, 2 * m + k :] = np.eye(k)
    # In units of the fastest rate the exponential does not lose what it is asked for.
    scale = np.diag(np.r_[np.ones(m), np.full(m, 2.6e4), np.ones(k), np.full(k, 1 / step)])
    moved = (scale @ linalg.expm(np.linalg.inv(scale) @ wide @ scale * step))[: 2 * m]
    moved = moved @ np.linalg.inv(scale)
    force = np.random.default_rng(5).normal(size=(8, k))
    for response in both:
        tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
        tire.start(0 * force[0])
        state, old, before, size = np.zeros(2 * m), 0 * force[0], 0 * force[0], 0.0
        for new in force:
            found = tire.predict() + tire.same_step @ new
            tire.advance(new)
            held = (9 * new + 6 * old + before) / 16 if scheme == "damped" else new
            push = (old, (new - old) / step) if scheme == "linear" else (held, 0 * new)
            state = moved @ np.concatenate([state, *push])
            before, old = old, new
            size = max(size, np.abs(state[:m]).max())
            assert np.abs(found - shape @ state[:m]).max() < 1e-9 * size


def test_double_eigenvalues_of_an_axisymmetric_tire() -> None:
    """Pairs cos and sin of one wave number, turning: repeated roots with full sets of vectors."""
    squares = np.repeat([200.0, 300.0, 300.0], 2) ** 2
    pair = np.array([[0, 1], [-1, 0]])
    gyroscopic = np.kron(np.diag([1.0, 2.0, 2.0]), pair)
    drag = 3.0 * np.eye(6) + 2 * 40.0 * gyroscopic
    rng = np.random.default_rng(0)
    shape = rng.normal(size=(4, 6))
    modes = rotating(drag, np.diag(squares))
    assert len(modes.block) == 0
    assert modes.condition < 1e3
    companion = np.block([[np.zeros((6, 6)), np.eye(6)], [-np.diag(squares), -drag]])
    times = np.array([1e-3, 0.03, 0.4])
    exact = [shape @ linalg.expm(companion * t)[:6, 6:] @ shape.T for t in times]
    g = couple(modes, shape, shape, np.ones((3, 6))).impulse(times)
    assert np.abs(g - exact).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.parametrize("split", [0.0, 1e-13, 1e-10, 1e-6])
def test_near_defective_eigenvalues_of_the_coupled_problem(split) -> None:
    """Two coupled modes at a root of multiplicity two with one vector only."""
    stiffness = np.array([[1e4, 50.0], [split * 50.0, 1e4]])
    drag = 4.0 * np.eye(2)
    shape = np.array([[1.0, 0.3], [0.2, 1.0]])
    modes = rotating(drag, stiffness)
    companion = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -drag]])
    response = couple(modes, shape, shape, np.ones((3, 2)))
    times = np.array([0.0, 1e-3, 0.05, 0.4])
    exact = [shape @ linalg.expm(companion * t)[:2, 2:] @ shape.T for t in times]
    assert np.abs(response.impulse(times) - exact).max() < 1e-9 * np.abs(exact).max()
    frequency = np.array([0.0, 15.0, 16.0])
    for omega, H in zip(2 * np.pi * frequency, response.receptance(frequency), strict=True):
        dynamic = stiffness + 1j * omega * drag - omega**2 * np.eye(2)
        direct = shape @ np.linalg.solve(dynamic, shape.T)
        assert np.abs(H - direct).max() < 1e-8 * np.abs(direct).max()


def test_the_block_takes_what_has_no_vectors() -> None:
    """The limit of the test above goes through the block form, not by luck through vectors."""
    modes = rotating(4.0 * np.eye(2), np.array([[1e4, 50.0], [0.0, 1e4]]))
    assert len(modes.block) == 4
    projection = Projection(squares=np.array([100.0**2]), momentum=np.ones((3, 1)))
    assert len(standing(projection, (200.0, 0.0)).block) == 2
