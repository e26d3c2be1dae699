"""[sound]: what microphones hear of a run, against a sum over the nodes made apart."""

from __future__ import annotations

import json
import re
import wave
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from scipy.interpolate import CubicSpline
from tires import soft_torus

import tireroad
from tireroad.contact.results.spectra import a_weighting, amplitudes
from tireroad.contact.results.squeezed_air import FootprintCells, squeezed
from tireroad.contact.tread.kernel import GridPlaces
from tireroad.greens.footprint_air import Groove, LateralGroove
from tireroad.greens.outputs import Surface
from tireroad.greens.tire_sound import directions
from tireroad.runs.pipeline import run_scene
from tireroad.runs.report.levels import band_levels, is_drawn
from tireroad.runs.report.page import write_report
from tireroad.runs.results.export import export
from tireroad.runs.scene.load import load
from tireroad.runs.stages.footprint_air import grooves
from tireroad.runs.stages.sound import SPACING, _total_error, intensity

pytestmark = pytest.mark.slow

SCENE = (
    soft_torus(16, 6, order=2)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 20
[output]
vibration = true
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
[accuracy]
estimate = false
[sound]
microphones = ["cpx", [3.0, 1.0, 1.0]]
up_to = 150.0
"""
)


def run(folder: Path, *overrides: str) -> tireroad.RunResults:
    folder.mkdir(exist_ok=True)
    (folder / "scene.toml").write_text(SCENE)
    scene = load(folder / "scene.toml", overrides)
    run_scene(scene, folder, MPI.COMM_SELF, until="sound", fresh=False, petsc_options=[])
    return tireroad.load(folder)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tireroad.RunResults:
    return run(tmp_path_factory.mktemp("sound") / "run")


def test_the_pressure_is_the_sum_over_the_nodes(results: tireroad.RunResults) -> None:
    """p = sum of weight times volume velocity i w (n A).u, with the stored field of the vibration."""
    frequency, field = (results[f"vibration/surface/{k}"] for k in ("frequency", "displacement"))
    static = results["static/surface/points"] + results["static/surface/displacement"]
    quads, touching = results["static/surface/quads"], results["static/surface/force"] > 0
    area = Surface.of(static, quads[~touching[quads].all(axis=1)]).normal
    if (area * static).sum() < 0:
        area = -area
    solved, weight = results["sound/transfer/frequency"], results["sound/transfer/weight"]
    places, heard = results["sound/microphones"], results["sound/pressure"]
    delay = 2j * np.pi * solved[:, None] / 343.23 * np.linalg.norm(places, axis=1)
    smooth = CubicSpline(solved, weight * np.exp(delay)[:, :, None])
    own = results["sound/frequency"]
    for line in np.flatnonzero(own > 40)[::5]:
        here = int(np.argmin(np.abs(frequency - own[line])))
        flow = 2j * np.pi * own[line] * (area * field[here]).sum(axis=1)
        back = np.exp(-2j * np.pi * own[line] / 343.23 * np.linalg.norm(places, axis=1))
        pressure = (smooth(own[line]) @ flow) * back
        assert np.abs(pressure - heard[:, line]).max() < 0.01 * np.abs(heard[:, line]).max()


def test_levels_and_signals_are_those_of_the_pressure(results: tireroad.RunResults) -> None:
    """Total levels from the lines, and from the signal over time within a decibel."""
    square = (np.abs(results["sound/pressure"]) ** 2).sum(axis=1) / 2 / 1.5
    total = 10 * np.log10(square / 4e-10)
    np.testing.assert_allclose(results["sound/total/level"], total, atol=1e-9)
    bands = 10 * np.log10((10 ** (results["sound/third_octave/level"] / 10)).sum(axis=1))
    assert (bands <= total + 0.1).all(), "the road's own 20 Hz lie in no band"
    assert results["sound/third_octave/level"].shape == results["sound/third_octave/level_a"].shape
    signal = results["sound/signal/pressure"]
    meant = 10 * np.log10((signal**2).mean(axis=1) / 4e-10)
    np.testing.assert_allclose(meant, total, atol=2.0)
    share = results["sound/contribution/region"]
    np.testing.assert_allclose(share.sum(axis=2), 1.0, atol=1e-6)
    stage = json.loads((results.directory / "summary.json").read_text())["stages"]["sound"]
    told = stage["headline"]
    assert told["sound pressure level at cpx front"]["value"] == pytest.approx(total[0])
    assert told["A-weighted CPX level"]["unit"] == "dB(A) re 20 uPa"


def test_what_is_not_estimated_is_unknown_everywhere(results: tireroad.RunResults) -> None:
    """Without error bars of the vibration the log told the boundary elements' 0.02 dB, the report "± 0.0"."""
    for name in ("third_octave/level_error", "total/level_error", "total/level_a_error"):
        assert np.isnan(results[f"sound/{name}"]).all()
    assert (results["sound/third_octave/element_error"] > 0).all()
    stage = json.loads((results.directory / "summary.json").read_text())["stages"]["sound"]
    told = {name: entry["value"] for name, entry in stage["headline"].items() if "error" in name}
    assert told.pop("error of the vibration") == "unknown: accuracy.estimate is false"
    assert len(told) == 9 and set(told.values()) == {"unknown"}
    page = write_report(results.directory).read_text()
    assert "error unknown" in page and not re.search(r"± 0\.0(?!\d)", page)
    assert "that of the vibration was not estimated" in page


def test_errors_of_totals_are_known_where_most_of_them_lies_in_known_bands() -> None:
    """Of two equal bands and lines in none: squares add; a tenth may be unknown."""
    band, error = np.array([[1.0, 1.0, 0.1]]), np.array([[0.3, 0.4, np.nan]])
    assert _total_error(band, np.array([2.1]), error) == pytest.approx(0.25)
    assert np.isnan(_total_error(band, np.array([2.3]), error)).all()
    assert np.isnan(_total_error(band, np.array([2.1]), np.full((1, 3), np.nan))).all()


def test_the_far_level_is_that_of_the_power(results: tireroad.RunResults) -> None:
    """The mean over the hemisphere of the directivity at 7.5 m is the power's."""
    level = results["sound/directivity/level"]
    _, angle = directions()
    square = 4e-10 * 10 ** (level.reshape(len(level), -1) / 10)
    power = (square * angle).sum(axis=1) * 7.5**2 / (1.2041 * 343.23)
    np.testing.assert_allclose(10 * np.log10(power / 1e-12), results["sound/power"], atol=0.01)
    assert (results["sound/efficiency"] < 2).all()


def test_another_road_hears_through_the_same_air(
    tmp_path: Path, results: tireroad.RunResults
) -> None:
    """Radiation is reused; louder roads are louder; what listens afterwards hears the same."""
    other = run(results.directory, "road.amplitude=2e-3")
    stages = other.summary
    assert stages["radiation"]["status"] == "reused" and stages["sound"]["status"] == "computed"
    heard = tireroad.listen(other, ["cpx", (3.0, 1.0, 1.0)], up_to=150.0)
    np.testing.assert_allclose(heard.level, other["sound/third_octave/level"], atol=1e-6)
    for bad in (["cpx", "nowhere"], [(0.0, 0.0, 0.3)], [(1.0, 0.0, -0.1)]):
        with pytest.raises(tireroad.InputError, match="microphone"):
            tireroad.listen(other, bad)
    write_report(results.directory)
    page = (results.directory / "report.html").read_text()
    assert "Sound beside the tire" in page and page.count("<audio") == 3
    names = [path.name for path in export(results.directory)]
    waves = [name for name in names if name.endswith(".wav")]
    assert "sound.csv" in names and len(waves) == 3
    full = float(waves[0].split("_")[-2])
    with wave.open(str(results.directory / "export" / waves[0])) as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2") * full / 32767
        assert file.getframerate() == 8000
    signal = other["sound/signal/pressure"][0]
    assert len(samples) == 3 * 8000 > len(signal)
    some = slice(int(0.06 * len(signal)), int(0.94 * len(signal)))
    np.testing.assert_allclose(samples[some], signal[some], atol=full / 30000)
    assert np.abs(samples[-2000:]).max() > 0.3 * np.abs(signal).max(), "it goes on"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("sound.microphones=[[0.0,0.0,0.3]]", "lies inside"),
        ("sound.microphones=[[0.0,0.0,-0.3]]", "lies under it"),
        ("sound.microphones=['ear']", "cpx, obsi, pass-by"),
        ("sound.microphones=[]", "list of names and places"),
        ("output.spectra=false", "output.spectra"),
        ("road.drum_radius=1.0", "whose road is a plane"),
    ],
)
def test_what_cannot_be_heard_is_refused(
    results: tireroad.RunResults, tmp_path: Path, change: str, message: str
) -> None:
    with pytest.raises(tireroad.InputError, match=message):
        run(tmp_path / "run", change)


