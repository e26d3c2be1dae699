"""output.vibration: the whole tire in frequency, from the forces of a run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

import tireroad
from tireroad.fem.errors import InputError
from tireroad.greens.outputs import Surface
from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load

pytestmark = pytest.mark.slow

TIRE = (
    soft_torus(12, 4, order=2)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 12
[output]
vibration = true
fields = true
"""
)
FORCE = """
[[force]]
angle = 90.0
frequency = 50.0
amplitude = 2.0
direction = [1.0, 0.0, 0.0]
[time]
duration = 0.4
step = 1e-3
[greens]
residual = "none"
band = 200.0
"""
ROLLING = """
[rotation]
speed = 20.0
[contact]
tread = "winkler"
[road]
kind = "sine"
wavelength = 0.3
[time]
duration = 0.3
step = 2e-4
"""


def run(folder: Path, text: str) -> tireroad.RunResults:
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(TIRE + text)
    scene = load(folder / "scene.toml")
    run_scene(scene, folder, MPI.COMM_SELF, until="motion", fresh=False, petsc_options=[])
    return tireroad.load(folder)


def test_a_steady_force_moves_the_face_by_its_receptance(tmp_path: Path) -> None:
    """At the line of the force: what the driven point does, |H| F, is what the field shows there."""
    results = run(tmp_path, FORCE + "[output.receptance]\nto = 50.0\nstep = 25.0\n")
    frequency = results["vibration/frequency"]
    line = int(np.argmin(np.abs(frequency - 50.0)))
    assert frequency[line] == pytest.approx(50.0) and frequency[-1] <= 200.0
    H = results["response/receptance"][-1, 0, 0]
    points, field = results["vibration/surface/points"], results["vibration/surface/displacement"]
    driven = np.argmax(points[:, 0] - 10 * np.abs(points[:, 1]) - 10 * np.abs(points[:, 2]))
    assert abs(field[line, driven, 0]) == pytest.approx(2.0 * abs(H), rel=0.01)
    # All that shakes has the frequency of the force.
    level = results["vibration/mean_square_velocity"]
    assert level.argmax() == line and level[line + 3 :].max() < 1e-3 * level[line]


def test_the_field_in_time_is_the_response_in_time(tmp_path: Path) -> None:
    """By another stage of the program, from the same states."""
    results = run(tmp_path, FORCE)
    time, moved = results["motion/time"], results["motion/displacement"]
    points = results["motion/surface/points"]
    driven = np.argmax(points[:, 0] - 10 * np.abs(points[:, 1]) - 10 * np.abs(points[:, 2]))
    rows = np.searchsorted(results["response/time"], time - 1e-6)
    known = results["response/displacement"][rows, 0, 0]
    np.testing.assert_allclose(moved[:, driven, 0], known, atol=0.01 * np.abs(known).max())
    assert len(time) == 400 and time[-1] == pytest.approx(0.4)


def test_a_record_without_a_line_in_the_band_is_refused(tmp_path: Path) -> None:
    """Found by a random run: no field of no line can be shaped."""
    with pytest.raises(InputError, match="no spectral line up to .* raise time.duration"):
        run(tmp_path, FORCE.replace("0.4", "0.004"))
    assert (tmp_path / "response.h5").exists()


def test_a_rolling_tire_vibrates_as_its_road_passes(tmp_path: Path) -> None:
    results = run(tmp_path, ROLLING)
    frequency = results["vibration/frequency"]
    level = results["vibration/mean_square_velocity"]
    passing = results.attributes("static")["rolling_radius"] * 20.0 / 0.3
    assert frequency[level.argmax()] == pytest.approx(passing, abs=2 * frequency[0])
    power = results["vibration/third_octave/radiated_power_level"]
    heard = results["vibration/third_octave/radiated_power_level_a_weighted"]
    assert len(power) and (heard < power).all()  # below 1 kHz
    # The points of contact move as the loop said, but for the residual flexibility at them.
    time, moved = results["motion/time"], results["motion/displacement"]
    assert len(time) > 200 and np.isfinite(moved).all() and np.abs(moved).max() > 1e-6


