"""Runs the scenes of the thesis in one folder; stages with the same inputs are computed once."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.folder import claimed
from tireroad.runs.pipeline import Finished, run_scene
from tireroad.runs.process import console, mpi
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import Scene

FOLDER = Path(__file__).parent / "scenes"
T = TypeVar("T")


@dataclass(frozen=True)
class Scenes:
    """Runs scenes of `tests/thesis/scenes` in `directory`/runs on the processes of `comm`.

    Stages are shared through a `cache`.
    """

    directory: Path
    comm: MPI.Comm
    cache: Cache = NO_CACHE
    _found: dict[str, Any] = field(default_factory=dict)

    def load(self, name: str, *settings: str) -> Scene:
        """The named scene with settings ("a.b=value") applied. Not collective."""
        return load(FOLDER / f"{name}.toml", settings)

    def run(self, name: str, *settings: str, until: str) -> Finished:
        """Run its stages up to `until`; returns the products in memory. Collective."""
        scene = self.load(name, *settings)
        folder = (
            self.directory / "runs" / re.sub(r"[^A-Za-z0-9._-]+", "-", "_".join([name, *settings]))
        )
        with ExitStack() as stack:
            mpi.on_root(
                self.comm, lambda: stack.enter_context(claimed(folder, scene.name)) and None
            )
            stack.enter_context(console.quiet())
            return run_scene(
                scene,
                folder,
                self.comm,
                until=until,
                fresh=False,
                petsc_options=[],
                cache=self.cache,
            )

    def once(self, name: str, make: Callable[[], T]) -> T:
        """An object that figures share: made on first use, kept in memory by name. Collective."""
        if name not in self._found:
            self._found[name] = make()
        return self._found[name]


def kept(run: Finished, stage: str, pick: Callable[[Any], T]) -> T:
    """The value of `pick(file)` for a stage's file, on every process. Collective."""
    return run.job.read(run.job.path(stage), pick)
