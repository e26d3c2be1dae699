"""A stage: a function of typed inputs whose frozen product is written to a file and read back.

A product comes from its own file, from the shared cache, or is computed. Matrices can be held in
memory for a family's next run with the same static state.

Checkpoints: in the stages static and modes each process stores its own results, part by part, in
`<stage>_checkpoint/<rank>of<size>-<number>.h5`, where `number` is that of the part's first result.
Parts carry a checksum and the key of the stage's inputs; reading ends at the first part that is
absent, damaged or of other inputs.

Failures are entered in the summary. Members of a sweep that share a stage do not repeat its
failure: the environment variable TIREROAD_FAILURES names a folder with a file for each stage that
has failed, by its name and the hash of its inputs. A sweep on this machine gives its workers an
empty one. Without it nothing is remembered: a run by itself may be tried again.
"""

from __future__ import annotations

import math
import os
import shutil
import time
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import MISSING, dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import collect
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.model import TireModel
from tireroad.fem.static.checkpoint import Entry, Journal
from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.road import RoadShape
from tireroad.fem.static.state import StaticState
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body
from tireroad.fem.wheel import Axle, Turning
from tireroad.modal.damping import Damping, Proportional, StrainEnergy
from tireroad.runs.files import store
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import Summary
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.signals import Stopped
from tireroad.runs.process.surroundings import peak_memory
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import Scene, axle_of

if TYPE_CHECKING:
    from tireroad.fem.sections.mesh2d import Ring
    from tireroad.runs.scene.tables.tire import TireTable

T = TypeVar("T")
MUMPS = "MUMPS through PETSc, ICNTL(14) = 100 %"

Figures = dict[str, tuple[Any, str]]
P = TypeVar("P")
MOST = 2  # per kind: those of a run and of its coarser companion
_kept: dict[str, OrderedDict[Hashable, Any]] | None = None
WORTH = 60.0  # results are written once computing them has taken this many times the writing
LEAST = 1.0  # s of computing
_COLUMNS = "by_columns"
_RATE = 2e8  # bytes per second, until a large part has been written
_LARGE = 1e6  # bytes from which the write rate is measured: below, opening the file dominates
FAILURES = "TIREROAD_FAILURES"


@dataclass
class Record:
    """The record of a stage: figures as name: (value, unit), seconds by part, notes for the summary."""

    headline: Figures = field(default_factory=dict)
    indicators: Figures = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cost: Timing = field(default_factory=Timing)

    def line(self) -> str:
        """The headline figures in one line."""
        return ", ".join(
            f"{name} {_shown(v)} {unit}".rstrip(" -") for name, (v, unit) in self.headline.items()
        )

    def timing(self, part: str) -> AbstractContextManager[None]:
        """Add the seconds spent inside the context to a part of the stage's cost."""
        return self.cost(part)

    @property
    def shares(self) -> str:
        """Seconds of each part, the largest first."""
        total = sum(self.cost.values()) or 1.0
        parts = sorted(self.cost.items(), key=lambda part: -part[1])
        return "time: " + ", ".join(f"{k} {v:.2g} s ({v / total:.0%})" for k, v in parts)


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def make_tire(comm: MPI.Comm, tire: TireTable):
    """The tire without loads; its finite elements are made on first use."""
    section = tire.ring()
    return TireModel(section, lambda: make_body(comm, tire, section))


def road_shape(scene: Scene) -> RoadShape:
    """The road's shape under the tire: the wheel's camber, and the drum if there is one."""
    drum = scene.road.drum_radius if scene.road else None
    return RoadShape(
        camber=math.radians(scene.static.camber),
        drum_radius=drum,
        inside=drum is not None and scene.road.drum == "inside",
    )


def make_body(comm: MPI.Comm, tire: TireTable, section: Ring) -> Body:
    """The finite-element body, undeformed. Collective."""
    return Body(comm, section, tire.shape.in_layers(tire), cords=tire.shape.cords(tire))


