"""Chatter: the contact's fastest oscillation in steps, the scheme it asks for, points that open and close."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import Drive, roll
from tireroad.contact.model import step_solver
from tireroad.contact.results.chatter import (
    FEWEST,
    LIMIT,
    WINDOW,
    Alternation,
    Chatter,
    Chosen,
    _steps,
    choose,
    oscillation,
)
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.law import TREADS
from tireroad.greens.recursion import Recursion, alternating
from tireroad.tests.validation.cases import RollingStrip, oval_patch

PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
TREAD = SimpleNamespace(
    law=TREADS["half-space"](youngs_modulus=3.4e8, poisson_ratio=0.49), solver="active-set"
)
# Light, undamped and fast: at a step of 0.2 ms two thirds of its states are static, at 0.1 ms a seventh.
LIVELY = RollingStrip(mass=2.0, wave_speed=150.0, speed=20.0, damping=0.0)
DURATION = 0.024
STIFF = 1e8  # N/m, of a point's bristle


def test_alternating_forces_settle_at_what_is_said() -> None:
    response, step = RollingStrip(damping=3e3).response(PATCH.points, 4, 2), 1e-4
    tire, force = (
        Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF),
        np.linspace(-1.0, 2.0, 63),
    )
    for n in range(600):
        free, sign = tire.predict(), (-1.0) ** n
        tire.advance(sign * force)
    settled = sign * (free + tire.same_step @ (sign * force))
    expected = alternating(response, step) @ force
    np.testing.assert_allclose(settled, expected, atol=1e-10 * np.abs(expected).max())


def test_a_mass_is_a_negative_spring() -> None:
    """-h^2/12 times its inverse mass: one state far slower than the step."""
    response = RollingStrip(lowest=1e-3, wave_speed=1e-3, damping=0.0).response(
        PATCH.points[:1], 0, 1
    )
    inverse = float((response.output * response.eigenvalue @ response.input).real[0, 0])
    assert alternating(response, 1e-4)[0, 0] == pytest.approx(-1e-8 / 12 * inverse, rel=1e-6)


@pytest.mark.parametrize(("theta", "steps"), [(np.pi, 2.0), (np.pi / 2, 4.0), (0.1, 62.83)])
def test_steps_of_an_oscillation(theta: float, steps: float) -> None:
    """cos theta = (1 - 4 mu)/(1 + 2 mu), whose mu -> theta^2/12 for small steps."""
    mu = (1 - np.cos(theta)) / (4 + 2 * np.cos(theta))
    assert _steps(mu) == pytest.approx(steps, rel=1e-3)
    assert _steps(0.1**2 / 12) == pytest.approx(62.83, rel=1e-2)
    assert _steps(1e-18) == pytest.approx(np.pi / np.sqrt(3e-18))
    assert _steps(1.3) == 2.0 and _steps(np.inf) == 2.0 and _steps(0.0) == np.inf


@pytest.mark.parametrize(
    ("scheme", "grows"), [("linear", True), ("damped", False), ("constant", False)]
)
def test_two_steps_an_oscillation_blow_up_where_forces_are_linear(scheme: str, grows: bool) -> None:
    """The same points held against a shaken road, a little beyond mu = 1 and well within it."""

    def largest(step: float, scheme: str) -> float:
        tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
        solver = ActiveSet(tire.same_step + TREAD.law.matrix(*_places()))
        drive = Drive(Flat().height, lambda t: 1e-7 * np.sin(900.0 * t), 0.0)
        return max(
            float(np.abs(i.change).max()) for i in roll(tire, solver, heavy, drive, step, 400)
        )

    def _places():
        return heavy.points[:, :2], heavy.half_sizes, 1.0

    heavy = oval_patch((5, 4), (0.015, 0.02), 1e5)
    response = RollingStrip(mass=0.02, damping=0.0).response(heavy.points, 3, 3)
    steps = np.array([oscillation(TREAD, heavy, response, h) for h in (1e-4, 1e-5)])
    assert steps[0] == 2.0 and steps[1] > FEWEST
    assert (largest(1e-4, scheme) > 1e3 * largest(1e-5, "linear")) == grows
    assert choose(steps[0]).scheme == "damped" and choose(steps[1]).scheme == "linear"


@pytest.mark.parametrize(
    ("scheme", "grows"), [("linear", True), ("damped", False), ("constant", False)]
)
def test_bristles_too_stiff_for_the_step_blow_up_where_forces_are_linear(scheme, grows) -> None:
    """Points that stick, their normal forces resolved: what horizontal forces do in two steps an oscillation is told."""

    def largest(step: float, scheme: str) -> float:
        tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
        p = len(heavy.points)
        solver = ActiveSet(
            tire.same_step[:p, :p] + TREAD.law.matrix(heavy.points[:, :2], heavy.half_sizes, 1.0)
        )
        brush = Brush(BrushLaw(STIFF), heavy.points[:, 0], heavy.line, 0.0, step)
        brush.begin(heavy.force > 0)
        friction = BrushFriction(brush, tire.same_step, None)
        drive = Drive(Flat().height, lambda t: 1e-7 * np.sin(900.0 * t), 0.0)
        run = roll(tire, solver, heavy, drive, step, 40, friction)
        return max(float(np.abs(i.horizontal).max()) for i in run)

    heavy, spec = (
        oval_patch((5, 4), (0.015, 0.02), 1e5),
        SimpleNamespace(**vars(TREAD), has_shear=False),
    )
    response = RollingStrip(mass=2.0, damping=0.0).horizontal_response(heavy.points, 3, 3, 1.0)
    steps = [oscillation(spec, heavy, response, h, STIFF) for h in (1e-4, 1e-5)]
    assert oscillation(spec, heavy, response, 1e-4) > FEWEST  # normal forces alone
    assert steps[0] == 2.0 and steps[1] > FEWEST
    assert (largest(1e-4, scheme) > 1e3 * largest(1e-5, "linear")) == grows


def _ridges(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 5e-4 * np.minimum(x / 0.1, 1.0) ** 3 * np.sin(2 * np.pi * x / 0.05 + 10 * y) * (x > 0.0)


def _low(response, step: float, scheme: str) -> np.ndarray:
    """The load's coefficients up to 300 Hz."""
    tire = Recursion(response=response.resolved(step), step=step, scheme=scheme, comm=MPI.COMM_SELF)
    steps, drive = round(DURATION / step), Drive(_ridges, lambda t: 0.0, 20.0)
    instants = roll(tire, step_solver(TREAD, PATCH, tire.same_step), PATCH, drive, step, steps)
    load = np.array([0.0, *(i.force.sum() - 500.0 for i in instants)])[:-1]
    window = np.sin(np.pi * np.arange(steps) / steps) ** 2
    return np.fft.rfft(window * load)[: int(300 * DURATION) + 1] / steps


