"""The problem shared by the rolling benchmarks: a tire on a rough road, and its error measures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from string import Formatter

import numpy as np
from mpi4py import MPI
from scipy import sparse
from threadpoolctl import threadpool_limits

from tireroad.contact.results.spectra import distance
from tireroad.fem.matrices.probe import nodes
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.rolling import rolling_modes
from tireroad.modal.standing import fewer
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.store import opened
from tireroad.runs.pipeline import Finished, run_scene
from tireroad.runs.process import console
from tireroad.runs.stages.setup import components
from tireroad.runs.validation.full_elements import Conditions, FullHistory, follow

BAND = 500.0  # Hz: upper frequency of the errors
SPEED = 100.0  # rad/s

TEXTURE = 'kind = "texture"\nrms = 2e-4\nroll_off = 0.2\ncut_off = 0.03'
SCENE = """
name = "bench"
[tire]
segments = {segments}
elements_arc = {arc}
footprint_size = {footprint}
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[damping]
mass = 300.0
[rotation]
speed = {speed}
[modal]
count = {modes}
[greens]
residual = "{residual}"
[contact]
points = {{ dx = {pitch}, dy = {pitch} }}
youngs_modulus = 1e7
friction = {friction}
[road]
{road}
[time]
duration = {duration}
step = {step}
"""


@dataclass(frozen=True)
class Mesh:
    """Elements around and bead to bead, and their relative size at the footprint; None: default."""

    segments: int | None
    arc: int | None
    footprint: float | None

    def __str__(self) -> str:
        return f"{self.segments} x {self.arc}"


def write_scene(file: Path, mesh: Mesh, **keys: object) -> Path:
    """Write the scene with some keys changed: speed, modes, residual, pitch, duration, step, road.

    `road`: the lines of its table. A key that is None is left out of the scene.
    """
    values: dict[str, object] = {"speed": SPEED, "modes": 100, "residual": "static"}
    values |= {"pitch": 0.008, "duration": 0.2, "step": 1e-4, "road": TEXTURE, "friction": None}
    values |= vars(mesh) | keys
    absent = {name for name, value in values.items() if value is None}
    lines = [line for line in SCENE.splitlines(True) if not absent & set(_named(line))]
    file.write_text("".join(lines).format(**values))
    return file


def _named(line: str) -> Iterator[str]:
    """The format fields of a line."""
    return (name for _, name, _, _ in Formatter().parse(line) if name)


@dataclass(frozen=True)
class Prepared:
    """A `run` up to its Green's functions, and the `trial` with its road and settled points."""

    run: Finished
    trial: Conditions


def prepared(folder: Path, mesh: Mesh, *sets: str, **keys: object) -> Prepared:
    """A run without friction up to its Green's functions, with settled points; `sets` as for --set. Collective."""
    from tireroad.runs.scene.load import load

    folder.mkdir(parents=True, exist_ok=True)
    keys = {"friction": 0.0} | keys
    scene = load(write_scene(folder / "given.toml", mesh, **keys), list(sets))
    with console.quiet():
        run = run_scene(
            scene, folder, MPI.COMM_WORLD, until="greens", fresh=False, petsc_options=[]
        )
    setup, _ = run.setup.equilibrated(run.greens.contact, run.static.force, scene.contact)
    return Prepared(run, Conditions(scene.contact, setup, scene.time.duration))


@dataclass(frozen=True)
class Rolled:
    """A run as a user starts it: its stages in summary.json, and forces (n, 3) N by name."""

    stages: dict[str, dict]
    forces: dict[str, np.ndarray]

    def figure(self, stage: str, name: str):
        """A headline figure or an indicator of a stage."""
        entry = self.stages[stage]
        return (entry["headline"] | entry["indicators"])[name]["value"]

    @property
    def cost(self) -> float:
        """Seconds of all stages; of reused ones, the seconds of their computation.

        CPU time, if everything ran within fem.timing.by_processor.
        """
        return sum(sum(entry["cost"].values()) for entry in self.stages.values())

    @property
    def loop(self) -> float:
        """Wall-clock time (s) of the time loop, including files and checks."""
        return self.stages["contact"]["cost"]["time loop"]


def rolled(folder: Path, mesh: Mesh, *sets: str, cache: Cache = NO_CACHE, **keys: object) -> Rolled:
    """A run up to its contact forces; stages in the folder or the cache are reused. Collective."""
    from tireroad.runs.scene.load import load

    folder.mkdir(parents=True, exist_ok=True)
    scene = load(write_scene(folder / "given.toml", mesh, **keys), list(sets))
    with console.quiet():
        run_scene(
            scene,
            folder,
            MPI.COMM_WORLD,
            until="contact",
            fresh=False,
            petsc_options=[],
            cache=cache,
        )
    stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
    with opened(folder / "contact.h5") as file:
        forces = {name: file[name][:] for name in ("total_force", "axle_force")}
    return Rolled(stages, forces)


def fewer_modes(given: Prepared, count: int, residual: str) -> Response:
    """The response of the run with its first `count` modes and another residual. Collective."""
    run, job = given.run, given.run.job
    few = fewer(run.fields, run.motions, count, run.wheel.turning, job.axle)
    rolling = rolling_modes(few, run.wheel.turning, job.comm)
    setup = given.trial.setup
    parts = [nodes(setup.patch.index, len(run.static.points), part) for part in components(job)]
    points = sparse.vstack(parts, "csr")
    several = points, points, residual, lambda: rolling.basis
    return make_response(lambda: run.wheel, rolling, *several).response


def modal(given: Prepared, response: Response, step: float) -> FullHistory:
    """The loop on the states that the step resolves, without readings of the wheel."""
    count = response.residual.shape[1]
    alone = response.between(slice(count), slice(None)).resolved(step)
    tire = Recursion(response=alone, step=step, scheme="linear", comm=MPI.COMM_SELF)
    with threadpool_limits(1, "blas"):
        return follow(given.trial, tire, step, 0.0)


def errors(reference: FullHistory, found: FullHistory, duration: float) -> tuple[float, float]:
    """Relative L2 error up to BAND of the varying contact force and axle force, %."""
    contact, axle = (
        100 * distance(reference.values[name], found.values[name], duration, BAND).mean
        for name in ("contact force", "axle force")
    )
    return contact, axle