@dataclass(frozen=True)
class Job:
    """The scene, its result folder, and the processes that compute it.

    `fresh`: reuse nothing; `cache`: finished stages shared with other runs, by default none.
    """

    scene: Scene
    directory: Path
    comm: MPI.Comm
    fresh: bool = False
    cache: Cache = NO_CACHE
    found: dict[str, float] = field(default_factory=dict)

    @property
    def speed(self) -> float:
        """Speed of rotation, rad/s; 0 for a wheel at rest.

        For a scene with a travel speed it is a first guess until the static state gives the rolling
        radius.
        """
        if "speed" in self.found:
            return self.found["speed"]
        return self.scene.rotation.speed if self.scene.rotation else 0.0

    def free_speed(self, state: StaticState) -> float:
        """Speed (rad/s) of a wheel with this rolling radius, rolling freely at the travel speed.

        The job's own speed if the scene has no travel speed.
        """
        rotation = self.scene.rotation
        if rotation is None or rotation.travel_speed is None:
            return self.speed
        return rotation.travel_speed / (rotation.rolling_radius or state.rolling_radius())

    def settle(self, done: Mapping[str, Any]) -> None:
        """At a travel speed, adopt the static state's wheel speed once it is `done`. Collective."""
        rotation = self.scene.rotation
        if rotation is None or not rotation.travel_speed or self.found or "static" not in done:
            return
        state = done["static"].product
        self.found["speed"] = state.rolling.speed or self.free_speed(state)

    @cached_property
    def axle(self) -> Axle | None:
        """The moving wheel; None if the axle is held."""
        return axle_of(self.scene)

    @cached_property
    def tire(self) -> TireModel:
        """The scene's tire, unloaded."""
        return make_tire(self.comm, self.scene.tire)

    def path(self, stage: str) -> Path:
        """The file of a stage."""
        return self.directory / f"{stage}.h5"

    def provenance(self, stage: str, key: str) -> store.Provenance:
        """Provenance of a stage's file; `key` is the hash of the stage's inputs."""
        return store.Provenance(self.scene.name, dumps(self.scene), stage, key, self.comm.size)

    def write(self, path: Path, provenance: store.Provenance, fill: Callable[[Any], None]) -> None:
        """Write a file with `fill(file)` on the root process. Collective."""

        def write() -> None:
            with store.writing(path, provenance) as file:
                fill(file)

        on_root(self.comm, write)

    def read(self, path: Path, pick: Callable[[Any], T]) -> T:
        """The value of `pick(file)`, on every process. Collective."""

        def opened() -> T:
            with store.opened(path) as file:
                return pick(file)

        return on_root(self.comm, opened)


class Result(Generic[P]):
    """A product with the `key` (hash) of all its inputs; the key is "" if the product has no file.

    It is computed or read on first use, so that an unused product is never read. That use is
    collective.
    """

    def __init__(self, key: str, make: Callable[[], P]) -> None:
        self.key, self._make = key, make

    @cached_property
    def product(self) -> P:
        """The product itself."""
        return self._make()


@dataclass(frozen=True, kw_only=True)
class PipelinePart(ABC, Generic[P]):
    """A part of the pipeline. Apart from `job`, its fields are the parts it takes, by name."""

    name: ClassVar[str]
    job: Job

    @abstractmethod
    def result(self, summary: Summary | None = None) -> Result[P]:
        """The part's product and its key; with a `summary`, its cost is reported. Collective."""

    @classmethod
    def with_inputs(cls, job: Job, done: Mapping[str, Result]) -> PipelinePart | None:
        """The part with its inputs from `done`; None if a required input is missing."""
        given: dict[str, Any] = {}
        for item in fields(cls):
            if item.name == "job":
                continue
            if item.name in done:
                given[item.name] = done[item.name]
            elif item.default is MISSING:
                return None
        return cls(job=job, **given)


class Shared(PipelinePart[P]):
    """A part used by several stages, made on first use and not stored in a file."""

    @abstractmethod
    def make(self) -> P:
        """The product. Collective where its parts are."""

    def result(self, summary: Summary | None = None) -> Result[P]:
        """The product, made on first use."""
        return Result("", self.make)


