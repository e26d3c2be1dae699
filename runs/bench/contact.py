"""What a step of the contact loop costs: against its floor, against convolution, with friction."""

from __future__ import annotations

import time

import numpy as np
from mpi4py import MPI

from contact.brush import Brush, BrushLaw
from contact.complementarity import ActiveSet
from contact.flat import Flat
from contact.friction import Friction
from contact.rolling import Drive, roll
from contact.synthetic import Strip, oval_patch
from contact.tread import half_space_compliance
from greens.convolution import Convolution
from greens.recursion import Recursion
from runs.bench.contact_points import median
from runs.tabulate import Table

ABOUT = (
    "cost of a contact step: memory floor, convolution, 100 x 100 points, friction, road at rest"
)
STEP = 1e-4
ELASTIC = 5e6, 0.45


def run() -> list[Table]:
    """The tables; ratios are of times measured in one run."""
    return [_step(), _convolution()]


def _parts(shape: tuple[int, int], modes: int, horizontal: bool = False):
    """Patch, tire with `modes` complex states, tread; 500 N on an oval of a tenth of a metre."""
    patch = oval_patch(shape, (0.15 / shape[0], 0.12 / shape[1]), 500.0)
    around = max(modes // 20, 2)
    strip = Strip(speed=20.0)
    if horizontal:
        response = strip.horizontal_response(patch.points, around // 2, 10, 1e2)
    else:
        response = strip.response(patch.points, around, 10)
    tire = Recursion(response, STEP, "linear", MPI.COMM_SELF)
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, *ELASTIC)
    return patch, tire, tread, response


def _wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * np.minimum(np.maximum(x, 0) / 0.3, 1.0) ** 3 * np.sin(80 * x + 10 * y)


def _loop(shape, modes: int, height, friction: bool = False, steps: int = 1000):
    """(seconds a step, factorisations, states, touching at most) of the loop alone."""
    patch, tire, tread, response = _parts(shape, modes, friction)
    count = len(patch.points)
    solver = ActiveSet(tire.same_step[:count, :count] + tread)
    coupling = None
    if friction:
        law = BrushLaw(2e4, 0.8, (0.02, 0.01))
        brush = Brush(law, patch.points[:, 0], patch.line, 20.0, STEP)
        brush.begin(patch.force > 0)
        coupling = Friction(brush, tire.same_step, None)
    drive = Drive(height, lambda t: 0.0, 20.0)
    instants = roll(tire, solver, patch, drive, STEP, steps, coupling)
    block, blocks, most = steps // 10, [], 0
    for _ in range(10):
        began = time.perf_counter()
        most = max(most, *(next(instants).active for _ in range(block)))
        blocks.append((time.perf_counter() - began) / block)
    return float(np.median(blocks)), solver.factorisations, len(response.eigenvalue), most


def _step() -> Table:
    flat, count, states, _ = _loop((25, 20), 500, Flat().height)
    rolling, turns, _, most = _loop((25, 20), 500, _wavy)
    matrices = np.ones((2, 500, 2 * states))
    vector = np.ones(2 * states)
    floor = median(lambda: (matrices[0] @ vector, matrices[1] @ vector), 50)
    plain = _loop((12, 9), 200, _wavy)[0]
    rubbing, _, _, _ = _loop((12, 9), 200, _wavy, friction=True, steps=200)
    rows = [
        ["flat road at rest", 500, states, flat * 1e6, flat / floor, count],
        ["wavy road", 500, states, rolling * 1e6, rolling / floor, turns],
        ["one pass over the matrices", 500, states, floor * 1e6, 1.0, 0],
        ["wavy road, 108 points", 108, 200, plain * 1e6, plain / rubbing, 0],
        ["the same with friction", 108, 200, rubbing * 1e6, 1.0, 0],
    ]
    columns = [("case", ""), ("points", "-"), ("states", "-"), ("time a step", "us"),
               ("ratio", "-"), ("factorisations", "-")]  # fmt: skip
    notes = [
        f"Ratio: to one pass (first three), to the step with friction (last two). At most {most} of "
        "500 points touched. Targets: 2 passes; 0.4; one factorisation at rest.",
    ]
    return Table("One step", columns, rows, notes)


def _convolution() -> Table:
    """Prescribed forces, the same in both; the convolution is timed at the end of 200 steps and at
    4,000 by its cost, which grows with their number.
    """
    shape, rows = (10, 6), []
    patch = oval_patch(shape, (0.015, 0.02), 500.0)
    strip = Strip(speed=20.0)
    response = strip.response(patch.points, 12, 5)
    duration = 0.02
    for steps in (200, 400, 800, 1600):
        h = duration / steps
        one = Recursion(response, h, "linear", MPI.COMM_SELF)
        other = Convolution(response, h, steps)
        times, worst, size = np.zeros(2), 0.0, 0.0
        for k in range(1, steps + 1):
            force = patch.force * np.sin(300 * k * h) ** 2
            moved = []
            for i, tire in enumerate((one, other)):
                began = time.perf_counter()
                u = tire.predict()
                tire.advance(force)
                times[i] += time.perf_counter() - began
                moved.append(u + tire.same_step @ force)
            worst = max(worst, np.abs(moved[0] - moved[1]).max())
            size = max(size, np.abs(moved[0]).max())
        rows.append([steps, times[0], times[1], times[1] / times[0], worst / size])
    rows.append(_many_steps(4000))
    columns = [("steps", "-"), ("recursion", "s"), ("convolution", "s"), ("ratio", "-"),
               ("difference", "-")]  # fmt: skip
    return Table(
        f"Recursion against direct convolution, {len(patch.points)} points, "
        f"{len(response.eigenvalue)} states, the same forces",
        columns,
        rows,
        [
            "The convolution's cost grows with the square of the steps, and its rectangle rule errs with "
            "the step. Target: 300 at 4,000 steps."
        ],  # fmt: skip
        {"x": "steps", "y": ["recursion", "convolution"], "log": "xy", "by": None},
    )


def _many_steps(steps: int) -> list:
    """500 points and 500 states: the recursion's steps, and steps/2 lags of the convolution each."""
    points, lags = 500, 20
    tire = _parts((25, 20), 490)[1]
    force = np.ones(points)

    def step():
        tire.predict()
        tire.advance(force)

    kernel, history = np.ones((lags, points, points)), np.ones((lags, points))
    lag = median(lambda: np.einsum("trk,tk->r", kernel, history, optimize=True), 9) / lags
    one, other = steps * median(step, 200), steps * steps / 2 * lag
    return [steps, one, other, other / one, "not kept"]
