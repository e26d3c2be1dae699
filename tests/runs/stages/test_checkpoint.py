"""A static state and modes that were stopped in their middle go on to the bits of a run that was not."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.timing import Timing
from tireroad.modal.solver.slicing import SOLVERS, SymmetricProblem
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process.signals import Stopped
from tireroad.runs.scene.load import load
from tireroad.runs.stages import checkpoint

ROUNDING = 0.0 if MPI.COMM_WORLD.size == 1 else 1e-9  # of factors on several processes, run by run
pytestmark = [pytest.mark.slow, pytest.mark.mpi]
COMM = MPI.COMM_WORLD
SLICES = SymmetricProblem.slices

SCENE = """
name = "stopped"
[tire]
segments = {segments}
elements_arc = 4
[tire.material]
youngs_modulus = 48e6
[static]
load = 300.0
error_estimate = false
[modal]
count = 12
[damping]
mass = {damping}
[rotation]
speed = 30.0
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.setattr(checkpoint, "LEAST", 1e9)  # only a stop writes
    return COMM.bcast(tmp_path)


def scene_of(folder: Path, segments: int = 12, damping: float = 0.0):
    path = folder / "scene.toml"
    if COMM.rank == 0:
        path.write_text(SCENE.format(segments=segments, damping=damping))
    COMM.Barrier()
    return load(path)


def run(scene, directory: Path, until: str) -> None:
    if COMM.rank == 0:
        directory.mkdir(exist_ok=True)
    COMM.Barrier()
    run_scene(scene, directory, COMM, until=until, fresh=False, petsc_options=[])


def stopped(monkeypatch, scene, directory: Path, until: str, after: int) -> None:
    """Run, and stop as by a signal once this process has so many results; a stop writes them."""
    keep = checkpoint._Parts.keep

    def keep_and_stop(parts, number: int, entry) -> None:
        keep(parts, number, entry)
        if number + 1 == after:
            raise Stopped("SIGTERM")

    with monkeypatch.context() as patch, pytest.raises(Stopped):
        patch.setattr(checkpoint._Parts, "keep", keep_and_stop)
        run(scene, directory, until)
    COMM.Barrier()


def counted(monkeypatch, owner, name: str) -> list[int]:
    """One item for each call of a function from now on."""
    calls, inner = [], getattr(owner, name)

    def call(*given):
        calls.append(1)
        return inner(*given)

    monkeypatch.setattr(owner, name, call)
    return calls


def assert_same(one: Path, other: Path, rounding: float = 0.0) -> None:
    """To the last bit, or but for `rounding` of the largest number of a dataset, of residuals of 1. Collective."""
    assert COMM.bcast(_apart(one, other, rounding) if COMM.rank == 0 else None) == []


def _apart(one: Path, other: Path, rounding: float) -> list[str]:
    wrong, names = [], []
    with h5py.File(one) as first, h5py.File(other) as second:
        first.visit(names.append)
        for name in names:
            if isinstance(first[name], h5py.Dataset):
                wanted, found = first[name][()], second[name][()]
                if not np.issubdtype(np.asarray(wanted).dtype, np.number):  # names
                    same = np.array_equal(found, wanted)
                else:
                    scale = 1.0 if name == "residual" else np.abs(wanted).max()
                    same = np.abs(found - wanted).max() <= rounding * scale
                if not same:
                    wrong.append(name)
    return wrong


def sliced_and_stopped(of: SymmetricProblem, boundaries) -> None:
    SLICES(of, boundaries)
    raise Stopped("SIGTERM")


def parts(directory: Path, stage: str) -> list[Path]:
    return sorted((directory / f"{stage}_checkpoint").glob("*.h5"))


# By half of the ring, whole with an odd number of segments, and with a tangent that is not symmetric.
@pytest.mark.parametrize(
    "segments, damping",
    [
        (12, 0.0),
        pytest.param(13, 0.0, marks=pytest.mark.long),
        pytest.param(12, 200.0, marks=pytest.mark.long),
    ],
)
def test_static(folder: Path, monkeypatch, capsys, segments: int, damping: float) -> None:
    scene = scene_of(folder, segments, damping)
    solved = counted(monkeypatch, Equilibrium, "_solve")
    run(scene, folder / "whole", "static")
    whole = len(solved)
    after = whole - 2
    stopped(monkeypatch, scene, folder / "broken", "static", after)
    assert len(parts(folder / "broken", "static")) == COMM.size
    solved.clear()
    capsys.readouterr()
    run(scene, folder / "broken", "static")
    assert len(solved) < whole - after + 3  # the last of each problem is solved again
    if COMM.rank == 0:
        assert f"continues from the checkpoint after {after} solution(s)" in capsys.readouterr().out
    assert_same(folder / "whole" / "static.h5", folder / "broken" / "static.h5", ROUNDING)
    assert not (folder / "broken" / "static_checkpoint").exists()


