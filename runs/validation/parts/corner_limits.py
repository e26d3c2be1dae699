"""A wheel on its corner against its limits: a held axle, the blocked force, a free wheel."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe
from tireroad.runs.scene.load import load
from tireroad.runs.stages.pipeline import run_scene

SCENE = """
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
    SCENE + '[axle]\nkind = "corner"\nbody_mass = {body}\nstiffness = [0, 0, {spring}, 0, 0, 0]\n'
)
HELD = CORNER.format(body=300.0, spring=1e15).replace("body_mass = 300.0\n", "")


def table() -> Table:
    """Targets and results."""
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder)
        corner, told = _run(base, CORNER.format(body=300.0, spring=25e3))
        stiff, _ = _run(base, HELD)
        fixed, _ = _run(base, SCENE)
        free, _ = _run(base, SCENE + '[axle]\nkind = "free"\n')
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
    with observe.quiet():
        run_scene(scene, out, MPI.COMM_SELF, until="contact", fresh=False, petsc_options=[])
    with h5py.File(out / "contact.h5") as file:
        kept = {name: file[name][:] for name in ("axle_force", "total_force")}
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    return kept, summary["stages"]
