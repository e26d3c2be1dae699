"""Residual flexibility in contact: few modes with and without it against all, on a small tire."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from tireroad.runs.validation.full_elements import Choice, FullHistory, Tires, follow
from tireroad.runs.validation.tables import Table

ABOUT = "10 to 200 modes in contact, without and with residual, against all modes of a small tire"

SCENE = """
name = "contact-residual"
[tire]
segments = 24
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
deflection = 0.010
[damping]
mass = 5000.0
[modal]
count = 4751
[contact]
points = "nodes"
youngs_modulus = 3.4e8
reach = 0.013
[road]
kind = "flat"
[road.motion]
kind = "sine"
amplitude = 1e-3
frequency = 50.0
[time]
duration = 0.04
"""
STEP = 2e-5
OPTIONS = ("none", "static", "second-order", "attachment")
# Errors in % of an earlier trial on another mesh of the same size: without, with static residual.
TRIAL = {10: (198.0, 21.0), 50: (88.0, 5.0), 100: (63.0, 2.3), 200: (42.0, 0.9)}


def run() -> list[Table]:
    """One table with a row per number of modes."""
    with tempfile.TemporaryDirectory() as folder:
        tires = Tires(SCENE, Path(folder))
        every = len(tires.modes.frequency)
        exact = _moved(follow(tires.trial, *tires.modal(Choice(every, "static", STEP))))
        full = _moved(follow(tires.trial, *tires.full(STEP)))
        rows = [_row(tires, count, exact) for count in TRIAL]
    columns = [("modes", "-"), *((option, "%") for option in OPTIONS),
               ("none, trial", "%"), ("static, trial", "%")]  # fmt: skip
    points = len(tires.trial.setup.patch.points)
    notes = [
        f"Torus of 48 MPa, {tires.unknowns} unknowns, damping 5000 1/s, deflected by 10 mm, {points} contact "
        "points, the road moved 1 mm at 50 Hz for two periods. Error of the points' displacement: L2 "
        f"over points and time. All modes are {every} with the static part of the last one; states that "
        f"turn more than a radian in a step of {STEP * 1e6:g} us follow statically.",
        f"All modes against full finite elements in time: {_off(full, exact):.3g} %.",
    ]
    return [Table("Residual flexibility in contact, against all modes", columns, rows, notes)]


def _row(tires: Tires, count: int, exact: np.ndarray) -> list:
    found = [
        _off(_moved(follow(tires.trial, *tires.modal(Choice(count, option, STEP)))), exact)
        for option in OPTIONS
    ]
    return [count, *found, *TRIAL[count]]


def _moved(history: FullHistory) -> np.ndarray:
    return history.values["displacement"]


def _off(found: np.ndarray, exact: np.ndarray) -> float:
    """Relative L2 error, %."""
    return 100 * float(np.linalg.norm(found - exact) / np.linalg.norm(exact))