def test_intensity_of_a_plane_wave_and_of_a_standing_one() -> None:
    """Outward where the outer microphone lags, p^2 / 2 rho c but for sin(kd) / kd; none where nothing travels."""
    frequency = np.array([100.0, 500.0, 1000.0])
    k = 2 * np.pi * frequency / 343.0
    there, back = np.exp(-1j * k * SPACING), np.exp(1j * k * SPACING)
    one = np.ones(3, complex)
    found = intensity(one, there, frequency, 1.2)
    np.testing.assert_allclose(found, np.sinc(k * SPACING / np.pi) / (2 * 1.2 * 343.0), rtol=1e-12)
    assert found[2] == pytest.approx(1 / (2 * 1.2 * 343.0), rel=0.015)
    np.testing.assert_allclose(intensity(one, back, frequency, 1.2), -found)
    np.testing.assert_allclose(intensity(one, 0.7 * one, frequency, 1.2), 0.0, atol=1e-15)


def test_probes_hear_what_the_microphones_of_t_360_hear(results: tireroad.RunResults) -> None:
    """Intensity near the tire is that of its pressures, and no longer their level in a field that stores energy;
    over a rigid road the intensity 5 m away is p^2 / 2 rho c."""
    heard = tireroad.listen(results, ["obsi"], up_to=150.0)
    assert heard.probes == ["obsi leading", "obsi trailing"] and heard.intensity.shape[0] == 2
    one, other = heard.pressure[heard.names.index("obsi leading inner")], heard.pressure[1]
    flux = -(one.conj() * other).imag / (4 * np.pi * heard.frequency * 1.2041 * SPACING)
    np.testing.assert_allclose(heard.intensity[0], flux, rtol=1e-4)
    assert heard.intensity_index.shape == (2, len(heard.centre)) and heard.intensity_index.max() > 1
    total = 10 * np.log10((flux * 10 ** (a_weighting(heard.frequency) / 10)).sum() / 1.5 / 1e-12)
    assert heard.total_intensity[0] == pytest.approx(total, abs=0.01)
    ends = [(0.0, 5.0 + side * SPACING / 2, 0.0) for side in (-1, 1)]
    far = tireroad.listen(results, ends, up_to=150.0)
    some = far.frequency > 60
    away = intensity(*far.pressure, far.frequency, 1.2041)[some]
    plane = np.abs(far.pressure[0, some]) ** 2 / (2 * 1.2041 * 343.23)
    assert 10 * np.log10(away / plane) == pytest.approx(0.0, abs=0.2)