def test_an_impact_is_not_left_out_and_rings_as_in_time(tmp_path: Path) -> None:
    """The cleat was left out as run-in, and the ringing at the window's start was not counted."""
    cleat = ROLLING.replace('"sine"\nwavelength = 0.3', '"cleat"').replace("0.3", "0.2")
    results = run(tmp_path, cleat + "[damping]\nmass = 20.0\n[greens]\nband = 150.0\n")
    assert results.attributes("spectra")["left_out"] == 0.0
    time, moved = results["motion/time"], results["motion/displacement"]
    step = time[1] - time[0]
    assert len(time) * step > 0.198  # the whole run
    field = moved.reshape(len(time), -1).astype(float)
    window = np.sin(np.pi * (time / 0.2)) ** 2
    seen = 2 * np.fft.rfft(window[:, None] * (field - field.mean(axis=0)), axis=0) / window.sum()
    strongest = int(results["vibration/mean_square_velocity"].argmax())
    line = results["vibration/surface/displacement"][strongest].ravel()
    same = int(round(results["vibration/frequency"][strongest] * len(time) * step))
    assert np.linalg.norm(line) == pytest.approx(np.linalg.norm(seen[same]), rel=0.02)


def test_totals_count_lines_in_bands_too_narrow_for_a_level(tmp_path: Path) -> None:
    """0.04 s have lines 25 Hz apart, and no band of three up to 200 Hz: levels were -inf, and null."""
    results = run(tmp_path, FORCE.replace("0.4", "0.04"))
    square = results["vibration/mean_square_velocity"]
    assert len(square) > 2 and not len(results["vibration/third_octave/centre"])
    stage = json.loads((tmp_path / "summary.json").read_text())["stages"]["vibration"]
    level = stage["headline"]["velocity level"]["value"]
    assert level == pytest.approx(10 * np.log10(square.sum() / 1.5 / 1e-18), abs=1e-9)
    area = stage["headline"]["area of the outer face"]["value"]
    power = stage["headline"]["equivalent radiated power"]["value"]
    known = 10 * np.log10(413.3 * area * square.sum() / 1.5 / 1e-12)  # rho c S <v2>
    assert power == pytest.approx(known, abs=1e-9)
    heard = stage["headline"]["A-weighted equivalent radiated power"]["value"]
    assert power - 40 < heard < power - 15  # from 25 to 200 Hz, mostly at 50 Hz: -30 dB
    assert results.attributes("vibration")["radiated_power_level_a_weighted"] == heard


def test_the_total_is_the_mean_square_over_time(tmp_path: Path) -> None:
    """In 0.8 s the band at 10 Hz has fewer than three lines: the bands alone miss the force's own."""
    results = run(tmp_path, FORCE.replace("0.4", "0.8").replace("50.0", "10.0"))
    bands = 10 * np.log10((10 ** (results["vibration/third_octave/velocity_level"] / 10)).sum())
    surface = Surface.of(results["static/surface/points"], results["static/surface/quads"])
    size = np.linalg.norm(surface.normal, axis=1)
    motion = np.einsum("sk,nsk->ns", surface.normal, results["motion/displacement"])
    speed = np.gradient(motion, 1e-3, axis=0)[1:-1]
    square = (speed**2 / size).sum(axis=1).mean() / surface.area
    total = results.attributes("vibration")["velocity_level"]
    assert total == pytest.approx(10 * np.log10(square / 1e-18), abs=0.5)
    assert bands < total - 10


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "needs forces in time"),
        (ROLLING.replace("[rotation]", '[rotation]\nmethod = "full"'), "projected"),
    ],
)
def test_what_it_needs(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "scene.toml").write_text(TIRE + text)
    with pytest.raises(InputError, match=words):
        load(tmp_path / "scene.toml")
