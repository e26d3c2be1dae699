"""Passenger tire with air and cords, rough road: third octaves of modes against full FE."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from tireroad.contact.results.spectra import nominal, third_octaves
from tireroad.runs.validation.full_elements import FullHistory, digits, follow
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Choice, Tires

# The full finite elements in time have the moduli of one frequency: exponent = 0.
ABOUT = "the passenger tire on a rough road, third octaves of modes against full finite elements"

SCENE = """
name = "validate"
[tire]
section = "radial"
size = "205/60 R15"
segments = {segments}
elements_arc = {elements_arc}
[[tire.region]]
exponent = 0.0
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
friction = 0.0
[road]
kind = "two-slope"
longest_wave = 0.5
[time]
duration = {duration}
step = 1e-4
"""
MESH = {"segments": 16, "elements_arc": 14, "duration": 0.2}
STEPS = (1.6e-4, 8e-5)  # s: steps of the full finite elements; the modes use the first
HIGHEST = (400.0, 560.0)  # Hz: upper frequency of the modes kept
BAND = (100.0, 530.0)  # Hz: third octaves of 125 to 500 Hz, with at least three lines each
ASKED = 1.0  # dB


def run() -> list[Table]:
    """Differences in every third octave, the largest of them, and seconds per simulated second."""
    with tempfile.TemporaryDirectory() as folder:
        tires = Tires(SCENE.format(highest=max(HIGHEST), **MESH), Path(folder))
        full = [follow(tires.trial, *tires.full(step)) for step in STEPS]
        compared = {f"full FE, {1e3 * here.step:g} ms": here for here in full[:-1]}
        for highest in HIGHEST:
            count = int((tires.modes.frequency <= highest).sum())
            choice = Choice(count, "attachment", STEPS[0])
            compared[f"{count} modes"] = follow(tires.trial, *tires.modal(choice))
        points = len(tires.trial.setup.patch.points)
        title = f"Passenger tire at 80 km/h: {points} contact points, {tires.setting}"
    return [compared_table(title, compared, full[-1])]


def compared_table(title: str, compared: dict[str, FullHistory], exact: FullHistory) -> Table:
    """Third octaves of vertical forces minus `exact`, dB: a row per band, a column per history."""
    rows: list[list] = []
    for name in ("contact", "axle"):
        centre, right = _levels(exact, name)
        off = np.column_stack([_levels(history, name)[1] - right for history in compared.values()])
        rows += [
            [name, f"{band:g}", *row.round(2).tolist()]
            for band, row in zip(nominal(centre), off, strict=True)
        ]
        rows.append([name, "worst", *map(digits, np.abs(off).max(axis=0))])
    columns = [("force", ""), ("band", "Hz"), *((name, "dB") for name in compared)]
    seconds = ", ".join(f"{name} {_seconds(history):.3g}" for name, history in compared.items())
    notes = [
        "Less the full finite elements at a step of "
        f"{1e3 * exact.step:g} ms, of the same mesh, points, road and air; target: {ASKED:g} dB at most. Modes with attachment, "
        f"at {1e3 * STEPS[0]:g} ms. What the reference's own last halving of the step changes stands in the column of the full "
        "finite elements.",
        f"A simulated second of the loop, in processor seconds of one thread: {seconds}, the reference {_seconds(exact):.3g}.",
    ]  # fmt: skip
    return Table(title, columns, rows, notes)


def _seconds(history: FullHistory) -> float:
    return history.seconds / (history.step * len(history.values["contact force"]))


def _levels(history: FullHistory, name: str) -> tuple[np.ndarray, np.ndarray]:
    centre, level = third_octaves(history.values[f"{name} force"][:, 2:], history.step, 2 * BAND[1])
    inside = (centre > BAND[0]) & (centre < BAND[1])
    return centre[inside], level[inside, 0]
