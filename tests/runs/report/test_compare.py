"""Two to twelve runs in one page and one table."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.contact.results.spectra import confidence
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import signed
from tireroad.runs.report.compare import (
    BandMarks,
    Row,
    _change,
    assurance,
    compare,
    level_rows,
    marks,
    marks_told,
    scene_rows,
)
from tireroad.runs.report.figures import canvas
from tireroad.runs.report.levels import SOUND, BandLevels
from tireroad.runs.results.reader import RunResults


def write(folder: Path, load: float, level: float, frequencies: list[float], turn: bool) -> Path:
    folder.mkdir()
    text = f'name = "{folder.name}"\n[static]\nload = {load}\n'
    (folder / "scene.toml").write_text(signed(text))
    headline = {"load": {"value": load, "unit": "N"}}
    stages = {"static": {"seconds": 1.0, "headline": headline}}
    stages |= {name: {} for name in ("modes", "spectra", "sound")}
    (folder / "summary.json").write_text(json.dumps({"stages": stages}))
    shape = np.random.default_rng(1).standard_normal((3, 20, 3))
    points = np.random.default_rng(2).random((20, 3))
    order = [2, 1, 0] if turn else [0, 1, 2]
    with h5py.File(folder / "modes.h5", "w") as file:
        file["frequency"] = np.array(frequencies)
        file["surface/shape"] = -shape[order] if turn else shape
        file["surface/points"] = points
    with h5py.File(folder / "spectra.h5", "w") as file:
        file["third_octave/centre"] = np.array([100.0, 125.892541, 158.489319])
        file["third_octave/level"] = np.array([[1.0, 2.0, level + 3 * n] for n in range(3)])
        file["third_octave/contact_level"] = file["third_octave/level"][:] + 4.0
    with h5py.File(folder / "sound.h5", "w") as file:
        file["third_octave/centre"] = np.array([100.0])
        file["third_octave/level_a"] = np.array([[level + 60.0], [level + 70.0]])
        file["power"] = np.array([level + 50.0])
        file.attrs["microphone_names"] = ["cpx front", "cpx rear"]
    return folder


@pytest.fixture
def pair(tmp_path: Path) -> list[Path]:
    first = write(tmp_path / "a", 500.0, 10.0, [50.0, 60.0, 70.0], turn=False)
    second = write(tmp_path / "b", 550.0, 16.0, [71.0, 61.0, 51.0], turn=True)
    return [first, second]


def test_table_has_what_differs(pair: list[Path], tmp_path: Path) -> None:
    page = compare(pair, tmp_path / "out").read_text()
    with (tmp_path / "out" / "compare.csv").open() as file:
        rows = {(r["group"], r["quantity"]): r for r in csv.DictReader(file)}
    assert rows["scene", "static.load"]["b"] == "550.0"
    assert float(rows["axle force z", "125 Hz"]["b"]) == 19.0
    assert float(rows["contact force x", "100 Hz"]["b"]) == 5.0
    assert float(rows["sound power level", "100 Hz"]["b"]) == 66.0
    assert rows["sound power level", "100 Hz"]["unit"] == "dB re 1 pW"
    assert float(rows[f"{SOUND}cpx rear", "100 Hz"]["b"]) == 86.0
    assert "+6.0 dB" in page and "+10 %" in page
    for what in ("axle force z", "contact force z"):
        assert f"Third octaves: {what}." in page
    assert "Third octaves: sound power level." not in page, "one band is no chart"
    # Modes are matched by shape, whatever their order and sign.
    assert float(rows["modes", "mode 1, MAC 1.00"]["b"]) == 51.0
    assert float(rows["modes", "mode 3, MAC 1.00"]["b"]) == 71.0


def test_what_is_missing_is_said(pair: list[Path], tmp_path: Path) -> None:
    (pair[1] / "spectra.h5").unlink()
    assert "b has no spectra.h5" in compare(pair, tmp_path / "out").read_text()


def test_a_run_too_short_for_any_band_is_compared(pair: list[Path], tmp_path: Path) -> None:
    with h5py.File(pair[1] / "spectra.h5", "w") as file:
        file["third_octave/centre"] = np.zeros(0)
        file["third_octave/level"] = np.zeros((0, 3))
    compare(pair, tmp_path / "out")
    with (tmp_path / "out" / "compare.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["b"] for row in rows if row["a"] == "10.0"] == [""]


def test_folders_without_results_are_refused(pair: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="2 to 12"):
        compare(pair[:1], tmp_path / "out")
    with pytest.raises(InputError, match=r"summary\.json"):
        compare([pair[0], tmp_path], tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["scene.toml", "summary.json"])
def test_damaged_runs_are_refused(pair: list[Path], tmp_path: Path, name: str) -> None:
    """An empty scene is damaged too, not a scene without keys."""
    (pair[1] / name).write_text("")
    with pytest.raises(InputError, match=f"b/{name} is damaged"):
        compare(pair, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_same_scenes_differ_in_nothing() -> None:
    one = {"name": "a", "force": [{"angle": 1.0}], "tire": {"order": 2}}
    assert scene_rows([one, one | {"name": "b"}]) == []
    assert [r.name for r in scene_rows([one, {"tire": {"order": 3}}])] == [
        "force.0.angle",
        "tire.order",
    ]


def test_assurance_criterion() -> None:
    shapes = np.random.default_rng(3).standard_normal((4, 7, 3))
    assert np.allclose(np.diag(assurance(shapes, -3.0 * shapes)), 1.0)
    apart = assurance(np.eye(3).reshape(3, 1, 3), np.eye(3).reshape(3, 1, 3))
    assert np.allclose(apart, np.eye(3))


def test_a_level_of_nothing_is_left_out(tmp_path: Path) -> None:
    """The vertical force of one run is constant: it had -3076.5 dB, and a difference of 3000 dB."""
    runs = [write(tmp_path / name, 300.0, 5.0, [1.0, 2.0, 3.0], False) for name in ("a", "b")]
    with h5py.File(runs[1] / "spectra.h5", "a") as file:
        file["third_octave/level"][:, 2] = -3076.5
    found = level_rows([RunResults(run) for run in runs])
    (row,) = (row for row in found if (row.group, row.name) == ("axle force z", "100 Hz"))
    assert row.values == (5.0, None)


def test_large_changes_are_whole_percents() -> None:
    """Twice was +1e+02 %."""
    row = Row("contact", "step", "s", (1.0, 2.0, 1.013, 21.0, 0.0))
    assert [_change(row, k) for k in range(5)] == ["", "+100 %", "+1.3 %", "+2000 %", "-100 %"]


def test_rounding_is_no_difference_and_a_seed_has_no_percents() -> None:
    """A load that was given differed by -1.1e-14 %, a seed of 7 from one of 1 by +600 %."""
    load = Row("static", "load", "N", (4000.0, 4000.0 * (1 - 1e-15)))
    assert not load.differs and _change(load, 1) == ""
    seed = Row("scene", "road.seed", "", (1, 7))
    assert seed.differs and _change(seed, 1) == ""
    level = Row("radiation", "error", "dB", (0.03237, 0.03228))
    assert _change(level, 1) == "-9e-05 dB"


def test_what_differs_in_the_scenes_has_its_unit() -> None:
    (row,) = scene_rows([{"static": {"inflation": p}} for p in (2.2e5, 2.4e5)])
    assert (row.name, row.unit) == ("static.inflation", "Pa")
    cords = [{"tire": {"cords": [{"name": "belt", "spacing": s}]}} for s in (1e-3, 2e-3)]
    (row,) = scene_rows(cords)
    assert (row.name, row.unit) == ("tire.cords.0.spacing", "m")


def test_a_chart_of_bands_has_a_mark_for_the_numerical_error_and_one_for_the_chance():
    """Of what is known: a run without error bars has none, one over a shape no boxes; bands by their frequency."""
    nan = np.nan
    one = BandLevels(
        "axle force z", "dB re 1 N", np.array([100.0, 125.0]), np.array([10.0, 12.0]),
        np.array([0.5, nan]), np.array([16.0, 20.0]),
    )  # fmt: skip
    found = BandMarks.at([80.0, 100.0, 125.0], one)
    np.testing.assert_allclose(found.level, [nan, 10.0, 12.0])
    np.testing.assert_allclose(found.error, [nan, 0.5, nan])
    np.testing.assert_allclose(found.chance[1:], confidence(np.array([16.0, 20.0])))
    figure, axes = canvas(6.0, 3.0)
    marks(axes[0, 0], np.arange(3.0), found)
    assert len(axes[0, 0].patches) == 2  # boxes
    assert len(axes[0, 0].collections[0].get_segments()) == 1  # bars
    assert [word in marks_told([found]) for word in ("numerical", "chance")] == [True, True]
    nothing = BandMarks.at([100.0], None)
    assert not marks_told([nothing]) and np.isnan(nothing.level).all()
