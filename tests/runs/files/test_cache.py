"""Stages that runs share: of another road, in the user's cache, bounded, listed and cleared."""

import os
from pathlib import Path

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.runs.cli import main
from tireroad.runs.files import cache as shared
from tireroad.runs.files.cache import Cache
from tireroad.runs.files.disk import Refused
from tireroad.runs.stages import accuracy

SCENE = (
    soft_torus(8, 4, order=2)
    + """[static]
load = 300.0
[modal]
count = 8
[rotation]
speed = 50.0
[contact]
[road]
[time]
duration = 0.004
step = 2e-4
[accuracy]
estimate = false
"""
)


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user whose cache of stages is empty; compiled forms stay where they are."""
    monkeypatch.delenv("TIREROAD_CACHE")
    monkeypatch.setattr(shared, "user_folder", lambda: tmp_path / "cache")
    return tmp_path


def run(folder: Path, name: str, *overrides: str, up_to: str = "contact") -> str:
    """The log of a run into folder/name, up to a stage."""
    (folder / "scene.toml").write_text(SCENE)
    changed = [part for one in overrides for part in ("--set", one)]
    out = folder / name
    assert (
        main(["run", str(folder / "scene.toml"), "--out", str(out), "--until", up_to, *changed])
        == 0
    )
    return (out / "log.txt").read_text()


@pytest.mark.slow
def test_another_road_takes_what_the_first_found(home: Path, capsys) -> None:
    first = run(home, "one", "road.kind=flat")
    assert "reused" not in first
    second = run(home, "two", "road.kind=sine", "road.amplitude=1e-4")
    for stage in ("static", "modes", "rotating"):
        assert f"{stage:9s} reused: computed from the same inputs by another run" in second
    assert "contact   done" in second
    kept = {one.stage for one in Cache.of_user().entries()}
    assert {"static", "modes", "rotating"} <= kept and "contact" not in kept
    with h5py.File(home / "one" / "modes.h5") as one, h5py.File(home / "two" / "modes.h5") as two:
        np.testing.assert_array_equal(one["frequency"][:], two["frequency"][:])
    capsys.readouterr()
    assert main(["cache"]) == 0
    listed = capsys.readouterr().out
    assert "static    scene" in listed and "at most 10 GB" in listed
    assert main(["cache", "--clear", "--unused-for", "1"]) == 0
    assert "0 stages removed" in capsys.readouterr().out
    assert main(["cache", "--clear"]) == 0
    assert not Cache.of_user().entries() and (home / "two" / "static.h5").is_file()


@pytest.mark.long
def test_another_road_takes_the_coarser_companion_of_the_first(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only contact runs are new; the error bars are those of a run that computed all by itself."""
    sure = (
        "accuracy.estimate=true",
        "tire.segments=16",
        "tire.elements_arc=8",
        "contact.points={dx=0.01,dy=0.01}",
        "road.kind=sine",
    )
    until = (*sure, "road.amplitude=1.2e-4")
    run(home, "one", *sure, "road.amplitude=1e-4", up_to="accuracy")
    assert [one.stage for one in Cache.of_user().entries()].count("static") == 2
    assert not (home / "one" / "coarser").exists()
    with monkeypatch.context() as patched:
        patched.setattr(accuracy, "carried_over", None)  # would fail if it were called
        second = run(home, "two", *until, up_to="accuracy")
    assert "greens    reused" in second and "not estimated" not in second
    monkeypatch.setenv("TIREROAD_CACHE", "off")
    run(home, "alone", *until, up_to="accuracy")
    for force in ("contact_force", "axle_force"):
        found = []
        for name in ("two", "alone"):
            with h5py.File(home / name / "accuracy.h5") as file:
                found.append(file[force]["mesh"]["deviation"][:])
        assert found[0][2] == pytest.approx(found[1][2], rel=1e-9) and found[0][2] > 0


def test_the_longest_unused_goes_first(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared, "LARGEST", 2500)
    source = home / "stage.h5"
    for number, name in enumerate("abc"):
        source.write_bytes(b"x" * 1000)
        Cache.of_user().keep("static", name, source, {})
        figures = Cache.of_user().place("static", name).with_suffix(".json")
        if figures.exists():
            os.utime(figures, (number, number))
        source.unlink()
    assert [one.path.name for one in Cache.of_user().entries()] == ["static-b.h5", "static-c.h5"]


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_is_none(home: Path) -> None:
    (home / "cache").write_text("a file")
    assert "static    done" in run(home, "one", "time=", "contact=", "road=")


def test_a_cache_that_takes_no_more_is_told_and_the_run_goes_on(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder that exists but cannot be written, or is full: it ended the run with status 3."""
    source = home / "stage.h5"
    source.write_bytes(b"x")

    def refuses(path: Path, text: str) -> None:
        raise Refused(f"{path}: cannot be written")

    monkeypatch.setattr(shared, "write_text", refuses)
    told: list[str] = []
    monkeypatch.setattr(shared._LOG, "warning", told.append)
    Cache.of_user().keep("static", "a", source, {})
    (said,) = told
    assert "not kept for other runs, TIREROAD_CACHE = " in said and "cannot be written" in said
    assert Cache.of_user().entries() == []


def test_off_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TIREROAD_CACHE", "off")
    assert Cache.of_user().folder is None and Cache.of_user().entries() == []
    assert "TIREROAD_CACHE is off" in Cache.of_user().described()


def test_a_cache_that_may_not_be_entered_is_none(tmp_path: Path, monkeypatch) -> None:
    """A home of another user: the look-up was taken for a refused write, and the run ended."""

    def refused(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(shared.store, "why_not", refused)
    assert Cache(tmp_path).fetch("static", "0" * 64, tmp_path / "static.h5") is None
