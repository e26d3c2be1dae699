"""Modes against full finite elements in time: rolling at 100 rad/s over sine, cleat and rough roads."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from runs.tabulate import Table
from runs.validation.comparison import Comparison, verdicts
from runs.validation.histories import follow
from runs.validation.tires import Choice, Tires

ABOUT = "contact and axle force while rolling, modes against full finite elements of the same mesh"

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
mass = 300.0
[rotation]
speed = 100.0
[modal]
count = {modes}
[contact]
youngs_modulus = 1e7
[road]
{road}
[time]
duration = 0.1
step = 1e-4
"""


@dataclass(frozen=True)
class Case:
    """A road, what to call it, and the steps (s) of the full finite elements."""

    name: str
    road: str
    steps: tuple[float, ...]


CASES = (
    Case(
        "sine, 0.5 mm, 0.2 m long",
        'kind = "sine"\namplitude = 5e-4\nwavelength = 0.2',
        (2e-4, 1e-4, 5e-5),
    ),
    Case(
        "cleat, 3 mm high, 20 mm long",
        'kind = "cleat"\nheight = 3e-3\nlength = 0.02\nramp = 5e-3\nposition = 0.5',
        (1e-4, 5e-5, 2.5e-5),
    ),
    Case(
        "cobblestones, joints of 0.5 mm",
        'kind = "cobblestones"\nheight_scatter = 1e-4\njoint_depth = 5e-4\nedge_radius = 3e-3',
        (1e-4, 5e-5, 2.5e-5),
    ),
)
CHOICES = (
    Choice(100, "none", 1e-4),
    Choice(100, "static", 1e-4),
    Choice(100, "attachment", 1e-4),
    Choice(200, "second-order", 1e-4),
    Choice(200, "attachment", 1e-4),
    Choice(200, "attachment", 5e-5),
    Choice(400, "static", 5e-5),
    Choice(400, "attachment", 1e-4),
    Choice(400, "attachment", 5e-5),
    Choice(400, "attachment", 2.5e-5),
    Choice(800, "static", 5e-5),
    Choice(800, "attachment", 5e-5),
    Choice(800, "attachment", 2.5e-5),
)
TARGETS = ((0.01, 100.0), (0.001, 30.0))  # error, ratio of run times
MESH = {"segments": 32, "elements_arc": 12}
LARGE = {"segments": 70, "elements_arc": 20}


def run() -> list[Table]:
    """A table a road, and which targets are reached."""
    return _run(MESH, 1.0)


def run_large() -> list[Table]:
    """Four times the unknowns, and the full finite elements at half the steps."""
    return _run(LARGE, 0.5)


def _run(mesh: dict[str, int], shrink: float) -> list[Table]:
    modes = max(choice.modes for choice in CHOICES)
    tables, rows = [], []
    with tempfile.TemporaryDirectory() as folder:
        scenes = [SCENE.format(road=case.road, modes=modes, **mesh) for case in CASES]
        tires = Tires(scenes[0], Path(folder))
        for case, scene in zip(CASES, scenes, strict=True):
            tires.change(scene)
            found = _compare(tires, [shrink * step for step in case.steps])
            tables.append(found.table(_title(tires, case, modes)))
            rows += [found.verdict(case.name, *target) for target in TARGETS]
    return [*tables, verdicts("Rolling at 100 rad/s: what was asked for", rows, [])]


def _title(tires: Tires, case: Case, modes: int) -> str:
    points = len(tires.session.patch.points)
    return (
        f"{case.name}: {tires.unknowns} unknowns, {points} contact points; static state and {modes} "
        f"modes took {tires.seconds:.1f} s"
    )


def _compare(tires: Tires, steps: list[float]) -> Comparison:
    session = tires.session
    full = [follow(session, *tires.full(step)) for step in steps]
    found = Comparison(full, ("contact force", "axle force"))
    for choice in CHOICES:
        found.add(choice, follow(session, *tires.modal(choice)))
    return found
