"""Cost of a step of the contact loop: against its lower bound, convolution, and with friction."""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.loop import Drive, roll
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.contact_points import large, rough
from tireroad.tests.bench.parts.contact_steps import convolution, orders
from tireroad.tests.bench.parts.corner_step import corner
from tireroad.tests.bench.parts.shear_step import STEP, on_a_grid, parts_of, shearing, wavy

ABOUT = "the contact loop: cost of a step, friction, convolution, many points; targets and measured figures"
BLOCK = 20  # steps between two measurements of the lower bound


@threadpool_limits.wrap(limits=1, user_api="blas")
def run() -> list[Table]:
    """All tables; ratios are of times measured alternately in one run, with one BLAS thread."""
    tables = [_step(), _friction(), convolution(), orders(), large(), rough(), corner()]
    return [_asked(*tables), *tables, shearing()]


def _asked(step, friction, convolved, order, many, static, moving) -> Table:
    """Targets beside what the other tables measured."""
    limits = [row[-1] for row in convolved.rows if row[-1] != ""]
    rows = [
        ["a step, 500 points x 500 states, wavy road", "at most", 2.0, step.rows[1][4], "passes"],
        ["the same, matrices from memory", "at most", 2.0, step.rows[1][6], "passes"],
        ["factorisations after the first step, road at rest", "at most", 0.0,
         float(step.rows[0][7] - 1), ""],
        ["a step without friction over one with it", "at most", 0.4,
         max(row[-1] for row in friction.rows), ""],
        ["4,000 steps, faster than convolution", "at least", 300.0, convolved.rows[-1][3], "times"],
        ["difference from it in the limit of the step", "at most", 1e-6, limits[-1], ""],
        ["100 x 100 points, a step", "at most", 60.0, float(many.rows[-1][-1]), "ms"],
        ["a step of a wheel on its corner over one that is held", "at most", 10.0,
         moving.rows[-1][-1], "% more"],
        ["order, linear force", "at least", 1.9, order.rows[-1][2], ""],
        ["order, constant force", "at least", 0.9, order.rows[-1][4], ""],
    ]  # fmt: skip
    if len(static.rows) > 1:
        ratio = static.rows[0][1] / static.rows[1][1]
        rows.append(["128 x 128 points, time over tamaas's", "at most", 1.0, ratio, ""])
    for row in rows:
        row.append(row[3] <= row[2] if row[1] == "at most" else row[3] >= row[2])
    columns = [
        ("what", ""),
        ("", ""),
        ("target", ""),
        ("measured", ""),
        ("in", ""),
        ("reached", ""),
    ]
    return Table("The contact loop: targets and measured figures", columns, rows, static.notes)


def _loop(shape, modes: int, height, brush: float | None = None, steps: int = 1000):
    """(instants, solver, response) of the loop alone; with friction 0.8 and a brush in N/m."""
    patch, tire, tread, response = parts_of(shape, modes, brush is not None)
    count = len(patch.points)
    solver = ActiveSet(tire.same_step[:count, :count] + tread)
    coupling = None
    if brush is not None:
        law = BrushLaw(brush, 0.8, (0.02, 0.01))
        bristles = Brush(law, patch.points[:, 0], patch.line, 20.0, STEP)
        bristles.begin(patch.force > 0)
        coupling = BrushFriction(bristles, tire.same_step, None)
    drive = Drive(height, lambda t: 0.0, 20.0)
    return roll(tire, solver, patch, drive, STEP, steps, coupling), solver, response


def _beside(loop, *others, blocks: int = 40) -> tuple[float, list[float], list[float], int]:
    """Times of a loop and of `others`, run alternately in blocks.

    Median seconds of a step and of each of `others`, median ratios of a step to them, and the
    largest number of touching points.
    """
    steps, times, most = [], [], 0
    for _ in range(blocks):
        began = time.perf_counter()
        most = max(most, *(next(loop).active for _ in range(BLOCK)))
        steps.append((time.perf_counter() - began) / BLOCK)
        times.append([_mean(other) for other in others])
    ratios = np.median(np.array(steps)[:, None] / times, axis=0)
    return float(np.median(steps)), np.median(times, axis=0).tolist(), ratios.tolist(), most


def _mean(function) -> float:
    """Seconds per call, over as many calls as a block has steps, to share disturbances."""
    began = time.perf_counter()
    for _ in range(BLOCK):
        function()
    return (time.perf_counter() - began) / BLOCK


def _step() -> Table:
    rows, long = [], np.ones(4_000_000)
    for name, height in (("flat road at rest", Flat().height), ("wavy road", wavy)):
        loop, solver, response = _loop((25, 20), 500, height)
        states = len(response.eigenvalue)
        matrices, vector, force = np.ones((2, 500, 2 * states)), np.ones(2 * states), np.ones(500)
        step, floors, ratios, most = _beside(
            loop,
            lambda m=matrices, v=vector, f=force: (m[0] @ v, f @ m[1]),
            lambda: long @ long,
        )
        share = matrices.nbytes / long.nbytes  # bytes of a pass relative to those of the long sum
        rows.append([name, most, step * 1e6, floors[0] * 1e6, ratios[0], share * floors[1] * 1e6,
                     ratios[1] / share, solver.factorisations])  # fmt: skip
    columns = [("case", ""), ("touching", "-"), ("time a step", "us"), ("a pass", "us"),
               ("passes", "-"), ("a pass from memory", "us"), ("passes from memory", "-"),
               ("factorisations", "-")]  # fmt: skip
    notes = [
        f"500 points, {states} complex states, {BLOCK} steps and {BLOCK} passes in turns. A pass reads both "
        f"matrices once, states to points and points to states, 500 x {2 * states} doubles each "
        f"({matrices.nbytes / 1e6:.1f} MB), in two products; they stay in the cache if it is large "
        "enough. From memory: their bytes at the bandwidth of a sum of products of 32 MB.",
        "A step has to read the first matrix, and of the second, of the tire's answer within the step and "
        "of the compliance the columns of loaded points. Asked: 2 passes; one factorisation at rest.",
    ]
    return Table("One step", columns, rows, notes)


def _friction() -> Table:
    rows = []
    for shape, modes in (((12, 9), 200), ((25, 20), 500)):
        plain = _loop(shape, modes, wavy, steps=10**6)[0]
        for brush in (2e4, 2e5):
            rubbing, _, response = _loop(shape, modes, wavy, brush)
            step, (without,), (ratio,), most = _beside(
                rubbing, lambda loop=plain: next(loop), blocks=15
            )
            rows.append([shape[0] * shape[1], most, len(response.eigenvalue), brush, step * 1e3,
                         without * 1e3, 1 / ratio])  # fmt: skip
    fine, _ = on_a_grid(None)
    for brush in (3e3, 3e4):
        rubbing, _ = on_a_grid(brush)
        step, (without,), (ratio,), most = _beside(rubbing, lambda: next(fine), blocks=15)
        rows.append([45 * 33, most, 220, brush, step * 1e3, without * 1e3, 1 / ratio])
    columns = [("points", "-"), ("touching", "-"), ("states", "-"), ("brush", "N/m"),
               ("with friction", "ms"), ("frictionless", "ms"), ("ratio", "-")]  # fmt: skip
    notes = ["Friction 0.8 at a slip of 2 % and 1 %; the last two on a grid that 108 nodes carry. Asked: "
             "a step without at most 0.4 of one with."]  # fmt: skip
    return Table("One step with friction, wavy road", columns, rows, notes)
