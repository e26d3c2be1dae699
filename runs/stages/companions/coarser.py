"""The same scene on elements of twice the size, up to its Green's functions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from tireroad.fem.errors import InputError
from tireroad.fem.static.load_error import carried_over
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.folder import make_folder
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Done, Part, Shared, Stage
from tireroad.runs.stages.build.cavity import AirColumn
from tireroad.runs.stages.build.setup import Setup, points_of
from tireroad.runs.stages.greens import GreensStage
from tireroad.runs.stages.modes import Fields, ModesStage, Motions
from tireroad.runs.stages.rotating import FullMatrices, RotatingStage
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.stored.obtained import obtained

STATIC_TO_GREENS: tuple[type[Part], ...] = (
    Motions,
    Setup,
    ModesStage,
    AirColumn,
    Fields,
    FullMatrices,
    RotatingStage,
    GreensStage,
)
COARSER = "coarser"  # folder, in the run's own, of the coarser companion's stages
LEAST = (8, 4)  # fewest elements around and along of a companion's mesh


@dataclass(frozen=True, kw_only=True)
class CoarserStatic(StaticStage):
    """The static state on the coarser mesh, reached in a few steps from that of the `run`.

    It is computed from the undeformed tire if the scene prescribes a deflection, which counts from
    this mesh's own first contact, or if those steps do not converge.
    """

    forgets: ClassVar[bool] = False  # the run's own matrices are kept for the next member
    run: Job
    near: Done[StaticState]

    def inputs(self) -> dict:
        """Those of any static state, and the state it starts from."""
        return super().inputs() | {"near": self.near.key}

    def compute(self, record: Record) -> StaticState:
        """The static state. Collective."""
        wanted = self.job.scene.static
        if wanted.deflection is None:
            given = self.near.product, self.run.tire, self.job.tire, wanted.load
            if (found := carried_over(*given)) is not None:
                return found
        return super().compute(record)


def coarser(run: Job, static: Done[StaticState]) -> tuple[Job, dict[str, Done]]:
    """The coarser job, and its parts from the static state to the Green's functions. Collective."""
    job, done = coarser_job(run), dict[str, Done]()
    if (contact := job.scene.contact) is not None:
        # Contact points as in the run, not those its own footprint would ask for.
        contact = replace(contact, points=points_of(run, static.product))
        job = replace(job, scene=replace(job.scene, contact=contact))
    on_root(job.comm, lambda: make_folder(job.directory))
    chain: tuple[type[Part], ...] = (StaticStage, *STATIC_TO_GREENS)
    for kind in chain:
        part = (
            CoarserStatic(job=job, run=run, near=static)
            if kind is StaticStage
            else kind.taken(job, done)
        )
        if (found := _made(job, kind, part, done)) is not None:
            done[kind.name] = found
    return job, done


def coarser_job(job: Job) -> Job:
    """The same scene with half the elements around and, where given, from bead to bead.

    Its stages are cached like those of any run, in a subfolder of the run's. Raises InputError if
    the mesh is too coarse to be halved.
    """
    tire, static = job.scene.tire, job.scene.static
    coarse, segments = tire, tire.segments // 2
    if segments >= LEAST[0]:
        coarse = replace(tire, segments=segments, shape=tire.shape.coarser(tire))
    if coarse is tire or coarse.proportions().along < LEAST[1]:
        around, along = (2 * least for least in LEAST)
        raise InputError(
            f"the mesh is too coarse to be halved: that needs {around} elements around and {along} along"
        )
    rotation = job.scene.rotation
    if rotation is not None:  # the speed of the run's own wheel, whatever the travel speed
        rotation = replace(rotation, speed=job.speed, travel_speed=None)
    scene = replace(
        job.scene,
        rotation=rotation,
        tire=coarse,
        static=replace(static, error_estimate=False),
    )
    return replace(job, scene=scene, directory=job.directory / COARSER, found={})


def _made(job: Job, kind: type[Part], part: Part | None, done: dict[str, Done]) -> Done | None:
    """The result of one part of the chain; None if it has none. Collective."""
    if kind is RotatingStage and not job.speed:
        return RotatingStage.instead(job, done)
    if isinstance(part, Stage):
        return obtained(part).done
    return Done("", part.make) if isinstance(part, Shared) else None
