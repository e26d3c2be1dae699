"""A job: one run of one scene, shared unchanged by all its stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

from tireroad.fem.axle import Axle
from tireroad.fem.model import TireModel
from tireroad.fem.static.state import StaticState
from tireroad.runs.files import store
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import Scene, axle_of
from tireroad.runs.stages.build.tire import make_tire

T = TypeVar("T")


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
