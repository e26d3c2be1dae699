"""The processes that compute a sweep's members one after the other."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from tireroad.runs.sweep import command
from tireroad.runs.sweep.definition import Member

STAND_IN = """
import json, os, pathlib, signal, sys
(pathlib.Path(sys.argv[1]) / str(os.getpid())).touch()
for line in sys.stdin:
    told = json.loads(line)
    name = pathlib.Path(told["log"]).stem
    pathlib.Path(told["log"]).write_text(f"first\\nthis was {name}\\n")
    if name == "crashes":
        os.kill(os.getpid(), signal.SIGSEGV)
    part = pathlib.Path(told["status"] + ".part")
    part.write_text("3" if name == "fails" else "0")
    part.rename(told["status"])
"""


@pytest.mark.parametrize("at_a_time", [1, 2])
def test_a_worker_takes_members_until_it_crashes(tmp_path, monkeypatch, at_a_time: int) -> None:
    script, began = tmp_path / "stand_in.py", tmp_path / "began"
    script.write_text(STAND_IN)
    began.mkdir()
    monkeypatch.setattr(
        command, "_program", lambda sweep, *_: [sys.executable, str(script), str(began)]
    )
    monkeypatch.setattr(command, "_LOOK", 0.02)
    names = "one", "fails", "crashes", "last"
    members = tuple(Member(name, {}) for name in names)
    sweep = SimpleNamespace(members=members, processes=1, scene=Path("base.toml"))
    ended = command.run_members(sweep, tmp_path, at_a_time)
    assert [one.member.name for one in ended] == list(names)
    assert [one.status for one in ended] == [0, 3, -11, 0]
    assert ended[1].said == "this was fails" and "a bug" in ended[2].line
    assert len(list(began.iterdir())) <= at_a_time + 1
    assert not list((tmp_path / "logs").glob("*.status"))
