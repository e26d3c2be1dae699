"""Camber and drums through all stages: at rest nothing moves, forces are the road's, wrong ones are refused."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load

SCENE = (
    soft_torus(20, 6)
    + """[static]
load = 800.0
camber = 4.0
error_estimate = false
[modal]
count = 40
[rotation]
speed = 40.0
free_rolling = false
[contact]
points = { dx = 0.008, dy = 0.008 }
tread = "layer"
youngs_modulus = 1e7
brush_stiffness_per_area = 1e8
friction = 0.8
reach = 0.01
[road]
kind = "flat"
drum_radius = 0.85
[time]
duration = 0.01
[accuracy]
estimate = false
"""
)
CAR = """
[axle]
kind = "corner"
"""


@pytest.mark.long
@pytest.mark.parametrize("axle", ["", CAR])
def test_on_a_smooth_drum_nothing_moves(tmp_path, launch, axle) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE + axle)
    done = launch("-m", "runs", "run", scene, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr + done.stdout
    with h5py.File(tmp_path / "out" / "contact.h5") as contact:
        total, axle_force = contact["total_force"][:], contact["axle_force"][:]
        moved = np.abs(contact["displacement"][:]).max()
    assert moved < 1e-12
    assert np.ptp(total[:, 2]) < 1e-6
    # Normal to a drum, forces fore and aft of the axle lean away from each other.
    assert 800.0 <= total[0, 2] < 802.0
    # In the wheel's axes: the load leans to the left by the camber's angle.
    with h5py.File(tmp_path / "out" / "static.h5") as static:
        push = static["contact/force"][:].sum(axis=0)
        assert static.attrs["camber"] == pytest.approx(4.0)
    assert axle_force[-1] == pytest.approx(push, abs=1.0)
    assert push[1] / push[2] == pytest.approx(np.tan(np.radians(4.0)), rel=1e-6)


@pytest.mark.long
def test_companions_of_a_freely_rolling_wheel_roll_freely(tmp_path, launch) -> None:
    """Without its slip a companion would be dragged, and the mean along the road be off by that."""
    scene = tmp_path / "scene.toml"
    text = SCENE.replace("free_rolling = false", "free_rolling = true")
    text = text.replace('kind = "flat"', 'kind = "sine"\namplitude = 2e-4\nwavelength = 0.1')
    text = text.replace("duration = 0.01", "duration = 0.04")
    text = text.replace("[accuracy]\nestimate = false\n", "")
    scene.write_text(text)
    done = launch("-m", "runs", "run", scene, "--out", tmp_path / "out", "--until", "accuracy")
    assert done.returncode == 0, done.stderr + done.stdout
    slip = float(done.stdout.partition("slip of free rolling ")[2].split()[0]) / 100
    with h5py.File(tmp_path / "out" / "contact.h5") as contact:
        assert contact.attrs["free_slip"] == pytest.approx(slip, rel=1e-3)
    with h5py.File(tmp_path / "out" / "accuracy.h5") as accuracy:
        off = {cause: one["mean"][0] for cause, one in accuracy["contact_force"].items()}
    assert 0 < abs(off["step"]) < 1.0, off  # 0.44 N; 2.1 N without the slip, -0.2 %


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("drum_radius = 0.85", 'drum_radius = 0.33\ndrum = "inside"', "no room inside"),
        ("drum_radius = 0.85", "drum_radius = 0.0", "drum_radius"),
        ("camber = 4.0", "camber = 45.0", "camber"),
        ("drum_radius = 0.85", 'drum = "under"', "drum"),
    ],
)
def test_roads_that_cannot_be(tmp_path, old, new, named) -> None:
    (tmp_path / "scene.toml").write_text(SCENE.replace(old, new))
    with pytest.raises(InputError, match=named):
        load(tmp_path / "scene.toml")


@pytest.mark.long
def test_a_freely_rolling_wheel_is_dragged_by_what_rubs(tmp_path, launch) -> None:
    """On a smooth drum, cambered, by 0.3 % of the load; some of the force across is left (camber thrust)."""
    scene = tmp_path / "scene.toml"
    text = SCENE.replace("free_rolling = false", "free_rolling = true")
    scene.write_text(text.replace("duration = 0.01", "duration = 0.05"))
    done = launch("-m", "runs", "run", scene, "--out", tmp_path / "out", "--until", "contact")
    assert done.returncode == 0, done.stderr + done.stdout
    assert "slip of free rolling" in done.stdout
    with h5py.File(tmp_path / "out" / "contact.h5") as contact:
        total = contact["total_force"][:]
    assert -5e-3 * 800.0 < total[-20:, 0].mean() < 0
    assert abs(total[-1, 1]) > 5.0


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (
            "brush_stiffness_per_area = 1e8\nfriction = 0.8",
            "shear = false",
            "brush_stiffness_per_area",
        ),
        ("friction = 0.8", "friction = 0.0", "any slip is free"),
        ("speed = 40.0", "speed = 0.0", "a wheel that turns"),
    ],
)
def test_free_rolling_that_cannot_be(tmp_path, old, new, named) -> None:
    text = SCENE.replace("free_rolling = false", "free_rolling = true")
    (tmp_path / "scene.toml").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=named):
        load(tmp_path / "scene.toml")
