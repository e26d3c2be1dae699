"""The scenes of the interface are taken as they stand there, and without any of their tables.

A table that is absent is a stage that does not run, with the reason; the rest runs.
"""

import json

import pytest
from full_scene import CONTRACT, REAL_TIRE, refused

from tireroad.runs.check import explain
from tireroad.runs.cli import main
from tireroad.runs.scene.load import load
from tireroad.runs.scene.plan import skipped
from tireroad.runs.scene.resolved import dumps

TINY = "[tire]\nsegments = 8\nelements_arc = 2\norder = 1\n"


@pytest.mark.parametrize("text", [CONTRACT, REAL_TIRE], ids=["torus", "real tire"])
def test_check_takes_it(scene_file, tmp_path, monkeypatch, capsys, text: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["check", str(scene_file(text))]) == 0, capsys.readouterr().err
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    for stage in ("static", "modes", "rotating", "greens", "contact", "accuracy", "spectra"):
        assert [stage, "runs"] in lines


@pytest.mark.parametrize(
    ("item", "reason"),
    [
        ("time=", "no [time]"),
        ("static=", "no road in [static]: it has no load (N)"),
        ("contact=", "no [contact]"),
    ],
)
def test_without_contact_all_else_of_the_contract_runs(scene_file, item: str, reason: str) -> None:
    scene = load(scene_file(CONTRACT), [item])
    left_out = skipped(scene)
    assert left_out["contact"] == reason
    assert left_out["spectra"] == left_out["accuracy"] == f"{reason}, hence no contact forces"
    assert not {"static", "modes", "rotating", "greens", "response"} & set(left_out)
    sizes = explain(scene).partition("estimated sizes")[2].partition("estimated time")[0]
    assert "500 modes" in sizes and "contact points" not in sizes
    assert load(scene_file(dumps(scene), "resolved.toml")) == scene


def test_without_a_road_it_is_flat(scene_file) -> None:
    said: list[str] = []
    scene = load(scene_file(CONTRACT), ["road="], said.append)
    assert said == ["no [road]: it is flat"]
    assert "contact" not in skipped(scene) and scene.road.kind == "flat"
    assert scene.road.motion.kind == "none"


def test_forces_without_time_and_receptance_have_no_response(scene_file) -> None:
    left_out = skipped(load(scene_file(CONTRACT), ["time=", "output="]))
    assert left_out["response"] == "no [time], and no output.receptance"
    assert "greens" not in left_out


@pytest.mark.parametrize("item", ["rotation={}", "force=[{}]", "contact={}", "modal={}"])
def test_modes_run_where_anything_needs_them(scene_file, item: str) -> None:
    assert "modes" not in skipped(load(scene_file(""), [item]))
    assert skipped(load(scene_file("")))["modes"] == "no [modal], and nothing that needs modes"


def test_the_plan_is_kept_with_the_results(scene_file) -> None:
    for until in (None, "static", "modes"):
        scene = load(scene_file(""), until=until)
        again = load(scene_file(dumps(scene), "resolved.toml"))
        assert ("modes" in skipped(again)) == (until != "modes")


def test_the_default_number_of_modes_fits_the_mesh(scene_file) -> None:
    said: list[str] = []
    scene = load(scene_file(TINY + "[modal]\n"), (), said.append)
    free = scene.tire.free_unknowns()
    assert scene.modal.count == free - 1 < 500
    assert said == [
        f"modal.count is {free - 1}, all the modes that the mesh has, not 500 as by default"
    ]
    given = scene_file(TINY + "[modal]\ncount = 500\n")
    assert f"less than the {free} free unknowns" in refused(given)
    assert load(given, until="static").modal.count == 500


@pytest.mark.slow
def test_a_tire_alone_has_only_its_static_state(scene_file, tmp_path, ran) -> None:
    """Modes are found when they are asked for, as many as the mesh has, and kept by a resume."""
    path, out = scene_file(TINY), tmp_path / "out"
    _, stages = ran(path, out)
    assert stages["modes"]["reason"] == "no [modal], and nothing that needs modes"
    assert not (out / "modes.h5").exists()
    _, stages = ran(path, out, "--until", "modes")
    assert stages["modes"]["status"] == "computed"
    assert main(["resume", str(out)]) == 0
    stages = json.loads((out / "summary.json").read_text(encoding="utf-8"))["stages"]
    assert stages["modes"]["status"] == "reused"


@pytest.mark.slow
def test_receptances_need_no_time(scene_file, tmp_path, ran) -> None:
    small = ["tire.segments=16", "tire.elements_arc=4", "tire.order=1", "time=", "modal.count=9"]
    sets = [f"--set={one}" for one in (*small, "static.error_estimate=false")]
    _, stages = ran(scene_file(CONTRACT), tmp_path / "out", *sets)
    assert stages["contact"]["reason"] == "no [time]"
    assert (tmp_path / "out" / "response.h5").exists()
    assert not (tmp_path / "out" / "contact.h5").exists()


def test_outputs_at_driven_points_go_with_the_forces(scene_file) -> None:
    said: list[str] = []
    scene = load(scene_file(CONTRACT), ["force=[]"], said.append)
    assert not scene.output.kinds
    assert skipped(scene)["response"] == "no [[force]]"
    assert said == ["no [[force]], hence no driven points: output.receptance left out"]