def test_modes(folder: Path, monkeypatch) -> None:
    scene = scene_of(folder)
    run(scene, folder / "whole", "static")
    if COMM.rank == 0:
        (folder / "broken").mkdir()
        (folder / "broken" / "static.h5").write_bytes((folder / "whole" / "static.h5").read_bytes())
    sliced: list[str] = []
    for name, solver in SOLVERS.items():
        monkeypatch.setitem(
            SOLVERS,
            name,
            lambda *given, name=name, solver=solver: sliced.append(name) or solver(*given),
        )
    run(scene, folder / "whole", "modes")
    whole = len(sliced)
    if COMM.size == 1:
        stopped(monkeypatch, scene, folder / "broken", "modes", 4)
    else:  # all processes at once: one that has no slice would wait for the others
        with monkeypatch.context() as patch, pytest.raises(Stopped):
            patch.setattr(SymmetricProblem, "slices", sliced_and_stopped)
            run(scene, folder / "broken", "modes")
        COMM.Barrier()
    assert parts(folder / "broken", "modes")
    done = len(sliced) - whole
    sliced.clear()
    run(scene, folder / "broken", "modes")
    assert done > 0 and len(sliced) == whole - done
    assert_same(folder / "whole" / "modes.h5", folder / "broken" / "modes.h5", ROUNDING)
    assert not (folder / "broken" / "modes_checkpoint").exists()


def test_what_is_damaged_is_not_taken(folder: Path, monkeypatch, capsys) -> None:
    scene = scene_of(folder)
    run(scene, folder / "whole", "static")
    stopped(monkeypatch, scene, folder / "broken", "static", 3)
    if COMM.rank == 0:
        last = parts(folder / "broken", "static")[-1]  # another process's, where there is one
        data = bytearray(last.read_bytes())
        data[len(data) // 2] ^= 1
        last.write_bytes(data)
    COMM.Barrier()
    capsys.readouterr()
    run(scene, folder / "broken", "static")
    if COMM.rank == 0:
        said = capsys.readouterr().out
        assert "static_checkpoint exists, but it is damaged" in said and "continues" not in said
    assert_same(folder / "whole" / "static.h5", folder / "broken" / "static.h5", ROUNDING)


@pytest.mark.long
def test_results_are_written_when_that_is_worth_it(folder: Path, monkeypatch) -> None:
    """A part begins with the first result that was not written before; other inputs take none of them."""
    monkeypatch.setattr(checkpoint, "LEAST", 0.0)
    monkeypatch.setattr(checkpoint, "WORTH", 0.0)
    scene = scene_of(folder)
    stopped(monkeypatch, scene, folder / "broken", "static", 3)
    assert len(parts(folder / "broken", "static")) == 3 * COMM.size
    solved = counted(monkeypatch, Equilibrium, "_solve")
    other = scene_of(folder, damping=1.0)
    run(other, folder / "broken", "static")
    changed = len(solved)
    run(other, folder / "whole", "static")
    assert changed == len(solved) - changed


def test_what_has_no_bytes_tells_nothing_of_the_disk(tmp_path: Path, monkeypatch) -> None:
    """A process that had no part of a slice has a result of no bytes, and others after it."""
    written = []
    monkeypatch.setattr(checkpoint, "LEAST", 0.0)
    monkeypatch.setattr(checkpoint._Parts, "flush", lambda self: written.append(len(self._waiting)))
    kept = checkpoint._Parts(SimpleNamespace(directory=tmp_path), "modes", "key")
    for number in range(3):
        kept.keep(number, {"vectors": np.zeros((0, 4))})
    assert written == [1, 2, 3]


def test_between_two_speeds(folder: Path, monkeypatch, capsys) -> None:
    """At a travel speed the wheel's speed is found in turns. Each was solved from zero; now it goes on
    from the last one's state, also after a stop between them, and its cost counts."""
    scene = scene_of(folder, damping=200.0)
    scene = replace(scene, rotation=replace(scene.rotation, travel_speed=9.0))
    solved = counted(monkeypatch, Equilibrium, "_solve")
    assembled = [counted(monkeypatch, Equilibrium, name) for name in ("_error", "_take_tangent")]
    with monkeypatch.context() as patch:
        patch.setattr(Timing, "clock", itertools.count().__next__)  # every part takes a second
        run(scene, folder / "whole", "static")
    if COMM.rank == 0:
        first, *further = capsys.readouterr().out.split("again at")
        told = re.compile(r"(\d+) Newton steps")
        assert len(told.findall(first)) > 2 and len(further) >= 2
        assert {len(told.findall(text)) for text in further} == {2}, "inflated, and pressed"
        stage = json.loads((folder / "whole" / "summary.json").read_text())["stages"]["static"]
        every = sum(int(steps) for text in (first, *further) for steps in told.findall(text))
        assert stage["indicators"]["Newton steps"]["value"] == every
        assert stage["cost"]["assembly"] == sum(map(len, assembled))
    whole = len(solved)
    stopped(monkeypatch, scene, folder / "broken", "static", whole - 2)  # one turn is left
    solved.clear()
    run(scene, folder / "broken", "static")
    assert len(solved) < whole
    assert_same(folder / "whole" / "static.h5", folder / "broken" / "static.h5", ROUNDING)
