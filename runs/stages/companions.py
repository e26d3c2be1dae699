"""Cheap companions of a run: what its time step, points, modes and mesh are worth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tireroad.contact.respaced import halved, ratio, thinned
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.error_bars import orders, random_share, share
from tireroad.contact.setup import ContactSetup, on_shape
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.path.carried_over import carried_over
from tireroad.fem.static.state import StaticState
from tireroad.fem.static.tread_surface import TreadSurface
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.folder import make_folder
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Done, Part, Shared, Stage
from tireroad.runs.stages.build.cavity import AirColumn
from tireroad.runs.stages.build.rolling.loop import Forces, forces
from tireroad.runs.stages.build.setup import Setup
from tireroad.runs.stages.greens import GreensStage
from tireroad.runs.stages.modes import Fields, ModesStage, Motions
from tireroad.runs.stages.rotating import FullMatrices, RotatingStage
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.stored.obtained import obtained

UP_TO_GREENS: tuple[type[Part], ...] = (
    StaticStage,
    Motions,
    Setup,
    ModesStage,
    AirColumn,
    Fields,
    FullMatrices,
    RotatingStage,
    GreensStage,
)
FEWER = 1 / np.sqrt(2)  # of the highest mode: up to where the companion keeps states
COARSER = "coarser"  # the folder in the run's own where its coarser companion's stages are, until they are of no use
LEAST = (8, 4)  # elements around and along that a companion has


@dataclass(frozen=True, kw_only=True)
class Given:
    """A run: its `job`, its static state, patch and road (not settled), response
    and rolling modes, and the first `steps` of `step` s of its loop, by a `scheme`, that companions repeat; `free_slip`: what the
    setup has of it, and another setup of the scene needs."""

    job: Job
    static: Done[StaticState]
    setup: ContactSetup
    response: Response
    rolling: RollingModes
    step: float
    steps: int
    scheme: str = "linear"
    free_slip: float = 0.0

    @cached_property
    def settled(self) -> ContactSetup:
        """The patch in its static state."""
        return settled(self.job, self.setup, self.response, self.static.product.normal_force)

    @cached_property
    def longer(self) -> Forces:
        """The run with twice its step. Collective."""
        return self.repeated(self.settled, self.response, coarser=2)

    @cached_property
    def base(self) -> Forces | None:
        """The run with twice the step where companions of points, modes and mesh, with that step too, are compared
        with it, at half the cost; None where its steps leave out a state or do not resolve the contact's
        oscillation, and those of the run do. Collective."""
        step, spec = 2 * self.step, self.job.scene.contact
        kept = self.response.resolved(step)
        if len(kept.every) < len(self.response.resolved(self.step).every):
            return None
        steps = oscillation(spec, self.settled.patch, kept, step)
        if self.scheme == "linear" and choose(steps).scheme != "linear":
            return None
        try:
            return self.longer
        except (ConvergenceError, InputError):
            return None

    def of(self, job: Job) -> Given:
        """The same with another job; its base stays that of the run."""
        other = replace(self, job=job)
        other.__dict__["base"] = self.base
        return other

    def repeated(
        self, setup: ContactSetup, response: Response, coarser: int | None = None
    ) -> Forces:
        """The loop by another setup (settled), response or a step `coarser` times as long, by default that of
        `base`. Collective."""
        times = coarser or (1 if self.base is None else 2)
        return forces(
            self.job, setup, response, times * self.step, self.steps // times, self.scheme
        )


def settled(job: Job, setup: ContactSetup, response: Response, force: np.ndarray) -> ContactSetup:
    """The patch in its static state under the nodal forces (s,) N."""
    return setup.settled(response, force, job.scene.contact)[0]


def longer_step(given: Given) -> Forces:
    """Twice the time step. Collective."""
    return given.longer


def other_points(given: Given) -> Forces:
    """Every other point of the grid both ways, or, of a footprint that holds few, twice as many. Collective."""
    job, patch = given.job, given.setup.patch
    if patch.places is None:
        raise InputError(
            "the points are nodes of the mesh: take a grid, contact.points = { dx, dy }"
        )
    coarser = ratio(given.settled.patch) > 1
    brush = job.scene.contact.brush_stiffness
    if brush is not None:  # of a point that stands for four, or for a quarter
        contact = replace(job.scene.contact, brush_stiffness=brush * (4 if coarser else 0.25))
        job = replace(job, scene=replace(job.scene, contact=contact))
    if coarser:
        patch = thinned(patch)
    else:
        surface = TreadSurface(job.tire.lattice, given.static.product.seen)
        height = given.static.product.road_height
        assert height is not None
        patch = halved(patch, surface, height, given.setup.reach)
        patch = on_shape(patch, given.static.product.road)
    setup = replace(given.setup, patch=patch)
    setup = settled(job, setup, given.response, given.static.product.normal_force)
    return given.of(job).repeated(setup, given.response)


def fewer_modes(given: Given) -> Forces:
    """States up to `FEWER` of the highest mode, those above following statically. Collective."""
    limit = FEWER * given.rolling.highest
    kept = given.response.keeping_where(lambda s: np.abs(s) <= limit)
    if len(kept.every) == len(given.response.every):
        raise InputError("all states are slower than the highest mode by far: none can be left out")
    return given.repeated(given.settled, kept)


@dataclass(frozen=True, kw_only=True)
class CoarserStatic(StaticStage):
    """The coarser mesh's static state by a few steps from that of the `run`; from the beginning at a deflection,
    which counts from its own first touch, and where those steps find no balance."""

    run: Job
    near: Done[StaticState]

    def inputs(self) -> dict:
        """Of any static state, and where it starts."""
        return super().inputs() | {"near": self.near.key}

    def compute(self, record: Record) -> StaticState:
        """Collective."""
        wanted = self.job.scene.static
        if wanted.deflection is None:
            given = self.near.product, self.run.tire, self.job.tire, wanted.load
            if (found := carried_over(*given)) is not None:
                return found
        return super().compute(record)


def coarser_mesh(given: Given) -> Forces:
    """Elements of twice the size, from the static state on. Collective."""
    job, done = coarser_job(given.job), dict[str, Done]()
    on_root(job.comm, lambda: make_folder(job.directory))
    for kind in UP_TO_GREENS:
        part = (
            CoarserStatic(job=job, run=given.job, near=given.static)
            if kind is StaticStage
            else kind.taken(job, done)
        )
        if (found := _made(job, kind, part, done)) is not None:
            done[kind.name] = found
    response, state = done["greens"].product.contact, done["static"].product
    setup = done["setup"].product.with_slip(given.free_slip)
    setup = settled(job, setup, response, state.normal_force)
    return given.of(job).repeated(setup, response)


def coarser_job(job: Job) -> Job:
    """The same scene on half the elements around, and bead to bead where the scene says how many; its stages are
    shared as those of any run, in a folder beside the run's own.

    InputError where the mesh is too coarse to be halved.
    """
    tire, static = job.scene.tire, job.scene.static
    coarse = replace(tire, segments=tire.segments // 2, shape=tire.shape.coarser(tire))
    if coarse.segments < LEAST[0] or coarse.proportions().along < LEAST[1]:
        raise InputError("the mesh is too coarse to be halved")
    rotation = job.scene.rotation
    if rotation is not None:  # as fast as the run's own wheel, whatever the travel speed
        rotation = replace(rotation, speed=job.speed, travel_speed=None)
    scene = replace(
        job.scene,
        rotation=rotation,
        tire=coarse,
        static=replace(static, error_estimate=False),
    )
    return replace(job, scene=scene, directory=job.directory / COARSER, found={})


def _made(job: Job, kind: type[Part], part: Part | None, done: dict[str, Done]) -> Done | None:
    """What a part of the chain adds to what is done; None where it adds nothing. Collective."""
    if kind is RotatingStage and not job.speed:
        return RotatingStage.instead(job, done)
    if isinstance(part, Stage):
        return obtained(part).done
    return Done("", part.make) if isinstance(part, Shared) else None


COMPANIONS: dict[str, Callable[[Given], Forces]] = {
    "step": longer_step,
    "points": other_points,
    "modes": fewer_modes,
    "mesh": coarser_mesh,
}
"""By the cause of the error that each is for (contact.results.error_bars.CAUSES)."""


def companion(cause: str, given: Given) -> tuple[Forces, Forces | None, float]:
    """The forces of a companion, those they are compared with (None: the run's own), and the share of their
    difference that is the error, without a word.

    Collective; InputError or ConvergenceError where there is none.
    """
    with observe.quiet():
        beside = None if cause == "step" else given.base
        found = COMPANIONS[cause](given)
    points = ratio(given.settled.patch) if cause == "points" else 2.0
    size = {"step": 2.0, "points": points, "modes": 1 / FEWER, "mesh": 2.0}[cause]
    order = orders(given.job.tire.section.order)[cause]
    return found, beside, (random_share if cause == "points" else share)(size, order)
