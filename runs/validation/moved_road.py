"""Modes against full finite elements in time: a standing tire on a flat road that moves (figures 6.4, 6.5)."""

from __future__ import annotations

import tempfile
from pathlib import Path

from runs.tabulate import Table
from runs.validation.comparison import Comparison, verdicts
from runs.validation.histories import follow
from runs.validation.tires import Choice, Tires

ABOUT = "a standing tire on a flat road that moves: modes against full finite elements"

SCENE = """
name = "validate"
[tire]
segments = {segments}
elements_arc = {elements_arc}
footprint_size = 0.35
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[damping]
mass = 500.0
[modal]
count = {modes}
[contact]
youngs_modulus = 1e7
[road]
kind = "flat"
motion = {{ kind = "sine", amplitude = {amplitude}, frequency = 50.0 }}
[time]
duration = 0.1
step = 1e-4
"""
AMPLITUDES = (1e-4, 2e-3)  # m: the thesis's, and one at which the contact changes
CHOICES = (
    Choice(50, "none", 1e-4),
    Choice(50, "static", 1e-4),
    Choice(50, "static", 2e-4),
    Choice(150, "none", 1e-4),
    Choice(150, "static", 1e-4),
    Choice(150, "attachment", 1e-4),
    Choice(400, "static", 1e-4),
)
STEPS = (2e-4, 1e-4)  # s, of the full finite elements
MESH = {"segments": 24, "elements_arc": 10}


def run() -> list[Table]:
    """Contact force, axle force, displacement of the contact points; run times."""
    tables, rows = [], []
    modes = max(choice.modes for choice in CHOICES)
    with tempfile.TemporaryDirectory() as folder:
        scenes = [SCENE.format(amplitude=a, modes=modes, **MESH) for a in AMPLITUDES]
        tires = Tires(scenes[0], Path(folder))
        for amplitude, scene in zip(AMPLITUDES, scenes, strict=True):
            tires.change(scene)
            found = _compare(tires)
            name = f"flat road moved by {1e3 * amplitude:g} mm at 50 Hz"
            title = f"Standing, {name}: {tires.unknowns} unknowns"
            tables.append(found.table(title))
            rows.append(found.verdict(name, 0.005, 1.0))
    return [*tables, verdicts("Moved flat road: what was asked for", rows, [])]


def _compare(tires: Tires) -> Comparison:
    session = tires.session
    full = [follow(session, *tires.full(step)) for step in STEPS]
    found = Comparison(full, ("contact force", "axle force", "displacement"))
    for choice in CHOICES:
        found.add(choice, follow(session, *tires.modal(choice)))
    return found
