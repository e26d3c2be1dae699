"""The recursion against the matrix exponential, and against the direct convolution."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy import linalg
from systems import make

from tireroad.fem.errors import InputError
from tireroad.greens.recursion import Convolution, Recursion, marched

STEPS = 60


def march(tire, force: np.ndarray) -> np.ndarray:
    """Displacement after each step for forces (steps + 1, k)."""
    tire.start(force[0])
    out = []
    for new in force[1:]:
        free = tire.predict()
        tire.advance(new)
        out.append(free + tire.same_step @ new)
    return np.stack(out)


def exact_march(system, force: np.ndarray, step: float, scheme: str) -> np.ndarray:
    """The companion system with the force held or linear: its exponential with the force's states.

    Damped forces are those held at (9 f_n + 6 f_{n-1} + f_{n-2}) / 16.
    """
    size, k = system.push.shape
    wide = np.zeros((size + 2 * k, size + 2 * k))
    wide[:size, :size] = system.companion
    wide[:size, size : size + k] = system.push
    wide[size : size + k, size + k :] = np.eye(k)
    moved = linalg.expm(wide * step)[:size]
    if scheme == "damped":
        before = np.concatenate([force[:1], force[:-1]])
        held = (9 * force[1:] + 6 * force[:-1] + before[:-1]) / 16
        force = np.concatenate([0 * force[:1], held])
    state, out = np.zeros(size), []
    for old, new in zip(force[:-1], force[1:], strict=True):
        begin, rate = (old, (new - old) / step) if scheme == "linear" else (new, 0 * new)
        state = moved @ np.concatenate([state, begin, rate])
        out.append(system.reading @ state)
    return np.stack(out)


def some_force(points: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(STEPS + 1, points))


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
@pytest.mark.parametrize("step", [1e-5, 1e-3, 5e-2])
def test_recursion_is_exact_for_its_kind_of_force(scheme, step) -> None:
    system = make(speed=60.0)
    force = some_force(4)
    if scheme == "constant":
        force[0] = 0
    exact = exact_march(system, force, step, scheme)
    found = march(
        Recursion(response=system.response(), step=step, scheme=scheme, comm=MPI.COMM_SELF), force
    )
    assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()


def test_residual_acts_at_once() -> None:
    system = make()
    whole = system.shape @ np.linalg.solve(system.stiffness, system.shape.T) + np.eye(4) * 1e-4
    force = some_force(4)
    plain = march(
        Recursion(response=system.response(), step=1e-3, scheme="linear", comm=MPI.COMM_SELF), force
    )
    with_residual = system.response(compliance=whole)
    found = march(
        Recursion(response=with_residual, step=1e-3, scheme="linear", comm=MPI.COMM_SELF), force
    )
    extra = force[1:] @ with_residual.residual.T
    assert np.abs(found - plain - extra).max() < 1e-13
    assert np.abs(extra).max() > 1e-5


def test_steady_force_ends_at_the_static_answer() -> None:
    system = make(damping=80.0)
    static = system.shape @ np.linalg.solve(system.stiffness, system.shape.T)
    force = np.tile([1.0, -2.0, 0.5, 3.0], (STEPS + 1, 1))
    found = march(
        Recursion(response=system.response(), step=0.02, scheme="linear", comm=MPI.COMM_SELF), force
    )[-1]
    assert np.abs(found - static @ force[0]).max() < 1e-9 * np.abs(found).max()


def test_orders_of_the_schemes() -> None:
    system = make()
    response = system.response()

    def end(step, scheme):
        times = step * np.arange(round(0.05 / step) + 1)
        force = np.sin(2 * np.pi * 42 * times)[:, None] * np.ones(4)
        return march(
            Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF), force
        )[-1]

    exact = end(0.05 / 6400, "linear")
    for scheme, order, cap in (("linear", 2, 2e-3), ("damped", 2, 6e-3), ("constant", 1, 0.1)):
        errors = [np.abs(end(0.05 / n, scheme) - exact).max() for n in (100, 200, 400)]
        slopes = np.log2(np.array(errors[:-1]) / errors[1:])
        assert slopes == pytest.approx(order, abs=0.1)
        assert errors[-1] < cap * np.abs(exact).max()


def test_convolution_comes_to_the_recursion_at_first_order() -> None:
    system = make()
    response = system.response(
        compliance=system.shape @ np.linalg.solve(system.stiffness, system.shape.T) + 1e-4
    )
    errors = []
    for n in (400, 800, 1600):
        step = 0.05 / n
        times = step * np.arange(n + 1)
        force = (1 + np.sin(2 * np.pi * 40 * times))[:, None] * np.ones(4)
        direct = march(Convolution(response=response, step=step, steps=n), force)
        found = march(
            Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF), force
        )
        errors.append(np.abs(direct - found).max() / np.abs(found).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(1, abs=0.15)
    assert errors[-1] < 2e-2


def test_inertia_force_is_the_rate_of_momentum() -> None:
    """Sum p eta'' of the recursion is the second difference of Sum p eta, as linear pieces have it."""
    system = make()
    m = len(system.drag)
    momentum = type(system)(system.drag, system.stiffness, np.vstack([system.shape, np.ones(m)]))
    step = 1e-5
    force = np.zeros((STEPS + 1, 5))
    force[:, :4] = np.linspace(0, 1, STEPS + 1)[:, None] ** 2
    tire = Recursion(response=momentum.response(), step=step, scheme="linear", comm=MPI.COMM_SELF)
    tire.start(force[0])
    carried, rates = [], []
    for new in force[1:]:
        carried.append((tire.predict() + tire.same_step @ new)[-1])
        tire.advance(new)
        rates.append(tire.inertia_force())
    rates, second = np.array(rates), np.diff(carried, 2)[:, None] / step**2
    mean = (rates[:-2] + 4 * rates[1:-1] + rates[2:]) / 6
    assert np.abs(mean - second).max() < 1e-5 * np.abs(second).max()


def test_the_axle_feels_fast_states_that_follow_statically() -> None:
    """The states that stay are no complete set: what they lack answers to the rate of the force."""
    whole = make(m=12, speed=60.0).response()
    lowest, fastest = np.sort(np.abs(whole.eigenvalue))[[0, -2]]
    response = whole.keeping_where(lambda s: np.abs(s) < fastest)
    step, steps = 2e-3, 2000  # 4 s: the free vibration, damped by 4 1/s, is over at the end
    phase = 0.1 * lowest * step * np.arange(steps + 1)
    last = slice(steps - round(2 * np.pi / (phase[1])), None)

    def rate(tire) -> np.ndarray:
        """The rate of momentum in the last period."""
        tire.start(np.zeros(4))
        found = []
        for new in np.sin(phase[1:])[:, None] * np.eye(4)[0]:
            tire.predict()
            tire.advance(new)
            found.append(tire.inertia_force())
        return np.array(found)[last]

    def recursion(of) -> Recursion:
        return Recursion(response=of, step=step, scheme="linear", comm=MPI.COMM_SELF)

    bare = replace(response, slope=None)
    exact, found, before = (rate(recursion(of)) for of in (whole, response, bare))
    off, was = (np.abs(one - exact).max() / np.abs(exact).max() for one in (found, before))
    assert off < 0.02 and was > 0.08
    convolved = [rate(Convolution(response=of, step=step, steps=steps)) for of in (response, bare)]
    assert convolved[0] - convolved[1] == pytest.approx(found - before, rel=1e-9, abs=1e-12)


def test_too_long_a_convolution_is_refused() -> None:
    with pytest.raises(InputError, match="needs no history"):
        Convolution(response=make().response(), step=1e-6, steps=10**8)


def test_dirac_residual_answers_with_a_pulse_of_one_step() -> None:
    """Thesis (C.4): G_res / step for one step is the mean force over it; in the end the same."""
    system = make(damping=80.0)
    whole = system.shape @ np.linalg.solve(system.stiffness, system.shape.T) + np.eye(4) * 1e-4
    at_once = system.response(compliance=whole)
    pulse = replace(at_once, pulse=len(at_once.residual))
    force = some_force(4)
    first, second = (
        march(Recursion(response=r, step=1e-3, scheme="linear", comm=MPI.COMM_SELF), force)
        for r in (at_once, pulse)
    )
    late = (force[:-1] - force[1:]) @ at_once.residual.T / 2
    assert np.abs(second - first - late).max() < 1e-13
    held = [
        march(Recursion(response=r, step=1e-3, scheme="constant", comm=MPI.COMM_SELF), force)
        for r in (at_once, pulse)
    ]
    assert np.array_equal(*held)


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
@pytest.mark.parametrize("pulse", [0, 4])
def test_known_forces_are_marched_through_by_blocks(scheme, pulse) -> None:
    """As from step to step: states, nearly defective ones, residual, and what answers a step late."""
    random, system = np.random.default_rng(5), make(m=7, speed=60.0)
    response = replace(
        system.response(compliance=np.eye(4) * 1e-3),
        block=np.array([[0.0, 1.0], [-1600.0, -80.0]]),
        block_output=random.normal(size=(4, 2)),
        block_input=random.normal(size=(2, 4)),
        block_momentum=random.normal(size=(3, 2)),
        slope=1e-6 * random.normal(size=(7, 4)),
        pulse=pulse,
    )
    force = some_force(4)
    tire = Recursion(response=response, step=1e-3, scheme=scheme, comm=MPI.COMM_SELF)
    blocks = np.split(force[1:], [1, 2, 7])
    found = np.vstack(list(marched(response, 1e-3, scheme, force[0], blocks)))
    expected = march(tire, force)
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
