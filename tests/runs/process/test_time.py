"""What the scene says of time: steps that do not fit the duration, one step, the run-in, the axle."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.contact.loop import equal_steps, steps_of
from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.scene import Motion, RoadTable
from tireroad.runs.stages.rolling import passing_period

SCENE = (
    """
name = "time"
"""
    + soft_torus(16, 6, footprint_size=0.4)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 20
[rotation]
speed = 40.0
[contact]
youngs_modulus = 2e7
[road]
kind = "cobblestones"
run_in = 0.05
height_scatter = 0.0005
[time]
duration = 0.01
step = 3e-5
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    """Run the scene with some settings, in one folder; the folder, the summary's stages, what was printed."""
    folder = tmp_path_factory.mktemp("time")
    scene = folder / "scene.toml"
    scene.write_text(SCENE)

    def started(*settings: str):
        options = [part for setting in settings for part in ("--set", setting)]
        printed, stages = ran(scene, folder / "out", *options)
        return folder / "out", stages, printed

    return started


@pytest.mark.parametrize(
    ("duration", "size", "count"),
    [(0.1, 1e-4, 1000), (0.3, 0.1, 3), (0.1, 3e-5, 3334), (1e-4, 1e-4, 1), (0.7, 0.07, 10)],
)
def test_steps_cover_the_duration(duration, size, count) -> None:
    """Multiples in rounding stay multiples; all else ends less than a step late."""
    steps = steps_of(duration, size)
    assert steps.count == count
    assert duration * (1 - 1e-9) <= steps.duration < duration + size
    equal = equal_steps(duration, size)
    assert equal.count == count
    assert equal.duration == pytest.approx(duration, rel=1e-15)


@pytest.mark.parametrize(("duration", "size"), [(0.0, 1e-4), (0.1, 0.0), (np.inf, 1.0)])
def test_times_that_make_no_steps_are_refused(duration, size) -> None:
    with pytest.raises(InputError, match="must be positive"):
        steps_of(duration, size)


def test_the_shortest_period_is_a_wave_of_the_road_or_of_its_motion() -> None:
    """At 10 m/s: a 0.2 m wave resolved by points 0.1 m apart, a sine of 100 Hz, a ramp of 5 ms."""
    still, sine = Motion(), Motion(kind="sine", frequency=100.0)
    ramp = Motion(kind="ramp", duration=5e-3)
    for motion, period in ((still, 0.02), (sine, 0.01), (ramp, 5e-3)):
        assert passing_period(RoadTable(motion=motion), 0.1, 10.0) == pytest.approx(period)
    assert passing_period(RoadTable(), 0.1, 0.0) == np.inf


@pytest.mark.long
def test_a_duration_that_is_no_multiple_of_the_step_runs_to_the_end_of_its_last_step(run) -> None:
    folder, _, said = run()
    with h5py.File(folder / "contact.h5") as file:
        time = file["time"][:]
    assert len(time) == 334
    assert time[-1] == pytest.approx(334 * 3e-5)
    assert "the run ends at 0.01002 s" in said


@pytest.mark.slow
def test_one_step_is_a_run(run) -> None:
    """Its spectra hold one line and no band; every stage and the report come to their end."""
    folder, stages, _ = run("time.duration=3e-5")
    assert {entry["status"] for entry in stages.values()} <= {"computed", "reused", "skipped"}
    assert stages["report"]["status"] == "computed"
    assert any("spectra are of 1 steps" in text for text in stages["spectra"]["warnings"])
    with h5py.File(folder / "spectra.h5") as file:
        assert file["frequency"].shape == (1,)
        assert file["third_octave/level"].shape == (0, 3)
    assert "no spectrum" in (folder / "report.html").read_text()


@pytest.mark.long
def test_a_run_in_that_cannot_be_left_out_of_the_spectra_is_said(run) -> None:
    folder, stages, _ = run("time.duration=0.006")
    assert any("hold the run-in" in text for text in stages["spectra"]["warnings"])
    with h5py.File(folder / "spectra.h5") as file:
        assert file.attrs["left_out"] == 0.0
    folder, stages, _ = run("road.run_in=0.005", "time.duration=0.08", "time.step=1e-4")
    assert not any("hold the run-in" in text for text in stages["spectra"]["warnings"])
    left_out = stages["spectra"]["headline"]["left out as run-in"]["value"]
    with h5py.File(folder / "spectra.h5") as file, h5py.File(folder / "contact.h5") as contact:
        assert file.attrs["left_out"] == left_out > 0.0
        seen = 1e-4 * (len(contact["time"]) - round(left_out / 1e-4))
        assert file["frequency"].shape == (int(file.attrs["limit"] * seen) + 1,)


@pytest.mark.long
def test_the_axle_force_is_kept_where_it_is_wanted_and_only_there(run) -> None:
    folder, _, _ = run("output.axle_force=false")
    for name in ("contact.h5", "spectra.h5"):
        with h5py.File(folder / name) as file:
            assert "axle_force" not in file
    assert "Spectra of the contact force" in (folder / "report.html").read_text()
    folder, stages, _ = run()
    assert stages["contact"]["status"] == "computed"
    with h5py.File(folder / "contact.h5") as file:
        assert file["axle_force"].shape == (334, 3)


@pytest.mark.long
def test_friction_is_compared_with_the_one_that_is_sure_of_its_answer(run) -> None:
    """The limit of this tire, some hundreds, is beyond what a scene may ask for."""
    _, stages, _ = run("contact.brush_stiffness=2e5", "time.duration=0.0015")
    limit = stages["contact"]["indicators"][
        "friction up to which a step is known to have one solution"
    ]["value"]
    assert limit > 10.0
