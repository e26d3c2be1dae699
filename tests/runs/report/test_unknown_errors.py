"""What was not estimated is said to be unknown wherever its figure stands."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.runs.report import live
from tireroad.runs.report.compare import BandMarks, marks_told
from tireroad.runs.report.page import _levels, _partly, _standing
from tireroad.runs.report.read import about
from tireroad.runs.report.sections.spectra import _caption, _in_numbers
from tireroad.runs.stages.stage import Record

CENTRE, NOTHING = np.array([100.0, 125.0]), np.full((2, 3), np.nan)
LEVEL, KNOWN, FEW = np.full((2, 3), 40.0), np.full((2, 3), 0.3), np.zeros(2, bool)


@pytest.mark.parametrize("error", [None, NOTHING])
def test_bands_without_error_bars_say_so(error):
    assert "error is unknown" in _caption("axle force", LEVEL, error, FEW, None)
    for _, text in _in_numbers(CENTRE, LEVEL, error, "axle force", "dB re 1 N"):
        assert text.count("(error unknown)") == 3


def test_bands_of_which_some_have_error_bars_say_so():
    some = np.where(np.arange(2)[:, None] == 1, KNOWN, np.nan)
    told = _caption("axle force", LEVEL, some, FEW, None)
    assert "Lines on the bars" in told and "without a line it is unknown" in told
    assert "unknown" not in _caption("axle force", LEVEL, KNOWN, FEW, None)
    first, last = (text for _, text in _in_numbers(CENTRE, LEVEL, some, "axle force", "dB"))
    assert "(error unknown)" in first and last.count(about(0.3)) == 3 and "unknown" not in last


def test_a_level_of_nothing_has_no_error():
    ((_, text),) = _in_numbers(CENTRE[:1], np.full((1, 3), -3000.0), None, "axle force", "dB")
    assert "unknown" not in text


def test_runs_side_by_side_say_so():
    nothing = np.full(2, np.nan)
    bare = BandMarks(LEVEL[:, 0], nothing, np.full((2, 2), np.nan))
    assert "error is unknown" in marks_told([bare])
    one = BandMarks(LEVEL[:, 0], KNOWN[:, 0], np.full((2, 2), np.nan))
    assert "unknown where there is none" in marks_told([one, bare])


def test_charts_that_are_read_by_pointing_say_so():
    """The script writes it for every bar without an error."""
    script = (Path(live.__file__).parent / "charts.js").read_text()
    assert 'errors[k][n] == null ? ", error unknown"' in script


class Held:
    """A folder with a static state and nothing else."""

    def attribute(self, file: str, name: str) -> float:
        return {"load": 4000.0, "deflection": 0.02}.get(name, 0.0)

    def optional(self, file: str, name: str) -> np.ndarray:
        return np.ones((1, 3))


@pytest.mark.parametrize(("error", "told"), [(None, "error unknown"), (1.5, "±")])
def test_the_load_says_so(error, told):
    facts = dict(_standing(Held(), lambda stage, name: error))
    assert told in facts["load at rest"], json.dumps(facts)


class Partly:
    """A folder whose error bars lack those of the points, or of nothing; its levels are 0.3 dB off."""

    def __init__(self, folder: Path, *absent: str) -> None:
        self._file = folder / "accuracy.h5"
        with h5py.File(self._file, "w") as file:
            file.attrs.update({f"absent_{cause}": "the reason" for cause in absent})

    def file(self, name: str) -> h5py.File:
        return h5py.File(self._file)

    def attribute(self, file: str, name: str) -> float:
        return 400.0

    def optional(self, file: str, name: str) -> np.ndarray:
        return KNOWN if name.endswith("_error") else LEVEL


@pytest.mark.parametrize(
    ("absent", "told"),
    [
        ((), ""),
        (("points",), ", without that by the points"),
        (("points", "mesh"), ", without that by the mesh and the points"),
    ],
)
def test_an_error_without_one_of_its_causes_says_so(tmp_path, absent, told):
    """It stood as that of all causes, with the reason somewhere below."""
    folder = Partly(tmp_path, *absent)
    assert _partly(folder) == told
    total = 40.0 + 10 * np.log10(2)
    (_, text), *_ = _levels(folder, lambda stage, name: total if "A-" not in name else None)
    assert text == f"{total:.1f} dB re 1 N, error ± 0.3{told}"


def test_a_figure_that_is_not_known_is_told_as_unknown():
    record = Record()
    record.tell("error of the mean", np.nan, "N")
    record.tell("another", 2.0, "N")
    assert record.line() == "error of the mean unknown, another 2 N"
