"""A folder used again with another scene: nothing of the earlier one is shown as its results."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from synthetic_results import put, sealed, write_results
from synthetic_scene import SCENE

import tireroad
from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.disk import signed
from tireroad.runs.files.folder import Summary, left_out, remarks
from tireroad.runs.report.compare import compare
from tireroad.runs.report.page import render
from tireroad.runs.results.export import export
from tireroad.runs.stages.failures import failure_recorded

NAME = "synthetic-torus"
OTHER = SCENE + "# another scene\n"
STAGES = ("static", "modes", "rotating", "greens", "contact", "response", "spectra")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The results of a finished run."""
    write_results(tmp_path / "run")
    (tmp_path / "run" / "summary.json").unlink()
    finish(tmp_path / "run", SCENE)
    return tmp_path / "run"


def begun(folder: Path, text: str) -> Summary:
    summary = Summary(folder, NAME, 1, text)
    summary.begin()
    return summary


def finish(folder: Path, text: str, status: str = "computed", key: str = "a") -> None:
    summary = begun(folder, text)
    for stage in STAGES:
        figures = {"headline": {"figure": (len(stage), "-")}} if status == "computed" else {}
        summary.record(stage, status, input_hash=f"{stage} {key}", **figures)
    summary.record("report", "computed")


def entries(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())["stages"]


def until(folder: Path, text: str, key: str) -> None:
    """A run of the static state alone."""
    summary = begun(folder, text)
    summary.record("static", "computed", input_hash=f"static {key}")
    for stage in (*STAGES[1:], "report"):
        summary.record(stage, "skipped", reason="--until static")


def test_what_a_search_chose_for_another_scene_is_left_out(folder: Path) -> None:
    (folder / "chosen.toml").write_bytes((folder / "scene.toml").read_bytes())
    assert left_out(folder) == {}
    finish(folder, OTHER)
    assert left_out(folder) == {"chosen.toml": "it was chosen for another scene"}


def test_a_finished_run_leaves_out_nothing(folder: Path) -> None:
    assert left_out(folder) == {}
    assert {name.partition("/")[0] for name in tireroad.load(folder)} == set(STAGES) - {"greens"}


def test_stages_of_another_scene_are_left_out_everywhere(folder: Path, tmp_path: Path) -> None:
    (folder / "export").mkdir()
    (folder / "export" / "spectra.csv").write_text("of an earlier export")
    until(folder, OTHER, "b")
    others = {f"{stage}.h5" for stage in STAGES[1:]} - {"greens.h5"}
    assert left_out(folder).keys() == others
    page = render(folder)
    assert "load at rest" in page, "the load of the static state, which is of this scene"
    assert "rolling (mean)" not in page and "lowest modes" not in page
    assert page.count("left out: it is of an earlier run (--until static)") == 5
    assert {path.name for path in export(folder)} == {"footprint.csv", "static.xdmf"}
    assert not (folder / "export" / "spectra.csv").exists()
    run = tireroad.load(folder)
    assert {name.partition("/")[0] for name in run} == {"static"}
    assert run.left_out.keys() == others and "modes.h5" in repr(run)
    for ask in (lambda: run["modes/frequency"], lambda: run.attributes("modes")):
        with pytest.raises(KeyError, match="earlier run"):
            ask()
    write_results(tmp_path / "second")
    compare([tmp_path / "second", folder], tmp_path / "out")
    rows = (tmp_path / "out" / "compare.csv").read_text()
    assert "mode 1" not in rows and all(
        line.endswith(",") for line in rows.splitlines() if line.startswith("axle force")
    )


def test_a_stage_switched_off_is_left_out(folder: Path) -> None:
    summary = begun(folder, OTHER)
    for stage in STAGES[:-1]:
        summary.record(stage, "reused", input_hash=f"{stage} a")
    summary.record("spectra", "skipped", reason="output.spectra is false")
    assert left_out(folder).keys() == {"spectra.h5"}
    page = render(folder)
    assert "rolling (mean)" in page and "third octave" not in page.lower()
    assert entries(folder)["contact"]["headline"], "figures of the run that computed it"


