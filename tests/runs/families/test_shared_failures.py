"""A stage that fails in one member of a sweep is not computed again by the others."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.cache import NO_CACHE
from tireroad.runs.stages.failures import FAILURES
from tireroad.runs.stages.stage import Stage


class Folding:
    """A stage whose solver gives up; `tried` counts how often."""

    name = "static"
    result, solver = Stage.result, Stage.solver

    def __init__(self, folder: Path, scene: str, load: float, tried: list[str]) -> None:
        given = {"comm": MPI.COMM_SELF, "fresh": False, "cache": NO_CACHE}
        self.job = SimpleNamespace(
            scene=SimpleNamespace(name=scene), path=lambda name: folder / scene / name, **given
        )
        self.load, self.tried = load, tried

    def inputs(self):
        return {"load": self.load}

    def produce(self, key, record):
        self.tried.append(self.job.scene.name)
        raise ConvergenceError("static: it folds")


def messages(folder: Path, monkeypatch) -> tuple[list[str], list[str]]:
    """What three members say, the last of another load, and which of them tried."""
    tried: list[str] = []
    said = []
    for scene, load in (("one", 6e4), ("two", 6e4), ("three", 7e4)):
        with pytest.raises(ConvergenceError) as caught:
            Folding(folder, scene, load, tried).result()
        said.append(str(caught.value))
    return said, tried


def test_a_failure_is_told_to_the_members_with_the_same_inputs(tmp_path, monkeypatch) -> None:
    """Three members of one static state failed after two minutes each."""
    monkeypatch.setenv(FAILURES, str(tmp_path))
    said, tried = messages(tmp_path, monkeypatch)
    assert tried == ["one", "three"]
    assert said[0] == said[2] == "static: it folds"
    assert said[1].startswith("static: it folds (as in one, which failed first")


def test_a_run_by_itself_tries_again(tmp_path, monkeypatch) -> None:
    monkeypatch.delenv(FAILURES, raising=False)
    said, tried = messages(tmp_path, monkeypatch)
    assert tried == ["one", "two", "three"] and set(said) == {"static: it folds"}
