"""What a step of the contact loop costs: against its floor, against convolution, with friction."""

from __future__ import annotations

import time
from dataclasses import replace

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

ABOUT = "cost of a contact step: against its floor, with friction, against direct convolution"
STEP = 1e-4
ELASTIC = 5e6, 0.45
BLOCK = 20  # steps between two looks at the floor


def run() -> list[Table]:
    """The tables; ratios are of times measured in one run, in turns."""
    return [_step(), _friction(), _convolution()]


def _parts(shape: tuple[int, int], modes: int, horizontal: bool = False):
    """Patch, tire with `modes` complex states, tread; 500 N on an oval of a tenth of a metre."""
    patch = oval_patch(shape, (0.15 / shape[0], 0.12 / shape[1]), 500.0)
    around = max(modes // 20, 2)
    strip = Strip(speed=20.0)
    if horizontal:
        response = strip.horizontal_response(patch.points, around // 2, 10, 1e2)
        response = replace(response, residual=_local(patch.points))
    else:
        response = strip.response(patch.points, around, 10)
    tire = Recursion(response, STEP, "linear", MPI.COMM_SELF)
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, *ELASTIC)
    return patch, tire, tread, response


def _local(points: np.ndarray) -> np.ndarray:
    """What the modes left out give way to, m/N in z, x, y: smooth over 2 cm, as a wall's is."""
    away = ((points[:, None] - points[None]) ** 2).sum(axis=-1)
    return np.kron([[1.0, 0.1, 0.0], [0.1, 0.5, 0.0], [0.0, 0.0, 0.5]], 1e-6 * np.exp(-away / 4e-4))


def _wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * np.minimum(np.maximum(x, 0) / 0.3, 1.0) ** 3 * np.sin(80 * x + 10 * y)


def _loop(shape, modes: int, height, brush: float | None = None, steps: int = 1000):
    """(instants, solver, response) of the loop alone; with friction 0.8 at a brush stiffness in N/m."""
    patch, tire, tread, response = _parts(shape, modes, brush is not None)
    count = len(patch.points)
    solver = ActiveSet(tire.same_step[:count, :count] + tread)
    coupling = None
    if brush is not None:
        law = BrushLaw(brush, 0.8, (0.02, 0.01))
        bristles = Brush(law, patch.points[:, 0], patch.line, 20.0, STEP)
        bristles.begin(patch.force > 0)
        coupling = Friction(bristles, tire.same_step, None)
    drive = Drive(height, lambda t: 0.0, 20.0)
    return roll(tire, solver, patch, drive, STEP, steps, coupling), solver, response


def _beside(loop, other, blocks: int = 40) -> tuple[float, float, float, int]:
    """Median seconds of a step and of `other()`, the ratio's median over blocks run in turns, and the
    most points that touched."""
    steps, others, most = [], [], 0
    for _ in range(blocks):
        began = time.perf_counter()
        most = max(most, *(next(loop).active for _ in range(BLOCK)))
        between = time.perf_counter()
        for _ in range(BLOCK):
            other()
        steps.append((between - began) / BLOCK)
        others.append((time.perf_counter() - between) / BLOCK)
    ratio = np.median(np.array(steps) / others)
    return float(np.median(steps)), float(np.median(others)), float(ratio), most


def _step() -> Table:
    rows = []
    for name, height in (("flat road at rest", Flat().height), ("wavy road", _wavy)):
        loop, solver, response = _loop((25, 20), 500, height)
        states = len(response.eigenvalue)
        matrices, vector, force = np.ones((2, 500, 2 * states)), np.ones(2 * states), np.ones(500)
        step, floor, ratio, most = _beside(
            loop, lambda m=matrices, v=vector, f=force: (m[0] @ v, f @ m[1])
        )
        memory = matrices.nbytes / _bandwidth()
        rows.append([name, most, step * 1e6, floor * 1e6, ratio, memory * 1e6, step / memory,
                     solver.factorisations])  # fmt: skip
    columns = [("case", ""), ("touching", "-"), ("time a step", "us"), ("a pass", "us"),
               ("passes", "-"), ("a pass from memory", "us"), ("passes from memory", "-"),
               ("factorisations", "-")]  # fmt: skip
    notes = [
        f"500 points, {states} complex states, {BLOCK} steps and {BLOCK} passes in turns. A pass reads "
        f"both matrices once, states to points and points to states, 500 x {2 * states} doubles each "
        f"({matrices.nbytes / 1e6:.1f} MB), in two products; they stay in the cache if it is large "
        "enough. From memory: their bytes at the bandwidth of a long sum of products.",
        "A step has to read the first matrix, and of the second, of the tire's answer within the step and "
        "of the compliance the columns of loaded points. Asked: 2 passes; one factorisation at rest.",
    ]
    return Table("One step", columns, rows, notes)


def _bandwidth() -> float:
    """Bytes a second that one process reads from memory."""
    long = np.ones(10_000_000)
    return long.nbytes / median(lambda: long @ long, 9)


def _friction() -> Table:
    rows = []
    for shape, modes in (((12, 9), 200), ((25, 20), 500)):
        plain = _loop(shape, modes, _wavy, steps=10**6)[0]
        for brush in (2e4, 2e5):
            rubbing, _, response = _loop(shape, modes, _wavy, brush)
            step, without, ratio, most = _beside(rubbing, lambda loop=plain: next(loop), 8)
            rows.append([shape[0] * shape[1], most, len(response.eigenvalue), brush, step * 1e3,
                         without * 1e3, 1 / ratio])  # fmt: skip
    columns = [("points", "-"), ("touching", "-"), ("states", "-"), ("brush", "N/m"),
               ("with friction", "ms"), ("frictionless", "ms"), ("ratio", "-")]  # fmt: skip
    notes = [
        "Friction 0.8 at a slip of 2 % and 1 %. Asked: a step without at most 0.4 of one with."
    ]
    return Table("One step with friction, wavy road", columns, rows, notes)


def _convolution() -> Table:
    """Prescribed forces, the same in both; the convolution is timed at the end of 200 steps and at
    4,000 by its cost, which grows with their number.
    """
    patch = oval_patch((10, 6), (0.015, 0.02), 500.0)
    response = Strip(speed=20.0).response(patch.points, 12, 5)
    rows, before = [], []
    for steps in (200, 400, 800, 1600):
        times, off, size = _both(response, patch.force, 0.02, steps, 200)
        # Romberg's table: both err by even powers of the step, for the force begins smoothly.
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
    """Seconds of recursion and convolution, the difference of their displacements at `shown` common
    times (shown, r) m, and the largest displacement, m."""
    h = duration / steps
    tires = Recursion(response, h, "linear", MPI.COMM_SELF), Convolution(response, h, steps)
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
    return [steps, one, other, other / one, "", ""]