def test_before_its_first_stage_a_run_of_another_scene_has_no_results(folder: Path) -> None:
    """Also when it stops or gives up there: scene.toml is its own, no figure is."""
    begun(folder, OTHER)
    assert entries(folder) == {} and len(left_out(folder)) == 6
    assert "load at rest" not in render(folder)
    assert "this run has not finished it" in render(folder)


def test_the_earlier_scene_comes_back_with_its_figures(folder: Path) -> None:
    before = {stage: entries(folder)[stage]["headline"] for stage in STAGES}
    until(folder, OTHER, "b")
    summary = begun(folder, SCENE)
    summary.record("static", "computed", input_hash="static a")
    for stage in STAGES[1:]:
        summary.record(stage, "reused", input_hash=f"{stage} a")
    assert left_out(folder) == {}
    assert all(entries(folder)[stage]["headline"] == before[stage] for stage in STAGES[1:])


def test_figures_are_not_those_of_another_file(folder: Path) -> None:
    """A run that was killed between writing a file and entering it leaves another's figures."""
    begun(folder, OTHER).record("static", "reused", input_hash="static b")
    assert entries(folder)["static"]["headline"] == {}


def test_a_run_of_the_same_scene_keeps_what_it_does_not_reach(folder: Path) -> None:
    begun(folder, SCENE)
    assert "report" in entries(folder), "nothing has been changed"
    until(folder, SCENE, "a")
    assert left_out(folder) == {} and entries(folder)["report"]["status"] == "skipped"


def test_changed_inputs_put_later_stages_out_of_date(folder: Path) -> None:
    """The same scene, but another road or mesh in the file that it names."""
    begun(folder, SCENE).record("static", "computed", input_hash="static b")
    assert entries(folder).keys() == {"static"}
    assert len(left_out(folder)) == 5


def test_checkpoints_count_for_the_scene_that_wrote_them(folder: Path) -> None:
    with sealed(folder / "checkpoint.h5") as file:
        file.attrs["scene"] = OTHER
        put(file, "total_force", [1.0], "N")
    assert left_out(folder).keys() == {"checkpoint.h5"}
    assert "checkpoint/total_force" not in tireroad.load(folder)
    begun(folder, OTHER)
    assert "checkpoint/total_force" in tireroad.load(folder)


def test_without_a_summary_every_file_counts(folder: Path) -> None:
    (folder / "scene.toml").write_text(signed(OTHER))
    (folder / "summary.json").unlink()
    assert left_out(folder) == {}


def test_how_a_run_ended_is_told_by_all_that_show_its_results(folder: Path, tmp_path: Path) -> None:
    """A tire that buckled under its load had a page like any other, but for the files it lacks."""
    whole = tmp_path / "whole"
    shutil.copytree(folder, whole)
    summary = begun(folder, SCENE)
    with pytest.raises(ConvergenceError), failure_recorded("modes", summary, MPI.COMM_SELF):
        raise ConvergenceError("13 negative eigenvalues")
    told = "the run ended in stage modes, 13 negative eigenvalues"
    assert remarks(folder)[0].endswith(told) and tireroad.load(folder).ending == told
    assert told in render(folder)
    assert told in compare([whole, folder], tmp_path / "out").read_text()
    finish(folder, SCENE)
    assert tireroad.load(folder).ending == "" and "the run ended" not in render(folder)


def test_a_checkpoint_is_nothing_that_a_finished_run_lacks(folder: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    shutil.copytree(folder, whole)
    with h5py.File(folder / "checkpoint.h5", "w") as file:
        file.attrs["scene"] = SCENE
        file["state"] = np.zeros(3)
    assert "checkpoint" not in compare([whole, folder], tmp_path / "out").read_text()