def test_probes_stand_under_one_name_everywhere(tmp_path: Path) -> None:
    """File, headline, levels and pages of a run with probes: their intensity is charted, not its pressures."""
    run_of = run(tmp_path / "run", 'sound.microphones=["obsi"]')
    levels = {one.name: one for one in band_levels(run_of)}
    name = "A-weighted sound intensity level at obsi leading"
    assert levels[name].unit == "dB(A) re 1 pW/m2" and np.isnan(levels[name].error).all()
    stored = run_of["sound/third_octave/intensity_level_a"][0]
    np.testing.assert_array_equal(levels[name].level, stored)
    drawn = [one for one in levels if is_drawn(one) and "obsi" in one]
    assert drawn == [name, name.replace("leading", "trailing")]
    stage = json.loads((run_of.directory / "summary.json").read_text())["stages"]["sound"]
    told = stage["headline"]["A-weighted OBSI level"]
    mean = 10 * np.log10((10 ** (run_of["sound/total/intensity_level_a"] / 10)).mean())
    assert told["value"] == pytest.approx(mean) and told["unit"] == "dB(A) re 1 pW/m2"
    page = write_report(run_of.directory).read_text()
    assert "pressure-intensity index to" in page and "dB(A) re 1 pW/m²" in page


def test_a_road_that_absorbs_is_heard(results: tireroad.RunResults) -> None:
    """Of a finished run: a hard layer is the rigid road, a soft one another level; its keys are checked."""
    rigid = tireroad.listen(results, [(3.0, 1.0, 1.0)], up_to=150.0)
    hard = tireroad.listen(results, [(3.0, 1.0, 1.0)], up_to=150.0, road={"resistivity": 1e15})
    np.testing.assert_allclose(hard.pressure, rigid.pressure, rtol=1e-4)
    soft = tireroad.listen(
        results,
        [(3.0, 1.0, 1.0)],
        up_to=150.0,
        road=tireroad.PorousLayer(resistivity=2e3, porosity=0.3, thickness=0.2),
    )
    assert np.abs(soft.level - rigid.level).max() > 1.0
    for road, why in (({"depth": 0.1}, "road has the keys"), ({"porosity": 2.0}, "porosity must")):
        with pytest.raises(tireroad.InputError, match=why):
            tireroad.listen(results, road=road)


