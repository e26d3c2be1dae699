"""All levels of a run from its history: names, units, shapes, and the same after they were stored."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.contact.results.spectra import SILENT, third_octaves
from tireroad.runs.stages import spectra
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.spectra import too_short
from tireroad.runs.stages.stage import Record

STEP = 1e-4


@pytest.fixture(scope="module")
def history() -> ContactHistory:
    """A second of 2 N at 100 Hz on the road, the same and moments on the hub, two points that move by 1 um."""
    time = STEP * np.arange(1, 10_001)
    sine = np.sin(2 * np.pi * 100 * time)[:, None]
    return ContactHistory(
        step=STEP,
        scheme="linear",
        time=time,
        total_force=2.0 * sine * [0.0, 0.0, 1.0],
        axle_force=2.0 * sine * [1.0, 0.0, 1.0],
        driven=1e-6 * sine[:, :, None] * np.ones((2, 3)),
        wheel={"hub_moment": 3.0 * sine * np.ones(3)},
    )


def test_every_quantity_has_its_level_weighted_and_not(history: ContactHistory) -> None:
    found = spectra.levels_of(history, 0, 400.0)
    band = list(found["third_octave/nominal"]).index(100.0)
    for name, exact in (
        ("contact_level", 20 * np.log10(2 / np.sqrt(2))),
        ("level", 20 * np.log10(2 / np.sqrt(2))),
        ("hub_moment_level", 20 * np.log10(3 / np.sqrt(2))),
        ("point_velocity_level", 20 * np.log10(2 * np.pi * 100 * 1e-6 / np.sqrt(2) / 1e-9)),
    ):
        plain, weighted = (found[f"third_octave/{name}{end}"][band] for end in ("", "_a_weighted"))
        assert plain[..., 2] == pytest.approx(exact, abs=0.05), name
        assert weighted[..., 2] - plain[..., 2] == pytest.approx(-19.1, abs=0.1), name
    assert found["third_octave/point_velocity_level"].shape[1:] == (2, 3)
    assert found["density/point_velocity"].shape[1:] == (2, 3)
    power = found["density/hub_moment"][:, 0].sum() * np.diff(found["density/frequency"])[0]
    assert power == pytest.approx(4.5, rel=0.02), "Parseval: (3 N m)^2 / 2"


def test_nothing_is_beyond_the_limit_and_all_is_of_one_length(history: ContactHistory) -> None:
    found = spectra.levels_of(history, 0, 400.0)
    assert found["third_octave/centre"][-1] * 10**0.05 <= 400.0
    assert found["density/frequency"][-1] <= 400.0
    for name, values in found.items():
        group, _, what = name.partition("/")
        if values.ndim > 1:
            over = "third_octave/centre" if group == "third_octave" else "density/frequency"
            assert len(values) == len(found[over]), what


def test_stored_and_read_again_with_units(history: ContactHistory, tmp_path: Path) -> None:
    found = spectra.levels_of(history, 0, 400.0)
    with h5py.File(tmp_path / "spectra.h5", "w") as file:
        spectra.write(file, found)
        assert file["third_octave/point_velocity_level"].attrs["unit"] == "dB re 1 nm/s"
        assert file["third_octave/level_a_weighted"].attrs["unit"] == "dB(A) re 1 N"
        assert file["density/hub_moment"].attrs["unit"] == "N2 m2/Hz"
        again = spectra.read(file)
    assert again.keys() == found.keys()
    assert all((again[name] == values).all() for name, values in found.items())


def test_a_record_too_short_for_bands_says_so(history: ContactHistory) -> None:
    record = Record()
    spectra.describe(record, spectra.levels_of(history, 9500, 200.0), history, 9500, 200.0)
    assert record.headline["bands left out, narrower than three lines"][0] == "20 to 160 Hz"


def test_sums_have_names_that_do_not_change_with_the_bands(history: ContactHistory) -> None:
    record = Record()
    spectra.describe(record, spectra.levels_of(history, 0, 400.0), history, 0, 400.0)
    assert record.headline["bands"][0].endswith(" to 315 Hz")
    value, unit = record.headline["level of the vertical contact force"]
    assert (value, unit) == (pytest.approx(20 * np.log10(2 / np.sqrt(2)), abs=0.05), "dB re 1 N")


def test_totals_count_lines_of_bands_too_narrow_for_a_level(history: ContactHistory) -> None:
    """A tone of 20 Hz has no band in a record of 0.05 s; its level was left out of the total."""
    time, record = 1e-4 * np.arange(500), Record()
    force = np.zeros((500, 3))
    force[:, 2] = 500.0 + np.sin(2 * np.pi * 20.0 * time)
    short = replace(history, time=time, total_force=force, axle_force=None, driven=None, wheel={})
    spectra.describe(record, spectra.levels_of(short, 0, 400.0), short, 0, 400.0)
    value = record.headline["level of the vertical contact force"][0]
    assert value == pytest.approx(10 * np.log10(0.5), abs=2.0)
    assert not record.warnings


def test_a_force_that_does_not_vary_has_no_level(history: ContactHistory) -> None:
    """On a flat road it had -3076.5 dB re 1 N, or -247 dB with rounding."""
    record, force = Record(), np.full((5000, 3), [0.0, 0.0, 4000.0])
    noisy = force + 1e-12 * np.random.default_rng(1).standard_normal(force.shape)
    flat = replace(
        history,
        time=1e-4 * np.arange(5000),
        total_force=force,
        axle_force=noisy,
        driven=None,
        wheel={},
    )
    found = spectra.levels_of(flat, 0, 400.0)
    for name in ("contact_level", "level", "level_a_weighted"):
        assert (found[f"third_octave/{name}"] < SILENT).all(), name
    spectra.describe(record, found, flat, 0, 400.0)
    for what in ("contact force", "force on the axle"):
        for kind in ("level", "A-weighted level"):
            assert record.headline[f"{kind} of the vertical {what}"][0] == "none: it does not vary"
    small = replace(flat, axle_force=force + 2e-6 * np.sin(np.arange(5000))[:, None])
    spectra.describe(record, spectra.levels_of(small, 0, 400.0), small, 0, 2000.0)
    value = record.headline["level of the vertical force on the axle"][0]
    assert value == pytest.approx(10 * np.log10(2e-12), abs=0.1)


@pytest.mark.parametrize(("at", "words"), [(0.02, "near an end"), (0.25, "in the middle")])
def test_an_impact_warns_that_its_level_depends_on_when(
    history: ContactHistory, at: float, words: str
) -> None:
    """The Hann window of the record hid an impact near its end by up to 45 dB."""
    time, record = 1e-4 * np.arange(5000), Record()
    force = np.zeros((5000, 3))
    since = np.maximum(time - at, 0.0)
    force[:, 2] = 500.0 + 100.0 * np.exp(-200.0 * since) * np.sin(600.0 * since)
    hit = replace(history, time=time, total_force=force, axle_force=None, driven=None, wheel={})
    spectra.describe(record, spectra.levels_of(hit, 0, 400.0), hit, 0, 400.0)
    assert len(record.warnings) == 1
    assert words in record.warnings[0] and "road.position" in record.warnings[0]


@pytest.mark.parametrize(
    ("duration", "up_to", "says"),
    [
        (0.25, 400.0, ""),
        (0.1, 400.0, "from 63 Hz on, and has none below 160 Hz: take time.duration = 0.24 s"),
        (0.01, 400.0, "from 63 Hz on, and has none: take time.duration = 0.24 s"),
        (0.25, 60.0, "from 50 Hz on, and has none: take time.duration = 0.3 s"),
        (0.25, 1.0, ""),
    ],
)
def test_a_record_too_short_is_told_what_would_do(duration: float, up_to: float, says: str) -> None:
    """0.03 s of run-in, and 3 lines across 63 Hz, which is 14.5 Hz wide: 0.03 + 3 / 14.5 = 0.24 s."""
    told = too_short(bands(duration, 0.0, up_to), up_to, 0.03)
    assert says in told and bool(told) == bool(says)
    if says:
        assert bands(advised(told), 0.03, up_to).min() < 65.0


@pytest.mark.parametrize(("duration", "grows"), [(0.1, 0.08), (0.05, 0.2), (0.2, 0.15)])
def test_the_duration_told_has_room_for_the_run_in(duration: float, grows: float) -> None:
    """A run-in of half the run or more is not left out; of the run that is advised it is."""
    told = too_short(bands(duration, 0.0, 400.0), 400.0, grows)
    assert advised(told) > 2 * grows
    assert bands(advised(told), grows, 400.0).min() < 65.0


def bands(duration: float, left_out: float, up_to: float) -> np.ndarray:
    """Centres, Hz, of the third octaves of a run of this duration, s."""
    return third_octaves(np.zeros((round((duration - left_out) / STEP), 3)), STEP, up_to)[0]


def advised(told: str) -> float:
    return float(told.split("=")[1].split()[0])
