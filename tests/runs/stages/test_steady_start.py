"""A run with friction begins as the tire rolls steadily: on a smooth road its forces stay what they are from the start."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.runs.pipeline import run_scene
from tireroad.runs.scene.load import load
from tireroad.runs.stages import contact

SCENE = (
    soft_torus(20, 6)
    + """[static]
load = 800.0
error_estimate = false
[modal]
count = 40
[damping]
mass = 400.0
[rotation]
speed = 40.0
[contact]
points = { dx = 0.008, dy = 0.008 }
tread = "layer"
youngs_modulus = 1e7
reach = 0.01
[road]
kind = "flat"
[time]
duration = 0.02
[accuracy]
estimate = false
"""
)


def forces(ran, folder, *changes: str):
    """Forces (n, 3) N of the road and the figures of the stage."""
    (folder / "scene.toml").write_text(SCENE)
    sets = [part for change in changes for part in ("--set", change)]
    ran(folder / "scene.toml", folder / "out", "--until", "contact", *sets)
    with h5py.File(folder / "out" / "contact.h5") as file:
        total, axle, slip = file["total_force"][:], file["axle_force"][:], file.attrs["free_slip"]
    stages = json.loads((folder / "out" / "summary.json").read_text())["stages"]
    return total, axle, float(slip), stages["contact"]["indicators"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        (),
        ("rotation.slip_angle=1.0",),
        ("contact.slip=[-0.01, 0.0]",),
        ("static.camber=3.0",),
        ("contact.loss_factor=0.3",),
    ],
    ids=["freely", "at an angle", "braked", "cambered", "on a tread with losses"],
)
def test_forces_on_a_smooth_road_stay(ran, tmp_path, changes) -> None:
    """The steps of the steady state are a point long, those of the loop a fifth: half a per cent of the load lies between.

    Freely rolling, the damping of 400 1/s drags the tire by 2 N: without driving it the road has no moment about the axle."""
    total, axle, slip, _ = forces(ran, tmp_path, *changes)
    for found in (total, axle):
        assert np.ptp(found, axis=0).max() < 0.02 * 800.0
    mean = total.mean(axis=0)
    if "contact.slip=[-0.01, 0.0]" in changes:
        assert mean[0] < -100.0
    else:
        assert -1e-2 * 800.0 < mean[0] < 0
    assert (abs(mean[1]) > 50.0) == ("rotation.slip_angle=1.0" in changes)
    assert 0 < abs(slip) < 0.02


@pytest.mark.long
def test_that_is_where_a_run_from_rest_arrives(ran, tmp_path, monkeypatch) -> None:
    """At an angle, begun at rest with the same slip, after as many relaxation lengths as it needs."""
    angle = "rotation.slip_angle=1.0"
    begun, _, slip, _ = forces(ran, tmp_path, angle)
    steadily = contact.rolling_steadily
    monkeypatch.setattr(
        contact, "rolling_steadily", lambda *given: replace(steadily(*given), steady=None)
    )
    scene = load(tmp_path / "scene.toml", [angle, "time.duration=0.2"])
    (tmp_path / "rest").mkdir()
    run_scene(
        scene, tmp_path / "rest", MPI.COMM_WORLD, until="contact", fresh=False, petsc_options=[]
    )
    with h5py.File(tmp_path / "rest" / "contact.h5") as file:
        later = file["total_force"][:]
    assert abs(later[0, 1]) < 0.2 * abs(begun[0, 1])
    assert later[-100:].mean(axis=0) == pytest.approx(begun[-100:].mean(axis=0), abs=0.01 * 800.0)