class Stage(PipelinePart[P]):
    """A part whose product is stored in `<name>.h5` and reused while its inputs are unchanged."""

    @abstractmethod
    def inputs(self) -> Mapping[str, Any]:
        """Everything the product depends on, including the keys of other products. Collective."""

    @abstractmethod
    def produce(self, key: str, record: Record) -> P:
        """Make the product and write its file; figures go into the record. Collective."""

    @abstractmethod
    def read(self, file: Any) -> Any:
        """The content of the product's file. Root process only."""

    def restored(self, held: Any) -> P:
        """The product from its file's content, by default that content. On every process."""
        return held

    def solver(self) -> str:
        """One line for the log about the solvers used; "" if there are none.

        Options given after `--` are logged where they are taken and change those of their prefix.
        """
        return ""

    def stored(self) -> P:
        """The product as stored in its file. Collective."""
        return self.restored(self.job.read(self.job.path(self.name), self.read))

    def result(self, summary: Summary | None = None) -> Result[P]:
        """Reuse the product from its folder or the shared cache, or compute it. Collective."""
        job, name, began = self.job, self.name, time.perf_counter()
        key, path = store.wanted_hash(name, self.inputs()), job.path(name)
        with ExitStack() as claim:
            reason, source, known = on_root(job.comm, lambda: _looked_up(self, key, claim))
            if not reason:
                if summary is not None:
                    _tell_reused(self, key, source, known, summary)
                return Result(key, self.stored)
            if reason != "absent":
                console.say(f"{name:9s} computed anew: {path.name} exists, but {reason}")
            if solver := self.solver():
                console.log(f"{name:9s} solver: {solver}")
            record = Record()
            with _remembering(self, key):
                product = self.produce(key, record)
            collect(job.comm)
            figures = vars(record).copy()
            on_root(job.comm, lambda: job.cache.keep(name, key, path, figures))
        if summary is not None:
            _tell_computed(self, key, record, time.perf_counter() - began, summary)
        return Result(key, lambda: product)

    @classmethod
    def if_skipped(cls, job: Job, done: Mapping[str, Result]) -> Result[P] | None:
        """What later parts receive if this stage is skipped; None: nothing."""
        return None


class Computed(Stage[P]):
    """A stage whose product is first computed, then written.

    `kind`: class of the product, whose fields say how they are stored (runs.files.store.dataset), unless
    the stage writes and reads it by itself.
    """

    kind: ClassVar[type]

    @abstractmethod
    def compute(self, record: Record) -> P:
        """Compute the product; figures go into the record. Collective."""

    def write(self, file: Any, product: P) -> None:
        """Write the product into an empty file. Root process only."""
        store.write_fields(file, product)

    def read(self, file: Any) -> Any:
        """The product's fields, read back."""
        return self.kind(**store.read_fields(file, self.kind))

    def produce(self, key: str, record: Record) -> P:
        """Compute the product and write its file. Collective."""
        self.begin()
        product = self.compute(record)
        provenance = self.job.provenance(self.name, key)
        self.job.write(self.job.path(self.name), provenance, lambda file: self.write(file, product))
        self.end(key, product)
        return product

    def begin(self) -> None:
        """What has to happen before the product is computed. Collective."""

    def end(self, key: str, product: P) -> None:
        """What has to happen once the product is written. Collective."""


def keep_matrices() -> None:
    """Start keeping: this process computes the members of a family one after the other."""
    global _kept
    _kept = {}


def memoize(kind: str, key: Hashable, make: Callable[[], T]) -> T:
    """The value of `make`, or that of an earlier run with the same key. Collective if `make` is."""
    if _kept is None:
        return make()
    known = _kept.setdefault(kind, OrderedDict())
    if key not in known:
        while len(known) >= MOST:  # freed before the new ones need the memory
            known.popitem(last=False)
        known[key] = make()
    known.move_to_end(key)
    return known[key]


def forget_matrices() -> None:
    """Drop everything, before a new static state: matrices belong to one state."""
    if _kept is not None:
        _kept.clear()


@contextmanager
def checkpointed(stage: Stage, what: str) -> Iterator[Journal]:
    """The journal of a stage, of results named `what`; a stop writes them. Collective."""
    job = stage.job
    parts = _Parts(job, stage.name, store.wanted_hash(stage.name, stage.inputs()))
    found = parts.read()
    journal = Journal(found, parts.keep)
    least = min(job.comm.allgather(len(found)))
    if least:
        console.say(f"  continues from the checkpoint after {least} {what}")
    try:
        yield journal
    except Stopped:
        parts.flush()
        raise


def forget_checkpoint(job: Job, stage: str) -> None:
    """Remove the checkpoint of a finished stage. Collective."""
    job.comm.Barrier()
    on_root(job.comm, lambda: shutil.rmtree(_folder(job, stage), ignore_errors=True))


def _folder(job: Job, stage: str) -> Path:
    return job.directory / f"{stage}_checkpoint"


