"""Modes against full finite elements: a tire at rest on a moving flat road (figures 6.4, 6.5)."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tireroad.contact.results.spectra import distance
from tireroad.runs.validation.full_elements import digits, follow, percent
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import LOADED, Choice, Tires, compare, verdicts

ABOUT = "a standing tire on a flat road that moves: modes against full finite elements"

SCENE = (
    LOADED
    + """
[damping]
mass = 500.0
[modal]
count = {modes}
[contact]
points = "nodes"
youngs_modulus = 1e7
friction = 0.0
[road]
kind = "flat"
motion = {{ kind = "sine", amplitude = {amplitude}, frequency = 50.0 }}
[time]
duration = {duration}
step = 1e-4
"""
)
AMPLITUDES = (1e-4, 2e-3)  # m: that of the thesis, and one at which the contact changes
CHOICES = (
    Choice(50, "none", 1e-4),
    Choice(50, "static", 1e-4),
    Choice(50, "static", 2e-4),
    Choice(150, "none", 1e-4),
    Choice(150, "static", 1e-4),
    Choice(150, "attachment", 1e-4),
    Choice(400, "static", 1e-4),
)
STEPS = (2e-4, 1e-4)  # s: steps of the full finite elements
MESH = {"segments": 24, "elements_arc": 10, "duration": 0.1}
# With large motions the finite elements are assembled several times per step.
SMALL = {"segments": 16, "elements_arc": 6, "duration": 0.04}
MOVED = (1e-4, 1e-3, 2e-3, 4e-3)  # m
LINEARISED = Choice(150, "attachment", 2e-4)
QUANTITIES = ("contact force", "axle force", "displacement")


def run() -> list[Table]:
    """Errors of contact force, axle force and displacement of the contact points; run times."""
    tables, rows = [], []
    modes = max(choice.modes for choice in CHOICES)
    with tempfile.TemporaryDirectory() as folder:
        scenes = [SCENE.format(amplitude=a, modes=modes, **MESH) for a in AMPLITUDES]
        tires = Tires(scenes[0], Path(folder))
        for amplitude, scene in zip(AMPLITUDES, scenes, strict=True):
            tires.change(scene)
            comparison = compare(tires, STEPS, CHOICES, QUANTITIES)
            name = f"flat road moved by {1e3 * amplitude:g} mm at 50 Hz"
            tables.append(comparison.table(f"Standing, {name}: {tires.setting}"))
            rows.append(comparison.verdict(name, 0.005, 1.0, tires.modes_seconds))
    return [*tables, verdicts("Moved flat road: targets", rows, []), _linearised()]


def _linearised() -> Table:
    """Motions about the static state: small against large ones on the same elements."""
    modes, rows = LINEARISED.modes, []
    with tempfile.TemporaryDirectory() as folder:
        scenes = [SCENE.format(amplitude=a, modes=modes, **SMALL) for a in MOVED]
        tires = Tires(scenes[0], Path(folder))
        for amplitude, scene in zip(MOVED, scenes, strict=True):
            tires.change(scene)
            rows += [[amplitude, *row] for row in _against_large_motions(tires)]
    names = [part for name in QUANTITIES for part in (name, f"worst {name}")]
    columns = [("amplitude", "m"), ("load", "N"), ("linearised tire", "")]
    columns += [(name, "%") for name in names] + [("large motions", "s"), ("loop", "s")]
    notes = [
        f"Against full finite elements with large motions, {tires.unknowns} unknowns, both at steps of "
        f"{LINEARISED.step:g} s, road moved at 50 Hz over {SMALL['duration']:g} s. Modes: {modes} with "
        "attachment modes.",
    ]
    return Table("What linearising about the static state costs", columns, rows, notes)


def _against_large_motions(tires: Tires) -> Iterator[list]:
    """Rows of the linear full finite elements and of the modes."""
    trial, step = tires.trial, LINEARISED.step
    exact = follow(trial, *tires.nonlinear(step))
    load = exact.values["contact force"][:, 2]
    for name, tire in (
        ("full FE, linear", tires.full(step)),
        ("modes", tires.modal(LINEARISED)),
    ):
        history = follow(trial, *tire)
        errors = []
        for quantity in QUANTITIES:
            pair = exact.values[quantity], history.values[quantity]
            far = distance(*pair, SMALL["duration"])
            errors += [percent(far.mean), percent(far.worst)]
        times = digits(exact.seconds), digits(history.seconds)
        yield [f"{load.min():.0f} to {load.max():.0f}", name, *errors, *times]
