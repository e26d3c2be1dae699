"""Modes against full finite elements in time: a tire with cords and lossy compounds, rough road."""

from __future__ import annotations

import tempfile
from pathlib import Path

from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Choice, Tires, compare, verdicts

ABOUT = "a belted tire of lossy rubber rolling, modes against full finite elements of the same mesh"

SCENE = """
name = "validate"
[tire]
segments = {segments}
elements_arc = {elements_arc}
footprint_size = 0.5
dynamic = 1.2
loss_factor = 0.15
[tire.material]
youngs_modulus = 6e6
[[tire.region]]
arc = [0.0, 45.0]
depth = [0.75, 1.0]
dynamic = 1.4
loss_factor = 0.25
material = {{ youngs_modulus = 8e6 }}
[[tire.cords]]
name = "ply"
depth = 0.009
arc = [-120.0, 120.0]
angle = 90.0
youngs_modulus = 9.87e9
area = 4.21e-7
spacing = 1e-3
[[tire.cords]]
name = "belt 1"
density = 7850.0
[[tire.cords]]
name = "belt 2"
depth = 0.003
angle = -20.0
density = 7850.0
[static]
load = 1000.0
error_estimate = false
[rotation]
speed = 80.0
[modal]
count = {modes}
[contact]
points = "nodes"
youngs_modulus = 1e7
friction = 0.0
[road]
{road}
[time]
duration = 0.06
step = 1e-4
"""
ROADS = {
    "sine, 0.5 mm, 0.2 m long": 'kind = "sine"\namplitude = 5e-4\nwavelength = 0.2',
    "cleat, 3 mm high, 20 mm long": (
        'kind = "cleat"\nheight = 3e-3\nlength = 0.02\nramp = 5e-3\nposition = 0.5'
    ),
}
STEPS = (2e-4, 1e-4, 5e-5)  # s, of the full finite elements
CHOICES = (
    Choice(100, "none", 1e-4),
    Choice(100, "static", 1e-4),
    Choice(100, "attachment", 1e-4),
    Choice(200, "static", 1e-4),
    Choice(200, "attachment", 1e-4),
    Choice(200, "attachment", 5e-5),
    Choice(400, "attachment", 5e-5),
    Choice(800, "attachment", 5e-5),
)
TARGETS = ((0.01, 30.0),)  # error, ratio of run times
MESH = {"segments": 20, "elements_arc": 10}
LARGE = {"segments": 50, "elements_arc": 16}


def run() -> list[Table]:
    """One table per road, and whether the target is reached."""
    return _run(MESH)


def run_large() -> list[Table]:
    """The same with as many elements along the arc as by default."""
    return _run(LARGE)


def _run(mesh: dict[str, int]) -> list[Table]:
    modes = max(choice.modes for choice in CHOICES)
    tables, rows = [], []
    with tempfile.TemporaryDirectory() as folder:
        scenes = {
            name: SCENE.format(road=road, modes=modes, **mesh) for name, road in ROADS.items()
        }
        tires = Tires(next(iter(scenes.values())), Path(folder))
        for name, scene in scenes.items():
            tires.change(scene)
            comparison = compare(tires, STEPS, CHOICES, ("contact force", "axle force"))
            points = len(tires.trial.setup.patch.points)
            tables.append(comparison.table(f"{name}: {points} contact points, {tires.setting}"))
            rows += [comparison.verdict(name, *target, tires.modes_seconds) for target in TARGETS]
    note = (
        "Damping by modal strain energy in both: the full finite elements damp each of these modes as the "
        "modal run does, and what lies beyond at the rate of the highest."
    )
    return [*tables, verdicts("A belted tire at 80 rad/s: targets", rows, [note])]
