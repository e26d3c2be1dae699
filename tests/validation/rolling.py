"""Modes against full finite elements in time: 100 rad/s over sine, cleat and rough roads."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tireroad.contact.results.spectra import BAND, distance
from tireroad.runs.validation.full_elements import digits, percent
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import (
    LOADED,
    Choice,
    Comparison,
    Tires,
    compare,
    verdicts,
)

ABOUT = "contact and axle force while rolling, modes against full finite elements of the same mesh"

SCENE = (
    LOADED
    + """
[damping]
mass = 300.0
[rotation]
speed = 100.0
[modal]
count = {modes}
[contact]
points = "nodes"
youngs_modulus = 1e7
friction = {friction:g}
[road]
{road}
[time]
duration = 0.1
step = 1e-4
"""
)


ROADS = {
    "sine, 0.5 mm, 0.2 m long": 'kind = "sine"\namplitude = 5e-4\nwavelength = 0.2',
    "cleat, 3 mm high, 20 mm long": (
        'kind = "cleat"\nheight = 3e-3\nlength = 0.02\nramp = 5e-3\nposition = 0.5'
    ),
    "cobblestones, joints of 0.5 mm": (
        'kind = "cobblestones"\nheight_scatter = 1e-4\njoint_depth = 5e-4\nedge_radius = 3e-3'
    ),
}
MORE_ROADS = {
    "cobblestones, joints of 6 mm": 'kind = "cobblestones"',
    "texture, 0.2 mm rms": 'kind = "texture"',
}
STEPS = (1e-4, 5e-5, 2.5e-5)  # s: steps of the full finite elements
CHOICES = (
    Choice(100, "none", 1e-4),
    Choice(100, "static", 1e-4),
    Choice(100, "attachment", 1e-4),
    Choice(200, "attachment", 2e-4),
    Choice(200, "attachment", 1e-4),
    Choice(200, "attachment", 5e-5),
    Choice(400, "static", 5e-5),
    Choice(400, "attachment", 2e-4),
    Choice(400, "attachment", 1e-4),
    Choice(400, "attachment", 5e-5),
    Choice(400, "attachment", 2.5e-5),
    Choice(800, "static", 5e-5),
)
TARGETS = ((0.01, 100.0), (0.001, 30.0))  # error, ratio of run times
MESH = {"segments": 32, "elements_arc": 12}
LARGE = {"segments": 70, "elements_arc": 20}


def run() -> list[Table]:
    """One table per road, and which targets are reached."""
    return _run(MESH, STEPS, ROADS)


def run_large() -> list[Table]:
    """Four times the unknowns, full finite elements at half the steps, rougher roads."""
    return _run(LARGE, [step / 2 for step in STEPS], ROADS | MORE_ROADS)


def _run(mesh: dict[str, int], steps: Sequence[float], roads: dict[str, str]) -> list[Table]:
    modes = max(choice.modes for choice in CHOICES)
    tables, rows, apart = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        scenes = {
            name: SCENE.format(road=road, modes=modes, friction=1.0, **mesh)
            for name, road in roads.items()
        }
        tires = Tires(next(iter(scenes.values())), Path(folder))
        for name, scene in scenes.items():
            tires.change(scene)
            comparison = compare(tires, steps, CHOICES, ("contact force", "axle force"))
            points = len(tires.trial.setup.patch.points)
            tables.append(comparison.table(f"{name}: {points} contact points, {tires.setting}"))
            tables[-1].notes.append(_beyond(comparison))
            rows += [comparison.verdict(name, *target, tires.modes_seconds) for target in TARGETS]
            apart += _directions(name, comparison)
    return [*tables, verdicts("Rolling at 100 rad/s: targets", rows, []), _by_direction(apart)]


def _directions(name: str, comparison: Comparison) -> list[list]:
    """Along and away from the road: what the forces vary by, N, and how far finer steps and modes change that, %."""
    exact, coarser = comparison.full[-1].history, comparison.full[-2].history
    same = [run for run in comparison.modal if run.history.step == exact.step] or comparison.modal
    modes = min(same, key=lambda run: run.error)
    rows = []
    for force in ("contact force", "axle force"):
        for axis, direction in ((0, "along the road"), (2, "vertical")):
            right, *others = (
                history.values[force][:, axis : axis + 1]
                for history in (exact, coarser, modes.history)
            )
            off = [distance(right, other, exact.step * len(right)).mean for other in others]
            named = f"{modes.choice.modes} {modes.choice.residual}, {modes.history.step:g} s"
            rows.append(
                [
                    name,
                    force,
                    direction,
                    digits(float(right.std())),
                    percent(off[0]),
                    named,
                    percent(off[1]),
                ]
            )
    return rows


def _by_direction(rows: list[list]) -> Table:
    columns = [("road", ""), ("force", ""), ("direction", ""), ("standard deviation", "N"),
               ("full FE at twice the step", "%"), ("modes", ""), ("off", "%")]  # fmt: skip
    notes = [
        "With friction 1, from steady free rolling, against the full finite elements at their smallest step: a relative L2 norm for each "
        "direction. What halving the step changes in the reference itself stands beside what the modes change at the same step.",
    ]
    return Table("Rolling at 100 rad/s: direction by direction", columns, rows, notes)


def _beyond(comparison: Comparison) -> str:
    """Force above the band, which the nonlinear contact partly transfers into it."""
    force = comparison.full[-1].history.values["contact force"][:, 2]
    power = np.abs(np.fft.rfft(force - force.mean())) ** 2
    frequency = np.fft.rfftfreq(len(force), comparison.full[-1].history.step)
    within, above = (
        np.sqrt(2 * power[part].sum()) / len(force)
        for part in (frequency <= BAND, frequency > BAND)
    )
    return (
        f"Contact force: {within:.3g} N rms up to {BAND:g} Hz, {above:.3g} N above. Points that touch and "
        "leave bring part of what is above, where modes are missing, down into the band."
    )
