"""Runs the stages in order: each is reused, computed or skipped, and its cost is recorded."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from mpi4py import MPI

from tireroad.contact.roads.road import RoadKind
from tireroad.contact.roads.under_tire import Road
from tireroad.contact.setup import ContactSetup
from tireroad.fem.collective import broadcast
from tireroad.fem.errors import InputError
from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.disk import FACTORS, remove_factors
from tireroad.runs.files.folder import Summary, make_folder
from tireroad.runs.process import console
from tireroad.runs.process.demand import check_demand, out_of_core
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.surroundings import factors_on_disk, forget_peak
from tireroad.runs.scene import files
from tireroad.runs.scene.choices import with_modal
from tireroad.runs.scene.estimate import Estimate, duration, estimate, memory_of
from tireroad.runs.scene.plan import meets_road, skipped
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.road_cache import keep, road_of
from tireroad.runs.scene.rules import check_road
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.accuracy import STATIC_TO_GREENS, AccuracyStage, begin_ahead
from tireroad.runs.stages.contact import ContactStage
from tireroad.runs.stages.failures import failure_recorded
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.response import ResponseStage
from tireroad.runs.stages.setup import Setup
from tireroad.runs.stages.sound import RadiationStage, SoundStage
from tireroad.runs.stages.spectra import SpectraStage
from tireroad.runs.stages.stage import Job, PipelinePart, Result, Stage, largest_memory
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.stiffness import StiffnessStage
from tireroad.runs.stages.stretches import StretchesStage
from tireroad.runs.stages.training import NonlinearStage, Restoring
from tireroad.runs.stages.vibration import MotionStage, VibrationStage
from tireroad.runs.stages.whole_tire import LinesOfRun

PARTS: tuple[type[PipelinePart], ...] = (
    StaticStage,
    RadiationStage,
    StiffnessStage,
    *STATIC_TO_GREENS,
    Restoring,
    NonlinearStage,
    ContactStage,
    AccuracyStage,
    StretchesStage,
    ResponseStage,
    SpectraStage,
    LinesOfRun,
    VibrationStage,
    SoundStage,
    MotionStage,
)

"""Each takes its inputs by name from the parts before it."""


def share(surface: RoadKind, comm: MPI.Comm) -> None:
    """Make the road of a file available on every process, where `road_of` finds it.

    Heights in memory are sent as buffers; a file, the user's or a temporary one, is opened by each
    process, which reads what it drives over. A process that cannot open it reads the road file
    itself on first use. Raises InputError on all processes if one machine cannot use the file.
    Collective.
    """
    if comm.size == 1 or surface.reads is None:
        return
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    road, error = None, None
    if node.rank == 0:
        try:
            road = road_of(surface)
        except InputError as told:
            error = told
    failed = [failure for failure in comm.allgather(error) if failure is not None]
    if not failed and (shared := _sent(road, node)) is not None:
        keep(surface, shared)
    node.Free()
    if failed:
        raise failed[0]


def _sent(road: Road | None, node: MPI.Comm) -> Road | None:
    """The road of the machine's first process if this one can open it, else None. Collective.

    No process leaves before all have opened it: the first one may then close its temporary file.
    """
    try:
        return broadcast(node, road)
    except OSError:
        return None
    finally:
        node.Barrier()


@dataclass(frozen=True)
class Finished:
    """The products of a run in memory: its `job`, and the parts that are `done`, by name."""

    job: Job
    done: Mapping[str, Result]

    @property
    def static(self) -> StaticState:
        """The static state."""
        return self.done["static"].product

    @property
    def motions(self) -> SmallMotions:
        """The matrices about the static state."""
        return self.done["motions"].product

    @property
    def wheel(self) -> Wheel:
        """The full matrices of the rotating wheel."""
        return self.done["wheel"].product

    @property
    def setup(self) -> ContactSetup:
        """The patch and the road under it."""
        return self.done["setup"].product

    @property
    def fields(self) -> ModalBasis:
        """The standing modes with their fields on all unknowns."""
        return self.done["fields"].product

    @property
    def rolling(self) -> RollingModes:
        """The states of the rotating tire."""
        return self.done["rotating"].product

    @property
    def greens(self) -> Responses:
        """The responses between the points of the scene."""
        return self.done["greens"].product


def run_scene(
    scene: Scene,
    directory: Path,
    comm: MPI.Comm,
    *,
    until: str | None,
    fresh: bool,
    petsc_options: list[str],
    cache: Cache = NO_CACHE,
) -> Finished:
    """Run the stages of a scene into `directory`; returns their products. Collective.

    `cache`: finished stages shared with other runs, by default none.
    """
    job = Job(with_modal(scene, until), directory, comm, fresh, cache)
    forget_peak()  # of an earlier member of a sweep in the same process
    summary, needed, on_disk = _begun(job, until)
    reasons = skipped(job.scene, until)
    if AccuracyStage.name not in reasons:
        job = replace(job, beside_loop=begin_ahead)
    if petsc_options:
        console.say(f"PETSc options: {' '.join(petsc_options)}")
    done: dict[str, Result] = {}
    with _factors(on_disk, directory, comm):
        for kind in PARTS:
            with failure_recorded(kind.name, summary, comm):
                if issubclass(kind, Stage) and kind.name in reasons:
                    result = _skipped(kind, job, done, reasons[kind.name], summary)
                else:
                    result = _made(kind, job, done, summary)
                if result is not None:
                    done[kind.name] = result
                job.settle(done)
                if result is not None and kind is Setup and "contact" not in reasons:
                    _ = result.product  # a road narrower than the footprint is refused before modes
    stages = on_root(comm, lambda: summary.data["stages"])
    _check_options(petsc_options, [k for k, stage in stages.items() if stage["status"] == "reused"])
    peak = largest_memory(comm)
    console.say(f"memory: {peak:.2g} GB of a process at most, {needed:.2g} GB estimated")
    if "report" in reasons:
        on_root(comm, lambda: summary.record("report", "skipped", reason=reasons["report"]))
    else:
        on_root(comm, lambda: _report(directory, summary))
    return Finished(job, done)


def _begun(job: Job, until: str | None) -> tuple[Summary, float, bool]:
    """The folder's summary, the memory (GB) a process needs, and whether factors go to disk.

    Raises InputError for a road file that cannot be used, before hours of solving, and if the
    machine has far too little memory or disk. Collective.
    """
    scene, directory, comm = job.scene, job.directory, job.comm
    on_root(comm, lambda: make_folder(directory))
    summary = on_root(comm, lambda: Summary(directory, scene.name, comm.size, dumps(scene)))
    if scene.road is not None and meets_road(until):
        share(scene.road.surface, comm)
        on_root(comm, lambda: check_road(scene))
    if scene.road is not None or scene.pattern is not None or scene.tire.section == "file":
        read = on_root(comm, lambda: files.read_of(scene, until))
        on_root(comm, lambda: summary.note_files(read))
        for line in files.table(read):
            console.say(line)
    demand = on_root(comm, lambda: estimate(scene, until))  # may read the road's file
    on_disk = on_root(comm, lambda: out_of_core(demand, comm.size))
    each = 1e-9 * sum(memory_of(demand, comm.size, on_disk).values()) / comm.size
    _say_demand(demand, each, directory, comm)
    on_root(comm, summary.begin)  # not before: a scene that is refused replaces nothing
    return summary, each, on_disk


def _made(kind: type[PipelinePart], job: Job, done, summary: Summary) -> Result | None:
    """The result of a part; None if it lacks an input, or has nothing to do after all. Collective."""
    part = kind.with_inputs(job, done)
    if isinstance(part, Stage) and (reason := part.idle()) is not None:
        return _skipped(type(part), job, done, reason, summary)
    return part.result(summary) if part else None


def _skipped(kind: type[Stage], job: Job, done, reason: str, summary: Summary) -> Result | None:
    """The result that later parts receive instead of a stage that is skipped for a `reason`. Collective."""
    console.say(f"{kind.name:9s} skipped: {reason}")
    on_root(job.comm, lambda: summary.record(kind.name, "skipped", reason=reason))
    return kind.if_skipped(job, done)


@contextmanager
def _factors(on_disk: bool, directory: Path, comm: MPI.Comm) -> Iterator[None]:
    """Within the context, factors are kept on disk if `on_disk`. Collective."""
    if not on_disk:
        yield
        return
    on_root(comm, lambda: make_folder(directory / FACTORS))
    with factors_on_disk(directory / FACTORS):
        yield
    on_root(comm, lambda: remove_factors(directory))


def _say_demand(demand: Estimate, each: float, directory: Path, comm: MPI.Comm) -> None:
    """Announce the estimated demand, `each` process in GB.

    Raises InputError if the machine has far too little. Collective.
    """
    for text in on_root(comm, lambda: check_demand(demand, directory, comm.size)):
        console.warn(text)
    console.say(
        f"estimated: {each:.2g} GB a process, "
        f"{sum(demand.disk.values()) / 1e9:.2g} GB of disk, "
        f"{duration(sum(demand.seconds.values()))} of one core"
    )


def _report(directory: Path, summary: Summary) -> None:
    """Write the report; its summary entry comes first, as the page lists it. Root process only."""
    from tireroad.runs.report.page import remarks, write_report

    began = time.perf_counter()
    summary.record("report", "computed")
    path = write_report(directory)
    seconds = time.perf_counter() - began
    summary.record("report", "computed", seconds=seconds)
    console.say(f"{'report':9s} done in {seconds:.1f} s: {path}")
    if strange := remarks(directory):
        console.warn(strange)


def _check_options(petsc_options: list[str], reused: Sequence[str] = ()) -> None:
    """Warn of options that PETSc never read: misspelt, or of a stage that was `reused`."""
    unused = [o for o in petsc_options if o.startswith("-") and not _was_read(o.lstrip("-"))]
    if unused:
        reused_text = f"; reused stages read none ({', '.join(reused)}): --fresh" if reused else ""
        console.warn(f"PETSc options that nothing read: {' '.join(unused)}{reused_text}")


def _was_read(name: str) -> bool:
    """Whether PETSc has read an option; petsc4py offers this from 3.19 on."""
    import ctypes

    from petsc4py import PETSc

    options = PETSc.Options()
    if hasattr(options, "used"):
        return options.used(name)
    found = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(found))
    return bool(found.value)
