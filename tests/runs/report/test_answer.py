"""The summary of a run: what it says of forces, their errors and levels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from synthetic_results import sealed, write_results

from tireroad.runs.report.page import answer
from tireroad.runs.report.read import Results, quantity


def test_a_level_is_one_figure_and_its_error_that_of_the_bands_that_hold_it(tmp_path: Path) -> None:
    """The summary had 45.0 dB of all lines, and the head of the page 35.9 dB of some bands, under one name."""
    directory = write_results(tmp_path / "run", steps=64, modes=6)
    with sealed(directory / "spectra.h5", "a") as file:
        level = file["third_octave/level"][:]
        error = np.full_like(level, 0.5)
        loudest = level[:, 2].argmax()
        file["third_octave/level_error"] = error
    whole = float(10 * np.log10((10 ** (level[:, 2] / 10)).sum()))
    for total, expected in ((whole, "± 0.5"), (whole + 1, "unknown")):
        assert _told(directory, total) == f"{total:.1f} dB re 1 N, error {expected}"
    with sealed(directory / "spectra.h5", "a") as file:
        file["third_octave/level_error"][loudest] = np.nan
    assert "error unknown" in _told(directory, whole)


def _told(directory: Path, total: float) -> str:
    name = "level of the vertical force on the axle"
    stages = {"spectra": {"headline": {name: {"value": total, "unit": "dB re 1 N"}}}}
    with Results(directory, {}) as results:
        return dict(answer(results, stages))["blocked axle force z"]


LEVELS = {
    "spectra": {
        "headline": {
            f"{kind} of the vertical force on the axle": {"value": value, "unit": "dB re 1 N"}
            for kind, value in (("level", 45.0106), ("A-weighted level", 22.9195))
        }
    }
}


def test_a_constant_force_has_no_level(tmp_path: Path) -> None:
    """The report told -3076.5 dB re 1 N of a flat road."""
    directory = write_results(tmp_path / "run", steps=64, modes=6)
    with Results(directory, {}) as results:
        told = dict(answer(results, LEVELS))
    assert told["blocked axle force z"] == "45.0 dB re 1 N, error unknown; 22.9 dB(A) re 1 N"
    with sealed(directory / "spectra.h5", "a") as file:
        file["third_octave/level"][:] = -3076.5
    with Results(directory, {}) as results:
        told = dict(answer(results, {}))
    assert told["blocked axle force z"] == "constant: no level"
    assert not any("dB re 1 N" in text for text in told.values())


def test_an_error_stands_beside_the_figure_it_is_of(tmp_path: Path) -> None:
    """A deviation of all times, run-in included, had the error of that of a few milliseconds."""
    directory = write_results(tmp_path / "run", steps=64, modes=6)
    with sealed(directory / "contact.h5", "a") as file:
        step, time = float(file.attrs["step"]), np.arange(64)
        varying = 500.0 + 20.0 * np.sin(2 * np.pi * time / 8)
        file["total_force"][:, 2] = np.where(time < 16, 900.0, varying)
    with sealed(directory / "spectra.h5", "a") as file:
        file.attrs["left_out"], file.attrs["limit"] = 16 * step, 0.5 / step
    window = {
        "error of the mean contact force": 3.0,
        "deviation of the contact force in the window of the error bars": 10.0,
        "error of the deviation of the contact force": 0.5,
    }
    headline = {name: {"value": value, "unit": "N"} for name, value in window.items()}
    with Results(directory, {}) as results:
        told = answer(results, {"accuracy": {"headline": headline}})
    (what, mean), (_, spread) = (fact for fact in told if "±" in fact[1])
    assert what == f"vertical contact force, rolling (mean from {quantity(16 * step, 's')} on)"
    assert mean == "500 ± 3 N"
    assert spread == "14.14 ± 0.71 N"  # 5 %, as in the window
