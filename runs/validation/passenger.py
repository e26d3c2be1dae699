"""The built-in passenger tire on a rough road: third octaves of modes against full finite elements, air and cords included."""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from tireroad.contact.results.spectra import third_octaves
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.validation.comparison import digits
from tireroad.runs.validation.histories import History, follow
from tireroad.runs.validation.tires import Choice, Tires

ABOUT = "the passenger tire on a rough road, third octaves of modes against full finite elements"

SCENE = """
name = "validate"
[tire]
section = "radial"
size = "205/60 R15"
segments = {segments}
elements_arc = {elements_arc}
[static]
inflation = 2.2e5
load = 4000.0
error_estimate = false
[modal]
up_to = {highest}
[rotation]
speed = 71.9
[contact]
points = {{ dx = 0.005, dy = 0.005 }}
youngs_modulus = 1e7
[road]
kind = "two-slope"
longest_wave = 0.5
[time]
duration = {duration}
step = 1e-4
"""
MESH = {"segments": 16, "elements_arc": 14, "duration": 0.2}
STEPS = (1.6e-4, 8e-5)  # s, of the full finite elements, the first of the modes too
HIGHEST = (400.0, 560.0)  # Hz, of the modes kept
BAND = (100.0, 530.0)  # Hz: third octaves of 125 to 500 Hz, of three lines at least
ASKED = 1.0  # dB


def run() -> list[Table]:
    """Differences of every third octave, the worst of them, and what a simulated second takes."""
    with tempfile.TemporaryDirectory() as folder:
        tires = Tires(SCENE.format(highest=max(HIGHEST), **MESH), Path(folder))
        full = [follow(tires.trial, *tires.full(step)) for step in STEPS]
        rows = [_row("all", "full FE", here, full[-1]) for here in full[:-1]]
        for highest in HIGHEST:
            count = int((tires.modes.frequency <= highest).sum())
            history = follow(tires.trial, *tires.modal(Choice(count, "attachment", STEPS[0])))
            rows.append(_row(count, "attachment", history, full[-1]))
        points = len(tires.trial.setup.patch.points)
        title = f"Passenger tire at 80 km/h: {points} contact points, {tires.setting}"
    columns = [("modes", "-"), ("residual", ""), ("step", "s"), ("loop a simulated second", "s")]
    columns += [(f"{name} force, {f:.0f} Hz", "dB") for name in _NAMES for f in _centres(full[-1])]
    columns += [(f"worst, {name} force", "dB") for name in _NAMES]
    return [Table(title, columns, rows, _notes(full))]


_NAMES = ("contact", "axle")


def _notes(full: list[History]) -> list[str]:
    """What is compared with what, and how sure the reference is of itself."""
    worst = [
        max(map(abs, _differences(here, finer)[name]))
        for here, finer in pairwise(full)
        for name in _NAMES
    ]
    own = ", ".join(f"{digits(one):g}" for one in worst[-2:])
    return [
        "Third octaves of the vertical forces less those of the full finite elements at their smallest step, of the same "
        f"mesh, points, road and air; asked: {ASKED:g} dB at most. The reference's last halving of the step changes "
        f"contact and axle force by {own} dB at most.",
        "The loop in processor seconds of one thread.",
    ]  # fmt: skip


def _levels(history: History, name: str) -> tuple[np.ndarray, np.ndarray]:
    centre, level = third_octaves(history.values[f"{name} force"][:, 2:], history.step, 2 * BAND[1])
    kept = (centre > BAND[0]) & (centre < BAND[1])
    return centre[kept], level[kept, 0]


def _centres(history: History) -> np.ndarray:
    return _levels(history, "contact")[0]


def _differences(history: History, exact: History) -> dict[str, list[float]]:
    """dB in every third octave, by force."""
    return {name: (_levels(history, name)[1] - _levels(exact, name)[1]).tolist() for name in _NAMES}


def _row(modes: int | str, residual: str, history: History, exact: History) -> list:
    found = _differences(history, exact)
    seconds = history.seconds / (history.step * len(history.values["contact force"]))
    values = [round(one, 2) for name in _NAMES for one in found[name]]
    worst = [digits(max(map(abs, found[name]))) for name in _NAMES]
    return [modes, residual, history.step, digits(seconds), *values, *worst]
