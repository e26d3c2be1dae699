"""Modes against full finite elements in time: a point force of 1 N (thesis figures 6.3 and C.1)."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.runs.validation.full_elements import FullHistory
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Choice, Comparison, Tires, verdicts

ABOUT = "displacement under a point force, modes against full finite elements of the same mesh"
DURATION = 0.2  # s

SCENE = """
name = "validate"
[tire]
segments = {segments}
elements_arc = {elements_arc}
[tire.material]
youngs_modulus = 4.8e8
[static]
inflation = 0.0
[damping]
mass = {damping}
[modal]
count = {modes}
[[force]]
frequency = {frequency}
[time]
duration = 0.2
step = 1e-4
"""
CASES = {"figure 6.3": (5.0, 500.0), "figure C.1": (20.0, 50.0)}  # Hz, gamma1 in 1/s
CHOICES = [
    Choice(modes, residual, step)
    for modes, residual, step in (
        (10, "none", 1e-4),
        (10, "static", 1e-4),
        (100, "none", 1e-4),
        (100, "static", 1e-4),
        (100, "static", 2e-4),
        (300, "none", 1e-4),
        (300, "static", 1e-4),
    )
]
STEPS = (2e-4, 1e-4)  # s: steps of the full finite elements
RADIUS = 1.0  # nothing chatters without contact: average acceleration, the smallest error of all
MESH = {"segments": 24, "elements_arc": 10}


def run() -> list[Table]:
    """Errors of the driven point's displacement and of the axle force, and run times."""
    tables, rows = [], []
    modes = max(choice.modes for choice in CHOICES)
    for name, (frequency, damping) in CASES.items():
        with tempfile.TemporaryDirectory() as folder:
            scene = SCENE.format(frequency=frequency, damping=damping, modes=modes, **MESH)
            tires = Tires(scene, Path(folder))
            full = [_history(*tires.full(step, RADIUS), frequency) for step in STEPS]
            comparison = Comparison(full, ("displacement", "axle force"))
            for choice in CHOICES:
                comparison.add(choice, _history(*tires.modal(choice), frequency))
        what = f"Point force of 1 N at {frequency:g} Hz ({name})"
        tables.append(comparison.table(f"{what}: {tires.setting}"))
        rows.append(comparison.verdict(what, 0.005, 1.0, tires.modes_seconds))
    return [*tables, verdicts("Point force: targets", rows, [])]


def _history(tire, step: float, setup: float, frequency: float) -> FullHistory:
    """Displacement of the driven point (x, y, z) and axle force under the sine."""
    steps = round(DURATION / step)
    force = np.sin(2 * np.pi * frequency * step * np.arange(steps + 1))[:, None]
    moved, axle = np.zeros((2, steps, 3))
    tire.start(force[0])
    with threadpool_limits(1, "blas"):
        began = time.process_time()
        for k in range(steps):
            free = tire.predict()
            tire.advance(force[k + 1])
            moved[k] = free + tire.same_step @ force[k + 1]
            axle[k] = -tire.inertia_force()
            axle[k, 2] += force[k + 1, 0]
        seconds = time.process_time() - began
    return FullHistory(step, {"displacement": moved, "axle force": axle}, seconds, setup)
