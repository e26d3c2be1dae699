"""Part of `bench contact`: recursion against direct convolution, and orders in the time step."""

from __future__ import annotations

import time
from itertools import chain

import numpy as np
from mpi4py import MPI

from tireroad.contact.loop import Drive, LinearTire, roll
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.greens.recursion import Convolution, Recursion
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.contact_points import median
from tireroad.tests.validation.cases import RollingStrip, oval_patch

PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
DURATION = 0.01  # s
_SCHEMES = ("linear", "damped", "constant")


def orders() -> Table:
    """Forces of a shaken, rolling strip with residual flexibility by step size, all schemes."""
    response = RollingStrip(speed=20.0).response(PATCH.points, 5, 2, residual=6)
    exact = _forces(response, "linear", 6400)
    rows, before = [], None
    for steps in (100, 200, 400, 800):
        errors = [
            float(np.linalg.norm(_forces(response, scheme, steps) - exact) / np.linalg.norm(exact))
            for scheme in _SCHEMES
        ]
        slopes = [""] * 3 if before is None else list(np.log2(np.array(before) / errors).tolist())
        rows.append([steps, *_in_turn(errors, slopes)])
        before = errors
    shown = [(f"{name} force", "-") for name in _SCHEMES]
    beside = [("order" + " " * k, "-") for k in range(3)]  # columns of different names
    columns = [("steps", "-"), *_in_turn(shown, beside)]
    return Table(
        "Error of the contact forces over the time step, residual flexibility on", columns, rows,
        ["Against 6,400 steps of the second-order scheme, at 25 instants. Asked: orders 2, 2 and 1."],
        {"x": "steps", "y": [name for name, _ in shown], "log": "xy", "by": None},
    )  # fmt: skip


def _in_turn(one: list, other: list) -> list:
    """One of each list after the other."""
    return list(chain.from_iterable(zip(one, other, strict=True)))


def _forces(response, scheme: str, steps: int) -> np.ndarray:
    """Changes of the forces (25, c) N at common instants; the road moves by 0.8 mm at 60 Hz."""
    step = DURATION / steps
    tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
    tread = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
    drive = Drive(Flat().height, lambda t: 4e-4 * (1 - np.cos(2 * np.pi * 60.0 * t)), 20.0)
    instants = roll(tire, ActiveSet(tire.same_step + tread), PATCH, drive, step, steps)
    every = steps // 25
    return np.stack([i.force - PATCH.force for i in instants][every - 1 :: every])


def convolution() -> Table:
    """Recursion and convolution under the same prescribed forces.

    The convolution is timed in full up to 1,600 steps; at 4,000 steps its time is extrapolated from
    its cost per lag, which grows with the number of steps.
    """
    patch = oval_patch((10, 6), (0.015, 0.02), 500.0)
    response = RollingStrip(speed=20.0).response(patch.points, 12, 5)
    rows: list[list] = []
    before: list[float] = []
    for steps in (200, 400, 800, 1600):
        times, off, size = _both(response, patch.force, 0.02, steps, 200)
        # Romberg's table: the errors of both are in even powers of the step, because the force
        # begins smoothly.
        limits = [off]
        for order, coarse in enumerate(before, 1):
            limits.append(limits[-1] + (limits[-1] - coarse) / (4**order - 1))
        before = limits
        errors = [float(np.abs(limit).max() / size) for limit in (off, limits[-1])]
        rows.append([steps, *times, times[1] / times[0], *errors])
    rows.append(_many_steps(4000))
    columns = [("steps", "-"), ("recursion", "s"), ("convolution", "s"), ("ratio", "-"),
               ("difference", "-"), ("of the limits", "-")]  # fmt: skip
    return Table(
        f"Recursion against direct convolution, {len(patch.points)} points, "
        f"{len(response.eigenvalue)} states, the same forces",
        columns,
        rows,
        [
            "The convolution's cost grows with the square of the steps, and its rectangle rule errs with "
            "the step; of the limits: both extrapolated to step 0 from the rows so far. Asked: 1e-6 in "
            "the limit; a ratio of 300 at 4,000 steps of 500 points and 500 states."
        ],  # fmt: skip
        {"x": "steps", "y": ["recursion", "convolution"], "log": "xy", "by": None},
    )


def _both(response, shape: np.ndarray, duration: float, steps: int, shown: int):
    """Recursion and convolution under the same forces.

    Returns their seconds, the difference of their displacements at `shown` common times (shown, r)
    m, and the largest displacement, m.
    """
    h = duration / steps
    tires: tuple[LinearTire, ...] = (
        Recursion(response=response, step=h, scheme="linear", comm=MPI.COMM_SELF),
        Convolution(response=response, step=h, steps=steps),
    )
    times, off, size = [0.0, 0.0], [], 0.0
    for k in range(1, steps + 1):
        force, moved = shape * np.sin(300 * k * h) ** 2, []
        for i, tire in enumerate(tires):
            began = time.perf_counter()
            u = tire.predict()
            tire.advance(force)
            times[i] += time.perf_counter() - began
            moved.append(u + tire.same_step @ force)
        size = max(size, float(np.abs(moved[0]).max()))
        if k % (steps // shown) == 0:
            off.append(moved[0] - moved[1])
    return times, np.array(off), size


def _many_steps(steps: int) -> list:
    """500 points and 500 states: the recursion's steps; steps/2 lags of the convolution each."""
    points, lags = 500, 20
    patch = oval_patch((25, 20), (0.006, 0.006), 500.0)
    tire = Recursion(
        response=RollingStrip(speed=20.0).response(patch.points, 24, 10),
        step=1e-4,
        scheme="linear",
        comm=MPI.COMM_SELF,
    )
    force = np.ones(points)

    def step():
        tire.predict()
        tire.advance(force)

    kernel, history = np.ones((lags, points, points)), np.ones((lags, points))
    lag = median(lambda: np.einsum("trk,tk->r", kernel, history, optimize=True), 9) / lags
    one, other = steps * median(step, 200), steps * steps / 2 * lag
    return [steps, one, other, other / one, "", ""]