def test_four_tires_pass(results: tireroad.RunResults) -> None:
    """Between 0 and 12 dB more than one tire abreast (a sine sounds in tones, which add or cancel), loudest there."""
    heard = tireroad.pass_by(results, side=4.0, track=0.0, wheelbase=0.0, up_to=150.0)
    assert heard.speed == pytest.approx(20.0 * 0.32, rel=0.1) and heard.up_to < 180.0
    abreast = tireroad.listen(results, [(0.0, 4.0, 1.2)], up_to=150.0).total_weighted[0]
    assert heard.maximum == pytest.approx(abreast + 6.0, abs=7.0)
    loudest = heard.time[heard.level.argmax()] * heard.speed
    assert abs(loudest) < 5.0
    early = np.searchsorted(heard.time * heard.speed, -20.0)
    assert heard.level[early] < heard.maximum - 8.0
    with pytest.raises(tireroad.InputError, match="to the nearest tires"):
        tireroad.pass_by(results, side=2.0)


def test_air_of_the_footprint_is_heard_beside_the_vibration(tmp_path: Path) -> None:
    """The vibration stays as it is; far below resonance the air is p = i w rho Q times the mean of g beside the contact."""
    results, with_air = run(tmp_path / "without"), run(tmp_path / "with", "sound.air=true")
    assert np.isnan(results["sound/third_octave/air_level"]).all()
    vibration = with_air["sound/third_octave/vibration_level"]
    assert np.allclose(vibration, results["sound/third_octave/level"], atol=1e-9)
    assert np.array_equal(results["sound/efficiency"], with_air["sound/efficiency"])
    frequency, rest = (
        with_air["sound/frequency"],
        with_air["sound/pressure"] - results["sound/pressure"],
    )
    cells = FootprintCells.of(_places(with_air), with_air["contact/static_force"])
    step = float(with_air["contact/time"][1] - with_air["contact/time"][0])
    speed = float(with_air.attributes("contact")["road_speed"])
    ones = np.ones((1, len(cells.cell)))
    gaps = with_air["contact/gap"]
    first = len(gaps) - round(1 / (frequency[1] - frequency[0]) / step)
    air = squeezed(cells, [gaps[first:]], ones, speed, step)
    late = frequency * air.over
    lines = np.rint(frequency * step * len(air.rate)).astype(int)
    flow = amplitudes(air.rate, step)[1][lines, 0] * np.exp(1j * np.pi * late) / np.sinc(late)
    # The lowest free nodes beside the contact; over a footprint of centimetres g hardly changes at 100 Hz.
    static = with_air["static/surface/points"] + with_air["static/surface/displacement"]
    touching = with_air["static/surface/force"] > 0
    low = static[~touching][:, 2] < static[touching][:, 2].max() + 5e-3
    weight = with_air["sound/transfer/weight"][:, :, np.flatnonzero(~touching)[low]].mean(axis=2)
    solved = with_air["sound/transfer/frequency"]
    near = np.stack([np.interp(frequency, solved, np.abs(one)) for one in weight.T])
    loud = np.abs(rest[0]) > 0.1 * np.abs(rest[0]).max()
    assert loud.sum() > 5
    assert np.abs(rest)[:, loud] == pytest.approx((near * np.abs(flow))[:, loud], rel=0.25)


