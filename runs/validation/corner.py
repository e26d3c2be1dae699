"""Modes against full finite elements in time: the wheel as a rigid body on a corner."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation.comparison import compare, verdicts
from tireroad.runs.validation.parts import corner_limits
from tireroad.runs.validation.rolling import ROADS
from tireroad.runs.validation.tires import LOADED, Choice, Tires

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


def run() -> list[Table]:
    """One table per case, and which choices are within 1 %."""
    tables, rows = [], []
    modes, made = max(choice.modes for choice in CHOICES), {}
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, (speed, road)) in enumerate(CASES.items()):
            scene = SCENE.format(speed=speed, road=road, modes=modes, **MESH)
            if speed not in made:
                (place := Path(folder) / str(number)).mkdir()
                made[speed] = Tires(scene, place)
            tires = made[speed]
            tires.change(scene)
            found = compare(tires, STEPS, CHOICES, ("contact force", "axle force"))
            tables.append(found.table(f"{name}: {tires.setting}"))
            rows.append(found.verdict(name, WITHIN, 1.0, tires.modes_seconds))
    asked = verdicts("Wheel on its corner: targets", rows, [])
    return [*tables, asked, corner_limits.table()]
