"""The summary of a run: what it says of levels."""

from __future__ import annotations

from pathlib import Path

from synthetic_results import sealed, write_results

from tireroad.runs.files.read import Results
from tireroad.runs.report.answer import answer


def test_a_constant_force_has_no_level(tmp_path: Path) -> None:
    """The report told -3076.5 dB re 1 N of a flat road."""
    directory = write_results(tmp_path / "run", steps=64, modes=6)
    with Results(directory, {}) as results:
        told = dict(answer(results, {}))
    assert "dB re 1 N" in told["blocked axle force z, 31.5 to 3150 Hz"]
    with sealed(directory / "spectra.h5", "a") as file:
        file["third_octave/level"][:] = -3076.5
    with Results(directory, {}) as results:
        told = dict(answer(results, {}))
    assert told["blocked axle force z"] == "constant: no level"
    assert not any("dB re 1 N" in text for text in told.values())
