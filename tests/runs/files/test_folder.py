"""The result folder: made, checked for its owner, held by one run, summarised."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import signed
from tireroad.runs.files.folder import Summary, check_kept_scene, check_owner, claimed
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps


def test_new_folder_is_made(tmp_path: Path) -> None:
    with claimed(tmp_path / "a" / "b", "scene"):
        assert (tmp_path / "a" / "b").is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scene": "other"}, ['"other"', '"mine"', "--out"]),
        ({"program": {"name": "tireroad", "version": "0.0.1", "format": 1}}, ["0.0.1", "--out"]),
        ({"program": {"name": "tireroad", "version": "0.1.0", "format": 99}}, ["format 99"]),
        ({"stages": 3}, ["not a summary"]),
    ],
)
def test_folder_of_others_is_left_alone(tmp_path: Path, change: dict, words: list[str]) -> None:
    summary = Summary(tmp_path, "mine", 1)
    summary.record("static", "computed")
    summary.path.write_text(json.dumps({**summary.data, **change}))
    before = summary.path.read_bytes()
    with pytest.raises(InputError) as caught, claimed(tmp_path, "mine"):
        pass
    for word in words:
        assert word in str(caught.value)
    assert summary.path.read_bytes() == before


def test_own_folder_is_taken_again(tmp_path: Path) -> None:
    Summary(tmp_path, "mine", 1).record("static", "computed")
    (tmp_path / "scene.toml").write_text("name = 'mine'")
    entered = False
    with claimed(tmp_path, "mine"):
        entered = True
    assert entered


def test_damaged_summary_and_foreign_scene(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text("name = 'mine'")
    with pytest.raises(InputError, match="not a result"), claimed(tmp_path, "mine"):
        pass
    (tmp_path / "summary.json").write_text('{"program": ')
    with pytest.raises(InputError, match="not a summary"), claimed(tmp_path, "mine"):
        pass


def test_stopped_run_goes_on(tmp_path: Path) -> None:
    """A run stopped in its first stage leaves its scene and no summary."""
    (tmp_path / "user.toml").write_text("name = 'mine'")
    (tmp_path / "scene.toml").write_text(dumps(load(tmp_path / "user.toml")))
    entered = False
    with claimed(tmp_path, "mine"):
        entered = True
    assert entered
    with pytest.raises(InputError, match='scene "mine", not of "yours"'):
        check_owner(tmp_path, "yours")


def test_a_changed_scene_is_not_resumed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no run to resume"):
        check_kept_scene(tmp_path / "scene.toml")
    (tmp_path / "contact.h5").write_text("")
    with pytest.raises(InputError, match="no run to resume"):
        check_kept_scene(tmp_path / "contact.h5" / "scene.toml")
    path = tmp_path / "scene.toml"
    path.write_text(signed("load = 300.0\n"))
    check_kept_scene(path)
    whole = path.read_text()
    for changed in (whole.replace("300", "700"), "load = 300.0\n", "load = 30"):
        path.write_text(changed)
        with pytest.raises(InputError, match="has changed since the run wrote it"):
            check_kept_scene(path)


def test_a_changed_summary_is_not_believed(tmp_path: Path) -> None:
    Summary(tmp_path, "mine", 1).record("static", "computed", headline={"load": (300.0, "N")})
    path = tmp_path / "summary.json"
    path.write_text(path.read_text().replace("300", "700"))
    with pytest.raises(InputError, match="is damaged"), claimed(tmp_path, "mine"):
        pass


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="not a folder"), claimed(place, "mine"):
            pass


def test_second_run_is_refused(tmp_path: Path) -> None:
    with (
        claimed(tmp_path, "mine"),
        pytest.raises(InputError, match="another run"),
        claimed(tmp_path, "mine"),
    ):
        pass


def test_summary_keeps_figures_of_reused_stages(tmp_path: Path) -> None:
    first = Summary(tmp_path, "mine", 2)
    first.record(
        "static",
        "computed",
        seconds=1.5,
        headline={"load": (np.float64(500), "N"), "ratio": (math.inf, "-")},
        warnings=["soft"],
        cost={"factor": 1.0},
    )
    second = Summary(tmp_path, "mine", 1)
    second.record("static", "reused", reason="same inputs", seconds=0.1)
    second.record("contact", "skipped", reason="no [contact]")
    data = json.loads((tmp_path / "summary.json").read_text())
    assert data["stages"]["static"]["status"] == "reused"
    assert data["stages"]["static"]["headline"]["load"] == {"value": 500.0, "unit": "N"}
    assert data["stages"]["static"]["headline"]["ratio"]["value"] is None
    assert data["stages"]["static"]["warnings"] == ["soft"]
    assert data["stages"]["contact"]["headline"] == {}
    assert data["processes"] == 1