def test_the_error_falls_with_the_step() -> None:
    """Forces linear over the step err by 3 %, 200 %, 12 %, 0.4 % as the step is halved: at the longest step
    most states are static, at the next they move undamped, in a contact that it cannot resolve. What is
    chosen errs by 3, 0.8, 1.0, 0.4, 0.4 %, and forces constant over the step by twice as much as damped ones.
    Asked: no growth but by the states that move from one step to the next.
    """
    response = LIVELY.response(PATCH.points, 24, 9, residual=6)
    sizes = 3.84e-4 / 2.0 ** np.arange(5)
    exact = _low(response, sizes[-1] / 2, "linear")

    def errors(schemes: list[str]) -> np.ndarray:
        found = [_low(response, h, s) for h, s in zip(sizes, schemes, strict=True)]
        return np.linalg.norm(np.array(found) - exact, axis=1) / np.linalg.norm(exact)

    steps = [oscillation(TREAD, PATCH, response.resolved(h), h) for h in sizes]
    chosen = [choose(count).scheme for count in steps]
    assert chosen == ["linear", "damped", "damped", "linear", "linear"]
    always = errors(["linear"] * len(sizes))
    assert always[1] > 20 * always[0]
    best = errors(chosen)
    assert (best[1:] < 1.5 * best[:-1]).all()
    assert best[0] < 0.04 and (best[1:3] < 0.012).all() and best[-1] < 5e-3
    assert (best[1:3] < 0.7 * errors(["constant"] * len(sizes))[1:3]).all()


def test_alternation_is_counted_window_by_window() -> None:
    steady = np.ones((WINDOW, 10))
    chattering = steady.copy()
    chattering[1::2, 0] = 0.0
    force = np.concatenate([steady, chattering, steady])
    found, parts = Alternation(), Alternation()
    found.add(force)
    for some in np.array_split(force, 7):
        parts.add(some)
        kept, parts = parts.state(), Alternation()
        parts.set_state(kept)
    # Of ten points one changes back in every step: half of the time it does not touch.
    assert found.worst == pytest.approx((WINDOW - 2) / (9.5 * WINDOW))
    assert parts.worst == found.worst
    with pytest.raises(Chatter, match="10 % of the points"):
        found.check(LIMIT)
    short = Alternation()
    short.add(chattering[: WINDOW // 4 - 1])
    short.finish()
    assert short.worst == 0.0  # says nothing yet
    short.add(chattering[: WINDOW // 4])
    short.finish()
    assert short.worst > LIMIT


def test_points_that_come_and_go_once_do_not_alternate() -> None:
    force = np.zeros((3 * WINDOW, 3))
    force[50:70, 0] = force[300:, 1] = force[:, 2] = 1.0
    found = Alternation()
    found.add(force)
    assert found.worst == 0.0
    found.check(LIMIT)


def test_damped_forces_stay_however_many_points_come_and_go() -> None:
    """On a rough road points open and close by what passes under them, which no other scheme changes."""
    linear = choose(3.17)
    assert (linear.scheme, linear.limit) == ("linear", LIMIT)
    damped = linear.next_scheme(Chatter(""))
    assert damped.scheme == "damped" and 1.0 < damped.limit < np.inf


def test_constant_forces_are_taken_where_the_motion_grows_with_damped_ones() -> None:
    """Whether these were the first choice or the second; with constant ones nothing is left to try."""
    grows = Chatter("grows without bound")
    for damped in (choose(2.0), choose(3.17).next_scheme(grows)):
        assert damped.scheme == "damped" and 1.0 < damped.limit < np.inf
        constant = damped.next_scheme(grows)
        assert (constant.scheme, constant.limit) == ("constant", np.inf)
        with pytest.raises(Chatter):
            constant.next_scheme(grows)
    with pytest.raises(Chatter):
        Chosen("damped", "as the scene says").next_scheme(grows)
