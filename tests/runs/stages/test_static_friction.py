"""Friction of the static state in a run: files, the loop about that state, what is refused."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.pipeline import run_scene
from tireroad.runs.report.read import Results, quantity
from tireroad.runs.report.sections.tire import friction
from tireroad.runs.scene.load import load

SCENE = (
    soft_torus(16, 6)
    + """[static]
load = 800.0
friction = 0.7
error_estimate = false
[rotation]
speed = 40.0
slip_angle = 1.0
[modal]
count = 30
[contact]
points = {points}
youngs_modulus = 1e7
[road]
[time]
duration = 0.01
[accuracy]
estimate = false
[output]
spectra = false
"""
)


@pytest.mark.slow
@pytest.mark.parametrize(
    "points", [pytest.param('"nodes"', marks=pytest.mark.long), "{ dx = 0.008, dy = 0.008 }"]
)
def test_nothing_moves_on_a_flat_road_and_the_axle_bears_the_side_force(tmp_path, points) -> None:
    (tmp_path / "scene.toml").write_text(SCENE.format(points=points))
    scene = load(tmp_path / "scene.toml")
    run_scene(scene, tmp_path, MPI.COMM_SELF, until="contact", fresh=False, petsc_options=[])
    with h5py.File(tmp_path / "static.h5") as static, h5py.File(tmp_path / "contact.h5") as loop:
        side = static.attrs["horizontal_force"]
        with Results(tmp_path, {}) as results:
            facts = dict(friction(results))
        assert facts["to the left"] == quantity(round(side[1], 6), "N")
        assert len(facts) == 4
        assert np.allclose(static["surface/pull"][:].sum(axis=0), side)
        assert np.allclose(static["contact/force"][:].sum(axis=0), [*side, 800.0], rtol=1e-6)
        assert static.attrs["travel"] == static.attrs["rolling_radius"]
        assert side[1] < -50.0 and abs(side[0]) < 0.3 * abs(side[1])
        for name in ("total_force", "axle_force"):
            assert np.allclose(loop[name][:], [*side, 800.0], rtol=1e-5, atol=1e-3), name
        pull = loop["horizontal_force"][:]
        assert np.allclose(pull[0], pull[-1])
        size = np.linalg.norm(pull[0], axis=1)
        assert (size <= 0.7 * 1.3 * loop["normal_force"][0] + 1e-9).all()


@pytest.mark.long
def test_nothing_moves_on_a_tilted_drum_either(tmp_path) -> None:
    """Camber thrust and the drum's forces stand in the loop as in the static state, on the axle too."""
    more = ["static.camber=3", "road.drum_radius=0.85", "rotation.slip_angle=0"]
    (tmp_path / "scene.toml").write_text(SCENE.format(points="{ dx = 0.008, dy = 0.008 }"))
    scene = load(tmp_path / "scene.toml", more)
    run_scene(scene, tmp_path, MPI.COMM_SELF, until="contact", fresh=False, petsc_options=[])
    with h5py.File(tmp_path / "static.h5") as static, h5py.File(tmp_path / "contact.h5") as loop:
        push = static["contact/force"][:].sum(axis=0)
        up = np.array([0.0, *np.sin(np.radians([3.0, 93.0]))])
        assert push @ up == pytest.approx(800.0, rel=1e-8)
        # Leaning to the right the tire is pushed to the right, against what the tilt alone does (tan 3 deg).
        side = static.attrs["horizontal_force"]
        assert side[1] < -30.0 and push[1] < 800.0 * np.tan(np.radians(3.0)) - 30.0
        assert abs(push[0]) < 1e-4 * 800.0
        for name in ("total_force", "axle_force"):
            force = loop[name][:]
            assert np.ptp(force, axis=0).max() < 1e-3
        assert np.allclose(loop["axle_force"][0], push, atol=0.01 * 800.0)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("contact.brush_stiffness_per_area=1e8", "keep one of them"),
        ("static.friction=-1", "≥ 0"),
    ],
)
def test_what_does_not_go_together(tmp_path, more, said) -> None:
    (tmp_path / "scene.toml").write_text(SCENE.format(points='"nodes"'))
    with pytest.raises(InputError, match=said):
        load(tmp_path / "scene.toml", [more])
