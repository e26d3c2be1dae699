"""A stage reads no key of the scene that its hash, or that of a stage before it, lacks."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI
from scene_keys import KEYS

from tireroad.runs.pipeline import PARTS, run_scene
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


@pytest.mark.slow
def test_a_stage_reads_what_its_hash_holds(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "scene.toml").write_text(ROLLING)
    scene = load(tmp_path / "scene.toml")
    with monkeypatch.context() as patched:
        reads = Reads(patched)
        run_scene(
            scene, tmp_path / "out", MPI.COMM_SELF, until="motion", fresh=True, petsc_options=[]
        )
    held: set[str] = set(FREE)
    lacking = {}
    for kind in PARTS:
        held |= reads.hashed[kind.name]
        if wrong := (reads.made[kind.name] & set(KEYS)) - held:
            lacking[kind.name] = sorted(wrong)
    assert len(reads.made) >= 9
    assert lacking == {}