class _Parts:
    """The checkpoint files of this process."""

    def __init__(self, job: Job, stage: str, key: str) -> None:
        self._job, self._stage, self._key = job, stage, key
        self._folder = _folder(job, stage)
        self._waiting: list[Entry] = []
        self._first, self._written = 0, time.monotonic()
        self._rate = _RATE

    def _path(self, number: int) -> Path:
        comm = self._job.comm
        return self._folder / f"{comm.rank}of{comm.size}-{number:04d}.h5"

    def read(self) -> list[Entry]:
        """Results stored for the same inputs and process count; reports others. Collective."""
        found: list[Entry] = []
        reason = "" if self._job.fresh else self._read(found)
        reasons = [one for one in self._job.comm.allgather(reason) if one not in ("", "absent")]
        if reasons:
            console.say(f"  {self._folder.name} exists, but {reasons[0]}: only part of it is used")
        return found

    def _read(self, found: list[Entry]) -> str:
        """Append the usable parts to `found`; returns why the next one is not."""
        wanted = self._job.provenance(self._stage, self._key).input_hash
        while not (reason := store.why_not(self._path(len(found)), wanted, self._stage)):
            with store.opened(self._path(len(found))) as file:
                found += [_entry(file[name]) for name in sorted(file)]
        return reason

    def keep(self, number: int, entry: Entry) -> None:
        """Store a result; it is written with those before it once that pays off."""
        if not self._waiting:
            self._first = number
        self._waiting.append(entry)
        size = sum(array.nbytes for one in self._waiting for array in one.values())
        if time.monotonic() - self._written > max(LEAST, WORTH * size / self._rate):
            began = time.monotonic()
            self.flush()
            if size > _LARGE:
                self._rate = size / max(time.monotonic() - began, 1e-3)

    def flush(self) -> None:
        """Write the results that are waiting."""
        if not self._waiting:
            return
        provenance = self._job.provenance(self._stage, self._key)
        # If the result folder was removed, writing the file reports it.
        with suppress(FileNotFoundError):
            self._folder.mkdir(exist_ok=True)
        with store.writing(self._path(self._first), provenance) as file:
            for k, entry in enumerate(self._waiting):
                group = file.create_group(f"{k:04d}")
                for name, array in entry.items():
                    by_columns = array.flags.f_contiguous and not array.flags.c_contiguous
                    group[name] = array.T if by_columns else array
                    group[name].attrs[_COLUMNS] = by_columns
        self._waiting, self._written = [], time.monotonic()


def _entry(group) -> Entry:
    """The arrays of a result by name, including groups.

    Their memory order is restored, because the rounding of sums of products depends on it.
    """
    found: dict[str, np.ndarray] = {}

    def add(name: str, one) -> None:
        if hasattr(one, "shape"):
            array = np.asarray(one[()])
            found[name] = array.T if one.attrs[_COLUMNS] else array

    group.visititems(add)
    return found


def damping_of(job: Job) -> Damping:
    """Proportional damping if the scene has it, else modal strain energy (loss factors)."""
    given = job.scene.damping
    return StrainEnergy() if given is None else Proportional(given.mass, given.stiffness)


def rolling_shape(turning: Turning) -> Rolling:
    """Steady rolling, for the static state, of a wheel that turns so; at rest for speed 0."""
    if turning.speed == 0:
        return AT_REST
    # Strain-energy damping needs modes, which come later: the shape then has inertia forces alone.
    mass, stiffness = (0.0, 0.0) if isinstance(turning.damping, StrainEnergy) else turning.damping
    return Rolling(
        speed=turning.speed, damping=mass, stiffness_damping=stiffness, inertia=turning.inertia
    )


def wheel_slip(scene: Scene) -> tuple[float, float]:
    """The scene's slip of the wheel (s_x, s_y), including its slip angle."""
    along, across = scene.contact.slip if scene.contact else (0.0, 0.0)
    angle = scene.rotation.slip_angle if scene.rotation else 0.0
    return along, across + math.tan(math.radians(angle))


def friction_of(scene: Scene, rolling: Rolling) -> Friction | None:
    """Friction of the static state that rolls so; None if the scene has none."""
    static, rotation = scene.static, scene.rotation
    if static.friction is None:
        return None
    if not rolling.speed or rotation is None:
        return Friction(coefficient=static.friction, steps=static.friction_steps)
    return Friction(
        coefficient=static.friction, radius=rotation.rolling_radius, slip=wheel_slip(scene)
    )


