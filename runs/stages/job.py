"""One run of one scene: what all its stages share, and none of them changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

from tireroad.fem.axle import Axle
from tireroad.fem.model import TireModel
from tireroad.runs.files import store
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.axle import axle_of
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.build.tire import make_tire

T = TypeVar("T")


@dataclass(frozen=True)
class Job:
    """The scene, where its results go, and the processes that compute them; `fresh`: reuse nothing."""

    scene: Scene
    directory: Path
    comm: MPI.Comm
    fresh: bool = False

    @property
    def speed(self) -> float:
        """Speed of rotation, rad/s; 0 when the wheel stands."""
        return self.scene.rotation.speed if self.scene.rotation else 0.0

    @cached_property
    def axle(self) -> Axle | None:
        """The wheel that moves; None where it is held."""
        return axle_of(self.scene)

    @cached_property
    def tire(self) -> TireModel:
        """The scene's tire without loads."""
        return make_tire(self.comm, self.scene.tire)

    def path(self, stage: str) -> Path:
        """The file of a stage."""
        return self.directory / f"{stage}.h5"

    def provenance(self, stage: str, key: str) -> store.Provenance:
        """Where a stage's file comes from; `key` is the hash of its inputs."""
        return store.Provenance(self.scene.name, dumps(self.scene), stage, key, self.comm.size)

    def write(self, path: Path, provenance: store.Provenance, fill: Callable[[Any], None]) -> None:
        """Write a file by `fill(file)` on the root process. Collective."""

        def write() -> None:
            with store.writing(path, provenance) as file:
                fill(file)

        on_root(self.comm, write)

    def read(self, path: Path, pick: Callable[[Any], T]) -> T:
        """What `pick(file)` returns, on every process. Collective."""

        def opened() -> T:
            with store.opened(path) as file:
                return pick(file)

        return on_root(self.comm, opened)
