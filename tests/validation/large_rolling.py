"""Rolling on to a bar and into a hole: the loop of a scene with large motions against nonlinear finite elements in time."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from tireroad.contact.results.spectra import in_band
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.large_motion import LargeTire
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.files.cache import Cache
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.stages.large import LEFT_OUT
from tireroad.runs.stages.rolling import Integration, driven_tire, recursive
from tireroad.runs.stages.setup import probes
from tireroad.runs.stages.training import TrainedMotion
from tireroad.runs.validation.full_elements import (
    Conditions,
    Elements,
    FullHistory,
    digits,
    follow,
    percent,
)
from tireroad.runs.validation.tables import Table, asked

Array = np.ndarray
# The full finite elements in time have the moduli of one frequency: exponent = 0.
ABOUT = "a coarse passenger tire that rolls on to a bar and into a hole: linear and large motions against nonlinear elements"

SCENE = """
name = "validate"
[tire]
section = "radial"
size = "205/60 R15"
segments = 12
elements_arc = 6
[tire.cavity]
gas = "none"
[[tire.region]]
exponent = 0.0
[static]
inflation = 2.2e5
load = {load}
error_estimate = false
[modal]
up_to = {up_to}
[damping]
mass = 60.0
[rotation]
speed = 26.6
[contact]
points = {{ dx = 0.008, dy = 0.02 }}{reach}
youngs_modulus = 1e7
friction = {friction}
[road]
{road}
[time]
duration = {duration}
step = {step}
[motion]
kind = "large"
[accuracy]
estimate = false
"""
BAR = """kind = "cleat"
run_in = 0.0
height = {height}
length = {length}
ramp = {ramp}
position = {position}"""
BAND = 400.0  # Hz
MODES = (
    2 * BAND
)  # Hz: points meet the edges of a bar at 1 kHz, and modes to the band's end leave most of what is off
RADIUS, SPEED = 0.313, 8.33  # m, m/s: of the tire, along the road
BEFORE, ON = 0.005, 0.09  # m from the foremost point to the obstacle, and rolled on it
STEP = 2e-4  # s
# Of the repeated reference: at half the step these points, closer than the nodes, have no compliance that is positive definite.
FINER = 0.75 * STEP
TOGETHER = 6e-4  # s: from one instant at which both steps end to the next
NAMES = "elements, linear", "loop, linear", "loop, large"
FORCES = ("contact force", "axle force")
AXES = {"vertical": 2, "along the road": 0}


@dataclass(frozen=True)
class Case:
    """An obstacle across the road (m; `height` negative: a hole), `on` m of which are rolled on, under a load N with a coefficient
    of `friction`; `reach` m of its points, by default that of a scene. `again`: whether the reference is repeated with shorter steps."""

    height: float
    length: float
    ramp: float
    load: float = 4000.0
    friction: float = 0.0
    on: float = ON
    reach: float | None = None
    again: bool = False

    def __str__(self) -> str:
        kind = "bar" if self.height > 0 else "hole"
        return f"{kind} {1e3 * abs(self.height):g} x {1e3 * self.length:g} mm, {self.load:g} N, friction {self.friction:g}"

    def scene(self) -> str:
        """A scene that rolls until the obstacle is `on` m inside the place where it is met."""
        # A circle of the tire's radius, 20 mm deep; a road begins before its points, which reach by default as far as the circle is
        # 5 mm and 1.5 heights above it, at most a tenth more.
        reach = self.reach or 0.005 + 1.5 * abs(self.height)
        met, first = (
            np.sqrt(2 * RADIUS * (0.02 + gap)) for gap in (max(self.height, 0.0), 1.1 * reach)
        )
        position = first + BEFORE
        duration = (position + 0.5 * self.ramp - met + self.on) / SPEED
        road = BAR.format(**vars(self), position=round(position, 4))
        return _scene(self, road, duration, f"\nreach = {reach}" if self.reach else "")


@dataclass(frozen=True)
class Cobblestones:
    """The pavement of `road.kind = "cobblestones"`, rolled over for a `duration` s: half of it before the footprint is on it."""

    load: float = 4000.0
    friction: float = 0.0
    duration: float = 0.03
    again: bool = False

    def __str__(self) -> str:
        return f"cobblestones, {self.load:g} N, friction {self.friction:g}"

    def scene(self) -> str:
        """A scene that rolls on to the pavement."""
        return _scene(self, 'kind = "cobblestones"\nrun_in = 0.02', self.duration)


Road = Case | Cobblestones


def _scene(case: Road, road: str, duration: float, reach: str = "") -> str:
    given = {
        "reach": reach,
        "load": case.load,
        "friction": case.friction,
        "up_to": MODES,
        "step": STEP,
    }
    return SCENE.format(**given, road=road, duration=round(duration, 4))


CASES: tuple[Road, ...] = (
    Case(0.010, 0.020, 0.010, again=True),
    Case(0.015, 0.050, 0.015),
    Case(0.025, 0.050, 0.025),
    # Until its first edge is behind the footprint, whose ends come nearer to the road than a level one's.
    Case(-0.030, 0.300, 0.020, on=0.22, reach=0.02),
    Case(0.015, 0.050, 0.015, friction=1.0),
    Case(0.010, 0.020, 0.010, load=2000.0),
    Case(0.010, 0.020, 0.010, load=6000.0),
    Cobblestones(),
)


def chosen(only: Sequence[str]) -> list[Road]:
    """The cases whose names have all words of one of `only`, all of them without any."""
    return [case for case in CASES if asked(str(case).replace(",", "").split(), only)]


def run(only: Sequence[str] = ()) -> list[Table]:
    """The table of the cases, or of those whose names have all words of one of `only`. Serial."""
    rows, costs, failed = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number, case in enumerate(chosen(only)):
            console.say(f"{case}")
            try:
                compared = beside(case, Path(folder) / str(number), Cache(Path(folder) / "cache"))
            except ConvergenceError as error:
                failed.append(f"{case}: {error}")
                continue
            rows += compared.rows(str(case))
            costs.append([str(case), *compared.cost()])
    columns = [
        ("road, load, friction", ""),
        ("force", ""),
        ("direction", ""),
        ("largest change", "N"),
    ]
    columns += [
        (f"{name}{of}", "%")
        for name in (*NAMES, "elements, steps of 0.2 off 0.15 ms")
        for of in ("", ", worst")
    ]
    notes = [
        f"205/60 R15, 12 x 6 elements, 2.2 bar, no air, 30 km/h, modes to {MODES:g} Hz, steps of 0.2 ms; the first {1e3 * ON:g} mm of way on "
        f"a bar, a hole's whole first edge. Below {BAND:g} Hz, off nonlinear elements of the same points, contact and steps: rms of the difference over the rms of the change, "
        "and largest difference over the largest change.",
    ]
    about = [("road, load, friction", ""), ("vectors", "-"), ("cells", "-"), ("left out", "%"), ("evaluations a step", "-"),
             ("energy that does not add up, of the largest work", "%"), ("loop over the linear one", "-"), ("training", "s"),
             ("iterations a step of the elements", "-")]  # fmt: skip
    return [
        Table("Rolling on to a bar and into a hole", columns, rows, notes, failed=failed),
        Table("What that takes", about, costs, []),
    ]


@dataclass(frozen=True)
class Beside:
    """Histories over one obstacle by name, those of the nonlinear elements (`exact`, and in shorter steps: `finer`), and the figures of the run's stages."""

    exact: FullHistory
    others: dict[str, FullHistory]
    finer: FullHistory | None
    iterations: float
    stages: dict[str, Any]

    def rows(self, name: str) -> list[list]:
        """What each tire is off in % below `BAND`, rms and worst, a row per force and direction."""
        out = []
        for force in FORCES:
            for direction, axis in AXES.items():
                true, *others = (
                    _changes(one, force, one.step)[:, axis]
                    for one in (self.exact, *self.others.values())
                )
                row: list = [name, force, direction, digits(float(abs(true).max()))]
                for other in others:
                    row += _off(other, true)
                row += ["", ""]
                if self.finer:
                    both = (
                        _changes(one, force, TOGETHER)[:, axis] for one in (self.exact, self.finer)
                    )
                    row[-2:] = _off(*both)
                out.append(row)
        return out

    def cost(self) -> list:
        """What training and loop took, and how the energy closes."""

        def value(stage: str, name: str) -> float:
            entry = self.stages[stage]
            return digits((entry["headline"] | entry["indicators"])[name]["value"])

        moved = max(
            abs(value("contact", name))
            for name in ("work of contact on the tire", "energy lost in the material")
        )
        off = abs(value("contact", "energy that does not add up"))
        linear, large = (self.others[name].seconds for name in NAMES[1:])
        return [
            value("nonlinear", "vectors"),
            value("nonlinear", "cells of the mesh"),
            value("contact", LEFT_OUT),
            value("contact", "evaluations of the reduced force a step"),
            percent(off / moved),
            digits(large / linear),
            digits(self.stages["nonlinear"]["seconds"]),
            digits(self.iterations),
        ]