def test_the_air_of_a_pattern_leaves_by_its_grooves(tmp_path: Path) -> None:
    """The air of a run with a pattern is heard, from gaps without the depth of its grooves; the network has those of the pattern."""
    around = {"direction": "circumferential", "width": 0.008, "depth": 0.006}
    lateral = {"width": 0.006, "depth": 0.006}
    tables = "[{}]".format(", ".join(_inline(one) for one in (around, lateral)))
    found = run(tmp_path / "open", "sound.air=true", f"pattern={{groove={tables}}}")
    air = found["sound/third_octave/air_level"]
    assert np.isfinite(air).all()
    assert found.summary["sound"]["indicators"]["mean gap in the footprint"]["value"] < 0.006
    job = SimpleNamespace(
        scene=load(tmp_path / "open" / "scene.toml", [f"pattern={{groove={tables}}}"])
    )
    (one,), (other,) = grooves(job.scene, 2.0)
    assert one == Groove(0.0, 0.008, 0.006)
    assert other == LateralGroove(0.006, 0.006, 2.0 / 60, (-1.0, 1.0), 0.0)
    # Those of the section stay where the pattern has lateral ones only.
    only = load(tmp_path / "open" / "scene.toml", [f"pattern={{groove=[{_inline(lateral)}]}}"])
    assert grooves(only, 2.0)[0] == [Groove(*g) for g in only.tire.shape.grooves_around]


def _inline(table: dict[str, object]) -> str:
    return "{" + ", ".join(f"{key} = {json.dumps(value)}" for key, value in table.items()) + "}"


def _places(run: tireroad.RunResults) -> GridPlaces:
    points = run["contact/points"][:, :2]
    spacing = [float(np.diff(np.unique(one.round(9))).min()) for one in points.T]
    row, column = np.rint((points - points.min(axis=0)) / spacing).astype(int).T
    shape = int(row.max() + 1), int(column.max() + 1)
    return GridPlaces(shape, (spacing[0], spacing[1]), row * shape[1] + column)


def test_contact_points_at_nodes_have_no_air_and_say_so(tmp_path: Path) -> None:
    found = run(tmp_path / "nodes", "sound.air=true", 'contact.points="nodes"')
    assert np.isnan(found["sound/third_octave/air_level"]).all()
    notes = " ".join(found.summary["sound"].get("notes", []))
    assert "contact.points" in notes


@pytest.mark.mpi
def test_air_is_heard_alike_on_any_number_of_processes(tmp_path_factory) -> None:
    comm = MPI.COMM_WORLD
    base = comm.bcast(tmp_path_factory.mktemp("several") if not comm.rank else None)
    if not comm.rank:
        (base / "scene.toml").write_text(SCENE)
    comm.Barrier()
    scene, levels = load(base / "scene.toml", ["sound.air=true"]), []
    for one in (comm, MPI.COMM_SELF):
        folder = base / (f"alone-{comm.rank}" if one is MPI.COMM_SELF else "together")
        run_scene(scene, folder, one, until="sound", fresh=False, petsc_options=[])
        with h5py.File(folder / "sound.h5") as file:
            levels.append(file["third_octave/air_level"][:])
    assert np.isfinite(levels[0]).all()
    np.testing.assert_allclose(levels[0], levels[1], atol=1e-6)
