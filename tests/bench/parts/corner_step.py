"""Part of `bench contact`: cost of a step with a moving wheel, against one with a held axle."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy.rough_road import Mesh, write_scene

MESH = Mesh(20, 8, 0.35)
AXLES = {
    "held": [],
    "corner": [
        "axle.kind=corner",
        "axle.body_mass=50",
        "axle.stiffness=[1e6,1e6,8e3,4e4,4e4,4e4]",
        "axle.damping=[100,100,600,5,5,5]",
        "axle.locked=[]",
    ],
}
SHORT, LONG, STEP = 0.1, 0.4, 1e-4  # s
TURNS = 5


def corner() -> Table:
    """Contact stages of two durations, alternately: their difference is that of the extra steps."""
    costs: dict[str, list[float]] = {name: [] for name in AXLES}
    with tempfile.TemporaryDirectory() as folder, console.quiet():
        points = {name: _run(Path(folder) / name, name, SHORT)[1] for name in AXLES}
        for _ in range(TURNS):
            for name, kept in costs.items():
                place = Path(folder) / name
                long, short = (_run(place, name, duration)[0] for duration in (LONG, SHORT))
                kept.append((long - short) / round((LONG - SHORT) / STEP))
    held = np.array(costs["held"])
    rows = [
        [name, points[name], 1e6 * float(np.median(kept)), _more(np.array(kept), held)]
        for name, kept in costs.items()
    ]
    columns = [("axle", ""), ("points", "-"), ("a step", "us"), ("more than held", "%")]
    notes = [
        f"The contact stage of a tire of 100 modes on a rough road, {round((LONG - SHORT) / STEP)} steps, files and checks "
        f"included, in processor seconds; medians of {TURNS} in turns. The wheel moves in all six directions, its body in height.",
    ]
    return Table("One step of a wheel that moves", columns, rows, notes)


def _more(cost: np.ndarray, held: np.ndarray) -> float:
    return 100 * float(np.median(cost / held) - 1)


def _run(folder: Path, name: str, duration: float) -> tuple[float, int]:
    """CPU seconds of a run of which all stages but the contact exist, and its number of points."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = load(
        write_scene(folder / "given.toml", MESH, duration=duration, step=STEP), AXLES[name]
    )
    began = time.process_time()
    run = run_scene(scene, folder, MPI.COMM_WORLD, until="contact", fresh=False, petsc_options=[])
    return time.process_time() - began, len(run.setup.patch.points)