def _changes(history: FullHistory, force: str, apart: float) -> Array:
    """Changes (n, 3) N of a force below `BAND` at instants that are so far `apart`, s."""
    every, values = round(apart / history.step), history.values[force]
    return in_band(values - values[0], history.step, BAND)[every - 1 :: every]


def _off(found: Array, true: Array) -> list[float]:
    """rms and largest difference over those of a true history (n,), %."""
    count = min(len(found), len(true))
    found, true = found[:count], true[:count]
    off = found - true
    return [
        percent(float(np.linalg.norm(off) / np.linalg.norm(true))),
        percent(float(abs(off).max() / abs(true).max())),
    ]


def beside(case: Road, folder: Path, cache: Cache) -> Beside:
    """The case by all tires. Serial."""
    folder.mkdir()
    file = folder / "scene.toml"
    file.write_text(case.scene())
    given: dict[str, Any] = {"until": "contact", "fresh": False, "petsc_options": []}
    with console.quiet():
        run = run_scene(load(file), folder, MPI.COMM_SELF, cache=cache, **given)
    stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
    job, static, response = run.job, run.static, run.greens.contact
    contact = job.scene.contact
    assert contact is not None, "a scene with contact"
    setup, _ = run.setup.equilibrated(response, static.normal_force, contact)
    begun = response if contact.has_friction else None
    trial = Conditions(contact, setup, job.scene.time.duration, begun)
    elements = Elements(run, job, probes(job, static, run.setup))
    nonlinear, *arguments = elements.nonlinear(STEP)
    exact = follow(trial, nonlinear, *arguments)
    scheme, steps = recursive(run.done["contact"].product.scheme), len(exact.values["axle force"])

    def recursion(of: Response) -> Recursion:
        return Recursion(response=of.resolved(STEP), step=STEP, scheme=scheme, comm=MPI.COMM_SELF)

    trained: TrainedMotion = run.done["nonlinear"].product
    force = trained.stored.force(run.done["restoring"].product)
    straight, bent = recursion(response), recursion(trained.response)
    large = LargeTire(bent, force, response.residual.shape[1], scheme)
    # With the readings of the hub.
    tires = (
        elements.full(STEP)[0],
        driven_tire(job, Integration(straight, STEP, steps, scheme), setup.patch),
        driven_tire(job, Integration(bent, STEP, steps, scheme), setup.patch, large),
    )
    others = {name: follow(trial, tire, STEP, 0.0) for name, tire in zip(NAMES, tires, strict=True)}
    finer = follow(trial, *elements.nonlinear(FINER)) if case.again else None
    iterations = nonlinear.turns / len(exact.values["contact force"])
    return Beside(exact, others, finer, iterations, stages)