def turning_of(job: Job) -> Turning:
    """The scene's speed, damping and inertia."""
    rotation = job.scene.rotation
    if not job.speed or rotation is None:
        return Turning(speed=job.speed, damping=damping_of(job))
    return Turning(
        speed=job.speed,
        damping=damping_of(job),
        inertia=rotation.inertia,
        shape_tolerance=rotation.shape_tolerance,
    )


def shapes_of(job: Job) -> Turning | None:
    """The wheel's rotation if rotation shapes join its modes (modal.rotation_shapes), else None."""
    return turning_of(job) if job.speed and job.scene.joins_shapes else None


@contextmanager
def failure_recorded(stage: str, summary: Summary, comm: MPI.Comm) -> Iterator[None]:
    """Within the context, an error or a stop is entered in the summary by the root process."""
    try:
        yield
    except BaseException as error:
        if comm.rank == 0:
            stopped = isinstance(error, Stopped)
            told = f"stopped by {error}: resume continues" if stopped else str(error) or repr(error)
            with suppress(Exception):  # of the first error, whatever else goes wrong
                summary.end(stage, told)
        raise


def record_failure(stage: str, key: str, run: str, error: ConvergenceError) -> None:
    """Keep why the stage of a `run` failed, if failures are kept. Root process only."""
    if (file := _file(stage, key)) and not file.exists():
        with suppress(OSError):
            write_text(file, f"{error} (as in {run}, which failed first and has the same inputs)")


def check_failures(stage: str, key: str) -> None:
    """Raise ConvergenceError if the stage has failed on these inputs. Root process only."""
    file = _file(stage, key)
    if file and file.exists():
        raise ConvergenceError(file.read_text(encoding="utf-8"))


def _file(stage: str, key: str) -> Path | None:
    folder = os.environ.get(FAILURES)
    return Path(folder) / f"{stage}-{key}.txt" if folder else None


def _tell_reused(
    stage: Stage, key: str, source: str, known: Mapping[str, Any], summary: Summary
) -> None:
    """Report that a product was computed before, and by which run. Collective."""
    console.say(f"{stage.name:9s} reused: computed from the same inputs {source}")
    figures = {"reason": "same inputs", "input_hash": key, **known}
    on_root(stage.job.comm, lambda: summary.record(stage.name, "reused", **figures))


def _tell_computed(
    stage: Stage, key: str, record: Record, seconds: float, summary: Summary
) -> None:
    """Report a computed product's figures and what it cost. Collective."""
    comm, name = stage.job.comm, stage.name
    record.indicators["largest memory of a process so far"] = (largest_memory(comm), "GB")
    for text in record.warnings:
        console.warn(f"{name}: {text}")
    console.say(f"{name:9s} done in {seconds:.1f} s: {record.line()}")
    figures = {"input_hash": key, **vars(record)}
    on_root(comm, lambda: summary.record(name, "computed", seconds=seconds, **figures))


def largest_memory(comm: MPI.Comm) -> float:
    """Largest resident memory of any process since its start (forget_peak), GB. Collective."""
    return 1e-9 * comm.allreduce(peak_memory(), MPI.MAX)


@contextmanager
def _remembering(stage: Stage, key: str) -> Iterator[None]:
    """A failure within is remembered for the other members of a sweep."""
    try:
        yield
    except ConvergenceError as error:
        if stage.job.comm.rank == 0:  # not on_root: other processes need not have failed
            record_failure(stage.name, key, stage.job.scene.name, error)
        raise


def _looked_up(stage: Stage, key: str, claim: ExitStack) -> tuple[str, str, dict[str, Any]]:
    """Look for a stored product.

    Returns why the stage has to be computed ("" if not), by which run the product was computed, and
    the figures that this folder's summary lacks. A stage to be computed is claimed: another run
    that needs it waits until it is in the cache. Raises ConvergenceError if another member of the
    sweep failed to compute it. Root process only.
    """
    job, name = stage.job, stage.name
    if job.fresh:
        return "absent", "", {}
    path = job.path(name)
    reason = store.why_not(path, key, name)
    if not reason:
        return "", "before", {}
    claim.enter_context(job.cache.claimed(name, key))
    figures = job.cache.fetch(name, key, path)
    if figures is None:
        check_failures(name, key)
        return reason, "", {}
    return "", "by another run", figures
