"""The error of linearising about the static state, against rolling FE with large motions."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from tireroad.runs.validation.full_elements import follow
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Tires
from tireroad.tests.validation.rolling import SCENE

ABOUT = "rolling over bumps up to several static deflections: linear against nonlinear finite elements in time"

_SINE = 'kind = "sine"\nwavelength = 0.2\namplitude = {height:g}'
_CLEAT = 'kind = "cleat"\nlength = 0.02\nramp = 5e-3\nposition = 0.3\nheight = {height:g}'
ROADS = (
    ("sine, 0.2 m long", _SINE, 1e-4),
    ("sine, 0.2 m long", _SINE, 1e-3),
    ("cleat, 20 mm long", _CLEAT, 3e-3),
    ("cleat, 20 mm long", _CLEAT, 1e-2),
)
MESH = {"segments": 20, "elements_arc": 8}
STEP, DURATION = 1e-4, 0.04  # s


def run() -> list[Table]:
    """One table of all roads."""
    with tempfile.TemporaryDirectory() as folder:
        tires, rows = None, []
        for name, road, height in ROADS:
            scene = scene_of(road.format(height=height))
            if tires is None:
                tires = Tires(scene, Path(folder))
            tires.change(scene)
            rows.append([name, 1e3 * height, height / tires.run.static.deflection, *beside(tires)])
        setting = tires.setting if tires else ""
    columns = [("road", ""), ("height", "mm"), ("of the static deflection", "-"),
               ("vertical force off", "%"), ("longitudinal force off", "%"),
               ("largest vertical force, linear", "N"), ("nonlinear", "N"),
               ("largest longitudinal force, linear", "N"), ("nonlinear", "N"),
               ("iterations a step", "-"), ("times slower", "-")]  # fmt: skip
    notes = [
        f"{setting}; 100 rad/s, 500 N, {DURATION:g} s in steps of {STEP:g} s. Off: contact force of the linear elements, rms of "
        "the difference over the rms of what is beyond the static load; largest: of magnitude. Both take the same mesh, points, step and contact solver.",
    ]
    return [Table("Large motions of a rolling tire", columns, rows, notes)]


def scene_of(road: str, mesh: dict[str, int] | None = None, duration: float = DURATION) -> str:
    """The scene of `validate rolling` on this road, without friction: large motions begin at the static state."""
    scene = SCENE.format(road=road, modes=60, friction=0.0, **(mesh or MESH))
    return scene.replace("duration = 0.1", f"duration = {duration:g}")


def beside(tires: Tires) -> tuple[float, ...]:
    """Errors % of the vertical and longitudinal contact force, largest ones N linear and not of each,
    iterations per step, ratio of run times. Collective."""
    linear = follow(tires.trial, *tires.full(STEP))
    tire, *given = tires.nonlinear(STEP)
    history = follow(tires.trial, tire, *given)
    one, other = (h.values["contact force"] for h in (linear, history))
    rest = float(tires.run.static.normal_force.sum())
    off = [
        100 * float(np.linalg.norm(one[:, axis] - other[:, axis]) / np.linalg.norm(beyond))
        for axis, beyond in ((2, other[:, 2] - rest), (0, other[:, 0]))
    ]
    largest = (float(abs(h[:, axis]).max()) for axis in (2, 0) for h in (one, other))
    turns = tire.turns / len(one)
    return *off, *largest, turns, history.seconds / linear.seconds
