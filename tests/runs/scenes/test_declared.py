"""What a run declares: a stage reads no key that its hash lacks; every dataset has a meaning and a unit."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import fields
from pathlib import Path
from runpy import run_path
from typing import Any

import h5py
import pytest
from mpi4py import MPI
from scene_keys import KEYS

from tireroad.runs.pipeline import PARTS, run_scene
from tireroad.runs.results.datasets import declared
from tireroad.runs.scene.load import load
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.stage import Stage

ROLLING = """
[tire]
segments = 12
elements_arc = 4
[static]
load = 300.0
[modal]
count = 8
[rotation]
speed = 50.0
[contact]
[[force]]
amplitude = 0.0
[road]
kind = "two-slope"
run_in = 0.05
[time]
duration = 0.02
step = 2e-4
[stiffness]
steps = 1
up_to = 0.001
which = "vertical"
[output]
vibration = true
fields = true
[output.receptance]
to = 20.0
step = 10.0
[accuracy]
estimate = false
"""
FREE = {  # no result depends on them, or not by their own names
    "Scene.name",  # provenance
    "TimeTable.checkpoint",  # how often a loop is stored
    "GreensTable.residual",  # for the modes: whether their fields are kept for other runs
    "MotionTable.kind",  # likewise; for all others, which stages there are
    "AxleTable.kind",  # modes.h5 holds the rim's matrices for any axle; the axle is in the hash of its states
}
# Helpers that take a table whole, and what is written beside a result: the scene, as text.
WHOLE = ("dataclasses.py", "store.py")
TEXT = ("resolved.py", "schema.py")


class Reads:
    """Keys read while the inputs of each stage are formed, and while its product is made."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.hashed: dict[str, set[str]] = defaultdict(set)
        self.made: dict[str, set[str]] = defaultdict(set)
        self._into: list[tuple[set[str], bool]] = []
        for of in {of for _, of, _, _ in walk(Scene)}:
            self._watch(patch, of)
        for kind in PARTS:
            if issubclass(kind, Stage):
                self._follow(patch, kind, "inputs", self.hashed, whole=True)
                self._follow(patch, kind, "produce", self.made, whole=False)

    def _watch(self, patch: pytest.MonkeyPatch, of: type) -> None:
        names, plain = {item.name for item in fields(of)}, of.__getattribute__

        def reading(holder: Any, name: str) -> Any:
            if self._into and (name in names or name == "__dict__"):
                keys, whole = self._into[-1]
                file = sys._getframe(1).f_code.co_filename
                if not file.endswith(TEXT) and (whole or not file.endswith(WHOLE)):
                    keys.update(
                        f"{of.__name__}.{n}" for n in (names if name == "__dict__" else [name])
                    )
            return plain(holder, name)

        patch.setattr(of, "__getattribute__", reading, raising=False)

    def _follow(self, patch, kind, method: str, into: dict[str, set[str]], whole: bool) -> None:
        plain = getattr(kind, method)

        def followed(stage, *args: Any) -> Any:
            self._into.append((into[stage.name], whole))
            try:
                found = plain(stage, *args)
                if method == "inputs":
                    _visit(found)
                return found
            finally:
                self._into.pop()

        patch.setattr(kind, method, followed)


def _visit(value: Any) -> None:
    """Read what the hash will read: whole tables."""
    if isinstance(value, dict):
        for one in value.values():
            _visit(one)
    elif isinstance(value, list | tuple):
        for one in value:
            _visit(one)
    elif hasattr(value, "__dataclass_fields__"):
        for item in fields(value):
            _visit(getattr(value, item.name))


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Reads, Path]:
    folder = tmp_path_factory.mktemp("run")
    (folder / "scene.toml").write_text(ROLLING)
    scene = load(folder / "scene.toml")
    with pytest.MonkeyPatch.context() as patched:
        reads = Reads(patched)
        out = folder / "out"
        run_scene(scene, out, MPI.COMM_SELF, until="motion", fresh=True, petsc_options=[])
    return reads, out


@pytest.mark.slow
def test_a_stage_reads_what_its_hash_holds(run) -> None:
    reads, _ = run
    held: set[str] = set(FREE)
    lacking = {}
    for kind in PARTS:
        held |= reads.hashed[kind.name]
        if wrong := (reads.made[kind.name] & set(KEYS)) - held:
            lacking[kind.name] = sorted(wrong)
    assert len(reads.made) >= 9
    assert lacking == {}


@pytest.mark.slow
def test_every_dataset_is_declared_with_its_unit(run) -> None:
    """In runs.results.datasets, which docs/results.md and `tireroad info` show."""
    _, folder = run
    wrong, count = [], 0

    def check(file: str, name: str, dataset: h5py.Dataset) -> None:
        known = declared(file, name)
        if known is None:
            wrong.append(f"{file}: {name} is not declared")
        elif not known.unit.startswith("as "):  # of several kinds
            if dataset.attrs["unit"] not in known.unit.split(" or "):
                wrong.append(f"{file}: {name} has the unit {dataset.attrs['unit']}")
            if len(list(filter(None, known.shape.split(",")))) != dataset.ndim:
                wrong.append(f"{file}: {name} has the shape {dataset.shape}")

    for path in sorted(folder.glob("*.h5")):
        with h5py.File(path) as file:
            names: list[str] = []
            file.visit(names.append)
            for name in names:
                if isinstance(file[name], h5py.Dataset):
                    check(path.name, name, file[name])
                    count += 1
    assert count > 150 and wrong == []


def test_the_page_of_result_files_is_generated(root: Path) -> None:
    """After a change of datasets: ./tireroad python docs/result_files.py docs/results.md"""
    text = (root / "docs" / "results.md").read_text(encoding="utf-8")
    assert text == run_path(str(root / "docs" / "result_files.py"))["written"](text)
