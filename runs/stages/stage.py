"""A stage: a function of typed inputs whose frozen product is written to a file and read back.

A product comes from its own file, from the shared cache, or is computed.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import cached_property, reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import collect
from tireroad.fem.model import TireModel
from tireroad.fem.static.state import StaticState
from tireroad.fem.timing import Timing
from tireroad.fem.wheel import Axle
from tireroad.runs.files import store
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.folder import Summary
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.surroundings import peak_memory
from tireroad.runs.scene.physics import make_tire
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import Scene, axle_of
from tireroad.runs.stages.failures import check_failures, remembered

if TYPE_CHECKING:
    pass

T = TypeVar("T")
MUMPS = "MUMPS through PETSc, ICNTL(14) = 100 %"

UNKNOWN = "unknown"  # what a figure or an error is that was not estimated

Figures = dict[str, tuple[Any, str]]
P = TypeVar("P")


@dataclass
class Record:
    """The record of a stage: figures as name: (value, unit), seconds by part, notes for the summary."""

    headline: Figures = field(default_factory=dict)
    indicators: Figures = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cost: Timing = field(default_factory=Timing)

    def tell(self, name: str, value: float, unit: str) -> None:
        """Add a figure to the headline, NaN as unknown."""
        known = np.isfinite(value)
        self.headline[name] = (float(value), unit) if known else (UNKNOWN, "-")

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


@dataclass(frozen=True)
class Job:
    """The scene, its result folder, and the processes that compute it.

    `fresh`: reuse nothing; `cache`: finished stages shared with other runs, by default none. `processes`: as many as
    compute the run, by default those of `comm`. `beside_loop`: work for processes that the contact loop leaves idle
    (runs.stages.contact); `ahead`: what this process found by it, by stage.
    """

    scene: Scene
    directory: Path
    comm: MPI.Comm
    fresh: bool = False
    cache: Cache = NO_CACHE
    found: dict[str, float] = field(default_factory=dict)
    processes: int = 0
    beside_loop: Callable[..., None] | None = None
    ahead: dict[str, Any] = field(default_factory=dict)

    def alone(self) -> Job:
        """The same for this process by itself; its files are those of the run on all processes."""
        return replace(self, comm=MPI.COMM_SELF, processes=self.processes or self.comm.size)

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
        return make_tire(self.comm, self.scene.tire, self.scene.temperature)

    def value(self, name: str) -> Any:
        """A table or key of the scene by its dotted name; None where a table on the way is absent."""
        return reduce(
            lambda holder, part: holder and getattr(holder, part), name.split("."), self.scene
        )

    def path(self, stage: str) -> Path:
        """The file of a stage."""
        return self.directory / f"{stage}.h5"

    def provenance(self, stage: str, key: str) -> store.Provenance:
        """Provenance of a stage's file; `key` is the hash of the stage's inputs."""
        return store.Provenance(
            self.scene.name, dumps(self.scene), stage, key, self.processes or self.comm.size
        )

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
        parts: dict[str, Any] = {}
        for item in fields(cls):
            if item.name == "job":
                continue
            if item.name in done:
                parts[item.name] = done[item.name]
            elif item.default is MISSING:
                return None
        return cls(job=job, **parts)


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

    reads: ClassVar[tuple[str, ...]] = ()
    """Tables and keys of the scene, dotted, that enter the hash whole."""

    def inputs(self) -> dict[str, Any]:
        """Everything the product depends on: the keys of the parts it takes, and what it `reads`. Collective.

        A stage that depends on less of a table, or on what is made of it, adds that.
        """
        parts = {item.name: getattr(self, item.name) for item in fields(self)}
        keys = {
            name: part.key for name, part in parts.items() if isinstance(part, Result) and part.key
        }
        return keys | {name: self.job.value(name) for name in self.reads}

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
            with remembered(name, key, job.scene.name, job.comm):
                product = self.produce(key, record)
            collect(job.comm)
            figures = vars(record).copy()
            on_root(job.comm, lambda: job.cache.keep(name, key, path, figures))
        if summary is not None:
            _tell_computed(self, key, record, time.perf_counter() - began, summary)
        return Result(key, lambda: product)

    def idle(self) -> str | None:
        """Why there is nothing to do, which only the parts before tell; None: there is. On every process."""
        return None

    @classmethod
    def if_skipped(cls, job: Job, done: Mapping[str, Result]) -> Result[P] | None:
        """The result that later parts receive if this stage is skipped; None: nothing."""
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
        """Prepare the computation of the product. Collective."""

    def end(self, key: str, product: P) -> None:
        """Clean up once the product is written. Collective."""


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
