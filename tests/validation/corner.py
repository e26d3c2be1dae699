"""A wheel on its corner against its limits, and modes against full finite elements in time."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import LOADED, Choice, Tires, compare, verdicts
from tireroad.tests.validation.rolling import ROADS

LIMIT_SCENE = """
[tire]
segments = 20
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
error_estimate = false
[modal]
count = 60
[rotation]
speed = 50.0
[contact]
points = "nodes"
youngs_modulus = 1e7
friction = 0.0
reach = 0.02
[road]
kind = "sine"
amplitude = 0.5e-3
wavelength = 0.2
[time]
duration = 0.04
step = 2e-4
[accuracy]
estimate = false
"""
CORNER = (
    LIMIT_SCENE
    + '[axle]\nkind = "corner"\nbody_mass = {body}\nstiffness = [0, 0, {spring}, 0, 0, 0]\n'
)
HELD = CORNER.format(body=300.0, spring=1e15).replace("body_mass = 300.0\n", "")

ABOUT = "a wheel on its corner: modes against full finite elements of the same mesh, standing and rolling"
SCENE = (
    LOADED
    + """
[damping]
mass = 100.0
[rotation]
speed = {speed}
[modal]
count = {modes}
[axle]
kind = "corner"
wheel_mass = 15.0
wheel_inertia = [0.4, 0.8, 0.4]
body_mass = 50.0
stiffness = [1e6, 1e6, 8e3, 4e4, 4e4, 4e4]
damping = [100.0, 100.0, 600.0, 5.0, 5.0, 5.0]
locked = []
[contact]
points = "nodes"
youngs_modulus = 1e7
friction = 0.0
[road]
{road}
[time]
duration = {duration}
step = 1e-4
"""
)
MOVED = 'kind = "flat"\nmotion = { kind = "sine", amplitude = 5e-4, frequency = 30.0 }'
CASES = {
    "standing, road moved by 0.5 mm at 30 Hz": (0.0, MOVED),
    "rolling, sine, 0.5 mm, 0.2 m long": (80.0, ROADS["sine, 0.5 mm, 0.2 m long"]),
    "rolling, cleat, 3 mm high, 20 mm long": (80.0, ROADS["cleat, 3 mm high, 20 mm long"]),
}
CHOICES = (
    Choice(40, "attachment", 1e-4),
    Choice(120, "static", 1e-4),
    Choice(120, "attachment", 1e-4),
    Choice(250, "attachment", 1e-4),
    Choice(500, "attachment", 5e-5),
)
STEPS = (1e-4, 5e-5)  # s, of the full finite elements
MESH = {"segments": 16, "elements_arc": 6, "duration": 0.1}
WITHIN = 0.01


def table() -> Table:
    """Targets and results."""
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        corner, told = _run(base, CORNER.format(body=300.0, spring=25e3))
        stiff, _ = _run(base, HELD)
        fixed, _ = _run(base, LIMIT_SCENE)
        free, _ = _run(base, LIMIT_SCENE + '[axle]\nkind = "free"\n')
    vary = np.ptp(fixed["axle_force"], axis=0).max()
    off = [v["value"] for k, v in told["greens"]["indicators"].items() if "blocked force" in k]
    rows = [
        ["springs of 1e15 N/m against a held axle, force on the axle in time", 1e-6,
         float(np.abs(stiff["axle_force"] - fixed["axle_force"]).max() / vary)],
        ["force on the hub against that by the blocked force, over frequency", 0.01, float(off[0])],
        ["force on a free wheel less its load, of the load", 1e-6,
         float(np.abs(free["axle_force"][:, 2] - 500.0).max() / 500.0)],
        ["mean load over the time of the run: held axle, of its static load less 1", "none",
         float(fixed["total_force"][:, 2].mean() / 500.0 - 1)],
        ["the same, on the corner", "none",
         float(corner["total_force"][:, 2].mean() / 500.0 - 1)],
    ]  # fmt: skip
    columns = [("limit", ""), ("target", "-"), ("found", "-")]
    notes = ["Soft torus of 20 x 6 elements, 60 modes, 50 rad/s over waves of 0.5 mm, 0.04 s."]
    return Table("Wheel on its corner: limits", columns, rows, notes)


def _run(base: Path, text: str) -> tuple[dict[str, np.ndarray], dict]:
    """Forces in contact.h5 and the summary of a scene, in a folder whose stages are reused."""
    (base / "scene.toml").write_text(text)
    scene, out = load(base / "scene.toml"), base / "out"
    out.mkdir(exist_ok=True)
    with console.quiet():
        run_scene(scene, out, MPI.COMM_SELF, until="contact", fresh=False, petsc_options=[])
    with h5py.File(out / "contact.h5") as file:
        series = {name: file[name][:] for name in ("axle_force", "total_force")}
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return series, summary["stages"]


def run() -> list[Table]:
    """One table per case, and which choices are within 1 %."""
    tables, rows = [], []
    modes, runs = max(choice.modes for choice in CHOICES), {}
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, (speed, road)) in enumerate(CASES.items()):
            scene = SCENE.format(speed=speed, road=road, modes=modes, **MESH)
            if speed not in runs:
                (place := Path(folder) / str(number)).mkdir()
                runs[speed] = Tires(scene, place)
            tires = runs[speed]
            tires.change(scene)
            comparison = compare(tires, STEPS, CHOICES, ("contact force", "axle force"))
            tables.append(comparison.table(f"{name}: {tires.setting}"))
            rows.append(comparison.verdict(name, WITHIN, 1.0, tires.modes_seconds))
    asked = verdicts("Wheel on its corner: targets", rows, [])
    return [*tables, asked, table()]
