"""Result folders read from a script."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import tireroad
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import signed, signed_table


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with h5py.File(tmp_path / "contact.h5", "w") as file:
        file["total_force"] = np.arange(6.0).reshape(2, 3)
        file["total_force"].attrs["unit"] = "N"
        file["contact/points"] = np.zeros((4, 3))
        file["contact/points"].attrs["unit"] = "m"
    with h5py.File(tmp_path / "static.h5", "w") as file:
        file.attrs["load"] = 500.0
    stages = {"static": {"seconds": 1.5}, "contact": {}}
    (tmp_path / "summary.json").write_text(json.dumps({"stages": stages}))
    (tmp_path / "scene.toml").write_text(signed('name = "a"\n'))
    return tmp_path


def test_arrays_units_and_attributes(folder: Path) -> None:
    run = tireroad.load(folder)
    assert sorted(run) == ["contact/contact/points", "contact/total_force"]
    assert np.array_equal(run["contact/total_force"], np.arange(6.0).reshape(2, 3))
    assert run.unit("contact/total_force") == "N"
    assert run.attributes("static")["load"] == 500.0
    assert run.scene == {"name": "a"} and run.summary["static"]["seconds"] == 1.5


def test_what_is_not_there_is_named(folder: Path) -> None:
    run = tireroad.load(folder)
    with pytest.raises(KeyError, match="contact/total_force"):
        run["contact/axle_force"]
    with pytest.raises(InputError, match=r"no such folder"):
        tireroad.load(folder / "nothing")
    (folder / "static.h5").write_bytes(b"no HDF5")
    with pytest.raises(InputError, match="damaged"):
        len(tireroad.load(folder))


@pytest.mark.parametrize(
    "text", [None, b"", b"a = ", b"\xff\xfe", b'name = "b"\n', b'{"stages": 3}', b"[]"]
)
@pytest.mark.parametrize("name", ["scene.toml", "summary.json"])
def test_damaged_texts_are_named(folder: Path, name: str, text: bytes | None) -> None:
    run = tireroad.load(folder)
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(text)
    with pytest.raises(InputError, match=name):
        _ = run.scene if name == "scene.toml" else run.summary


def test_a_changed_summary_is_not_believed(folder: Path) -> None:
    table = signed_table({"stages": {"static": {"seconds": 1.5}}})
    path = folder / "summary.json"
    path.write_text(json.dumps(table))
    assert tireroad.load(folder).summary == {"static": {"seconds": 1.5}}
    path.write_text(json.dumps(table).replace("1.5", "2.5"))
    with pytest.raises(InputError, match=r"summary\.json is damaged"):
        _ = tireroad.load(folder).summary


def test_what_holds_no_results_is_told_for_what_it_is(tmp_path: Path) -> None:
    (tmp_path / "sweep.csv").touch()
    (tmp_path / "empty").mkdir()
    said = {
        ".": r"a sweep: see sweep\.html .*members",
        "sweep.csv": "a file: give the folder",
        "nosuch": "there is no such folder",
        "empty": r"it has no summary\.json",
    }
    for name, text in said.items():
        with pytest.raises(InputError, match=text):
            tireroad.load(tmp_path / name)
