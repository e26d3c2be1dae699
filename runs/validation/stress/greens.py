"""Green's functions at the limits, against the matrix exponential of the companion problem."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy import linalg

from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response, couple
from tireroad.modal.basis import Projection
from tireroad.modal.rotating import rotating, standing
from tireroad.modal.states import StateModes

SQUARES = np.array([50.0, 400.0, 2.6e4]) ** 2  # 1/s2
SHAPE = np.random.default_rng(3).normal(size=(3, 3))  # kg^-1/2
STEPS = (1e-7, 1e-5, 1e-3, 1e-2)  # s
FREE_STEPS = 200_000
DAMPING = {
    "gamma1 = 0": 0.0,
    "light damping": 5.0,
    "critical damping": 800.0,
    "critical damping but for 1e-14": 800.0 * (1 + 1e-14),
    "gamma1 = 1e5 1/s": 1e5,
}


def rows() -> list[list]:
    """(package, case, result, how it was caught)."""
    found = [_damped(name, value) for name, value in DAMPING.items()]
    found += [_defective(split) for split in (0.0, 1e-13, 1e-10, 1e-6)]
    found += [_long(), _limits()]
    return [["greens", *row] for row in found]


def _responses(damping: float) -> list[Response]:
    """Responses by the closed form and by the quadratic eigenproblem."""
    projection = Projection(squares=SQUARES, momentum=np.ones((3, 3)))
    both = standing(projection, (damping, 0.0)), rotating(damping * np.eye(3), np.diag(SQUARES))
    return [couple(modes, SHAPE, SHAPE, np.ones((3, 3))) for modes in both]


def _damped(name: str, damping: float) -> list:
    """Eight random forces at steps from 1e-7 to 1e-2 s, all schemes."""
    both = _responses(damping)
    force = np.random.default_rng(5).normal(size=(8, 3))
    worst = 0.0
    for step in STEPS:
        for scheme in ("linear", "damped", "constant"):
            exact = _exact(damping, force, step, scheme)
            for response in both:
                far = np.abs(_followed(response, force, step, scheme) - exact).max()
                worst = max(worst, far / np.abs(exact).max())
    block = max(len(response.block) for response in both)
    caught = f"{block} states without vectors as a block" if block else "needs no catching"
    return [f"{name}, steps 1e-7 to 1e-2 s", f"{worst:.0e} off the matrix exponential", caught]


def _followed(response: Response, force: np.ndarray, step: float, scheme: str) -> np.ndarray:
    tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
    tire.start(0 * force[0])
    out = np.zeros_like(force)
    for k, new in enumerate(force):
        out[k] = tire.predict() + tire.same_step @ new
        tire.advance(new)
    return out


def _exact(damping: float, force: np.ndarray, step: float, scheme: str) -> np.ndarray:
    """Displacements (n, 3) after each step, the force's course in the step as extra states."""
    wide = np.zeros((12, 12))
    wide[:3, 3:6], wide[3:6, :3], wide[3:6, 3:6] = (
        np.eye(3),
        -np.diag(SQUARES),
        -damping * np.eye(3),
    )
    wide[3:6, 6:9], wide[6:9, 9:] = SHAPE.T, np.eye(3)
    # Scaled by the fastest rate, so that the exponential does not lose digits.
    scale = np.repeat([1.0, 2.6e4, 1.0, 1 / step], 3)
    moved = linalg.expm(wide * step * scale / scale[:, None])
    moved = moved * scale[:, None] / scale
    state, old, before, out = np.zeros(6), np.zeros(3), np.zeros(3), np.zeros_like(force)
    for k, new in enumerate(force):
        held = (9 * new + 6 * old + before) / 16 if scheme == "damped" else new
        pieces = (old, (new - old) / step) if scheme == "linear" else (held, 0 * new)
        state = moved[:6] @ np.concatenate([state, *pieces])
        out[k], before, old = SHAPE @ state[:3], old, new
    return out


def _defective(split: float) -> list:
    """Two coupled modes at an exactly or nearly defective double root."""
    stiffness = np.array([[1e4, 50.0], [split * 50.0, 1e4]])
    drag, shape = 4.0 * np.eye(2), np.array([[1.0, 0.3], [0.2, 1.0]])
    modes: StateModes = rotating(drag, stiffness)
    companion = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -drag]])
    times = np.array([1e-3, 0.05, 0.4])
    exact = [shape @ linalg.expm(companion * t)[:2, 2:] @ shape.T for t in times]
    far = np.abs(couple(modes, shape, shape, np.ones((3, 2))).impulse(times) - exact).max()
    what = f"{far / np.abs(exact).max():.0e} off the matrix exponential"
    block = len(modes.block)
    caught = f"{block} states as a block" if block else f"basis condition {modes.condition:.0e}"
    return [f"near-defective: coupling back of {split:g}", what, caught]


def _long() -> list:
    """Many undamped steps: each mode must keep its amplitude."""
    tire = Recursion(response=_responses(0.0)[0], step=3e-4, scheme="linear", comm=MPI.COMM_SELF)
    tire.start(np.zeros(3))
    tire.predict()
    tire.advance(np.ones(3))
    tire.predict()
    tire.advance(np.zeros(3))
    before = np.abs(tire.state)
    nothing = np.zeros(3)
    for _ in range(FREE_STEPS):
        tire.predict()
        tire.advance(nothing)
    drift = float(np.abs(np.abs(tire.state) / before - 1).max())
    return [
        f"gamma1 = 0, {FREE_STEPS} free steps",
        f"amplitudes drift by {drift:.0e}",
        "needs no catching",
    ]


def _limits() -> list:
    """A state that turns 1e-12 to 1e4 radians per step, against its closed form."""
    worst = 0.0
    for turn in (1e-12, 1e-8, 1e-4, 1e4):
        one = np.ones((1, 1))
        modes = standing(Projection(squares=np.ones(1), momentum=np.ones((3, 1))), (0.0, 0.0))
        tire = Recursion(
            response=couple(modes, one, one, np.ones((3, 1))),
            step=turn,
            scheme="linear",
            comm=MPI.COMM_SELF,
        )
        # (x - sin x)/x for a force that grows linearly over the step; x^2/6 for small x.
        exact = turn**2 / 6 * (1 - turn**2 / 20) if turn < 1 else 1 - np.sin(turn) / turn
        worst = max(worst, abs(tire.same_step[0, 0] / exact - 1))
    return ["s dt from 1e-12 to 1e4", f"{worst:.0e} off the closed form", "series below 0.3"]
