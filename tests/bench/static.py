"""Time by part of a static state with 45,000 unknowns, on one process and on two."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.launched import launched

ABOUT = "a static state of 45,000 unknowns under load, rolling: time by part, memory, processes"
RUNS = ((0.0, 1), (0.0, 2), (50.0, 1), (50.0, 2))  # rad/s, processes
PARTS = ("factorisation", "assembly", "solve", "road", "other", "error estimate", "mesh and forms")
NOTE = (
    "Targets: less than 60 s on 2 processes, factorisation the largest part, less than 3 GB. A tangent "
    "of 27-node elements takes 0.3 ms each to compute and 0.1 ms to enter in the matrix; what is left to "
    "gain is in needing fewer: one serves while steps with it leave a fifth of the error, and the load "
    "is met along with equilibrium."
)
SCENE = """
name = "static"
[tire]
segments = 76
elements_arc = 16
footprint_size = 0.25
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[damping]
mass = 500.0
[rotation]
speed = {speed}
"""


def run() -> list[Table]:
    """At rest and rolling, by the program itself; forms are compiled before. Not collective."""
    runs = []
    with tempfile.TemporaryDirectory() as folder:
        for speed, count in RUNS:
            runs.append(_figures(Path(folder), speed, count))
            console.say(f"  {speed:g} rad/s, {count} process(es): {runs[-1][0]:.1f} s")
    names = ["all", *PARTS, "unknowns", "Newton steps", "memory, a process", "error of the load"]
    units = [*["s"] * (1 + len(PARTS)), "-", "-", "GB", "%"]
    columns = [(f"{speed:g} rad/s, {count} process(es)", "-") for speed, count in RUNS]
    by_part = zip(names, units, zip(*runs, strict=True), strict=True)
    figures = [[name, unit, *row] for name, unit, row in by_part]
    return [
        Table(
            "Static state: inflation, then 500 N",
            [("part", ""), ("unit", ""), *columns],
            figures,
            [NOTE],
        )
    ]


def _figures(folder: Path, speed: float, count: int) -> list:
    """One run of the static stage, after a small one that compiles the forms."""
    scene = folder / "static.toml"
    scene.write_text(SCENE.format(speed=speed), encoding="utf-8")
    small = ("--set", "tire.segments=12", "--set", "tire.elements_arc=6")
    launched(scene, folder / "small", "static", count, "--fresh", *small)
    stage = launched(scene, folder / f"{speed:g}-{count}", "static", count, "--fresh")["static"]
    figures, cost = stage["indicators"], stage["cost"]
    return [
        stage["seconds"],
        *(cost[part] for part in PARTS),
        stage["headline"]["unknowns"]["value"],
        figures["Newton steps"]["value"],
        figures["largest memory of a process so far"]["value"],
        figures["estimated error of the load"]["value"],
    ]
