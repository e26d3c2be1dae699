"""Savings from skipping, scene by scene: runs with and without what a scene does not need."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import SPEED, Mesh, Rolled, prepared, rolled

ABOUT = (
    "standing, frictionless, flat, symmetric, points out of reach, stages known: what each saves"
)

MESH = Mesh(24, 10, 0.35)
KEYS = {"modes": 200, "residual": "static", "duration": 0.2, "step": 1e-4}
FAR = 0.03  # m: reach of a patch that leaves out hardly any point
BRUSH = "contact.brush_stiffness=2e4", "contact.friction=0.8"
FLAT = "road.kind=flat", "road.rms=", "road.roll_off=", "road.cut_off="


def run() -> list[Table]:
    """One table; every ratio is of two measurements in this run."""
    with tempfile.TemporaryDirectory() as folder:
        return [table(Path(folder), MESH, KEYS)]


def table(folder: Path, mesh: Mesh, keys: dict) -> Table:
    """Rows: what is skipped, seconds with and without it, the ratio, the change of the result."""
    console.say("  rolling, standing, flat, with friction ...")
    keys = {"friction": 0.0} | keys
    rolling = rolled(folder / "rolling", mesh, **keys)
    again = rolled(folder / "rolling", mesh, "road.seed=1", **keys)
    standing = rolled(folder / "standing", mesh, **keys | {"speed": 0.0})
    flat = rolled(folder / "flat", mesh, *FLAT, **keys)
    rubbing = rolled(folder / "rubbing", mesh, *BRUSH, **keys)
    far = rolled(folder / "far", mesh, f"contact.reach={FAR}", **keys)
    # The road is eased in before the foremost point: the effect of that has decayed by then.
    late = slice(-len(rolling.forces["total_force"]) // 4, None)
    off = np.abs(far.forces["total_force"] - rolling.forces["total_force"])[late].max()
    points = [run.figure("greens", "contact points") for run in (far, rolling)]
    linear = "modes", "rotating", "greens"
    rows = [
        _row("rolling, when the wheel stands", "modes to Green's functions", rolling, standing, linear),
        _row("unevenness, when the road is flat", "time loop", rolling, flat),
        _row("horizontal forces, without friction", "Green's functions", rubbing, rolling, ("greens",)),
        _row("horizontal forces, without friction", "time loop", rubbing, rolling),
        _row(f"points out of reach ({points[0]} to {points[1]})", "Green's functions", far, rolling, ("greens",), float(off)),
        _row(f"points out of reach ({points[0]} to {points[1]})", "time loop", far, rolling, None, float(off)),
        _row("stages known from another road", "whole run", rolling, again, tuple(rolling.stages)),
        _mirrors(folder, mesh, keys),
    ]  # fmt: skip
    columns = [("what is skipped", ""), ("measured", ""), ("with it", "s"), ("without it", "s"),
               ("with / without", "-"), ("largest difference", "")]  # fmt: skip
    notes = [
        f"{mesh} elements, {keys['modes']} modes, {SPEED:g} rad/s, rough road without friction where not said, {keys['duration']:g} s in "
        f"steps of {keys['step']:g} s; both sides measured in one run.",
        "Largest difference: of the contact force in the last quarter of the time, or of the frequencies, where both sides "
        "compute the same thing; nothing where they do not.",
    ]
    plot = {"kind": "bars", "x": ["what is skipped", "measured"], "y": ["with / without"],
            "log": "x"}  # fmt: skip
    return Table("What skipping saves", columns, rows, notes, plot)


def _row(
    what, measured, whole: Rolled, less: Rolled, stages=None, off: float | None = None
) -> list:
    """`stages`: those whose seconds count; None: the time loop."""
    times = [run.loop if stages is None else _seconds(run, stages) for run in (whole, less)]
    difference = "" if off is None else f"{off:.2g} N"
    return [what, measured, *times, times[0] / times[1], difference]


def _seconds(run: Rolled, stages: tuple[str, ...]) -> float:
    """Seconds of the stages in this run; a reused one counts as 0."""
    return sum(
        run.stages[stage]["seconds"]
        for stage in stages
        if run.stages[stage]["status"] == "computed"
    )


def _mirrors(folder: Path, mesh: Mesh, keys: dict) -> list:
    """The modes of a symmetric tire with and without using its mirror plane."""
    from tireroad.modal.solver import undamped
    from tireroad.modal.standing import solved

    operators = prepared(folder / "rolling", mesh, **keys).run.motions.operators
    count = keys["modes"]
    times, found = [], []
    for work in (
        lambda: undamped.solve(operators.stiffness, operators.mass, count),
        lambda: solved(operators, count=count),
    ):
        began = time.perf_counter()
        found.append(work())
        times.append(time.perf_counter() - began)
    off = np.abs(found[1].frequency / found[0].frequency - 1).max()
    what = f"the other half of a symmetric tire ({', '.join(found[1].symmetries)})"
    return [what, "modes", *times, times[0] / times[1], f"{off:.1g} of a frequency"]
