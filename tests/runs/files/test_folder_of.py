"""The folder of what is made from a file that is no scene, and the scene in it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from tireroad.runs.files.folder import folder_of
from tireroad.runs.files.names import scene_name
from tireroad.runs.report.input_file import describe_road


def test_files_of_one_name_do_not_overwrite_each_other(tmp_path: Path) -> None:
    """Same name elsewhere, other ending, names that become the same, and the results of a run."""
    results = tmp_path / "results"
    files = [
        tmp_path / name
        for name in ("a/tire.inp", "b/tire.inp", "a/tire.msh", "a/t r.inp", "a/t-r.inp")
    ]
    found = [folder_of(file, results) for file in files]
    assert [folder.name for folder in found] == ["tire", "tire-2", "tire-3", "t-r", "t-r-2"]
    assert [folder_of(file, results) for file in files] == found  # again: the same
    (results / "run").mkdir()
    (results / "run" / "summary.json").write_text("{}")
    assert folder_of(tmp_path / "run.inp", results).name == "run-2"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("tire", "tire"),
        ("205/60 R15", "205-60-R15"),
        ("Größe", "Gr--e"),
        (".x", "x"),
        ("", "scene"),
    ],
)
def test_names_of_scenes(text: str, name: str) -> None:
    assert scene_name(text) == name


def test_the_road_to_paste_names_its_file_from_anywhere(tmp_path: Path) -> None:
    """A relative path, and one with quotation marks: the table is TOML, and holds where the file is."""
    folder = tmp_path / 'with "quotes"'
    folder.mkdir()
    x = 0.5 * np.arange(400)
    z = np.round(np.sin(x / 7) + 0.2 * np.sin(x), 3)
    (folder / "line.csv").write_text(
        "x [mm],z [mm]\n" + "\n".join(f"{a},{b}" for a, b in zip(x, z, strict=True))
    )
    told = describe_road(folder / "line.csv", tmp_path / "out")
    table = tomllib.loads(told[told.index("[road]") :])
    assert table["road"]["file"] == str(folder / "line.csv")
