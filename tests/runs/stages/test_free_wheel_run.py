"""A run whose wheel turns freely: drag, energy and moment add up, it resumes, and error bars know it."""

import json

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.greens import recursion
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.process.signals import Stopped
from tireroad.runs.scene.load import load
from tireroad.runs.stages import contact

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "turns"
"""
    + soft_torus(20, 8, footprint_size=0.4)
    + """[static]
load = 400.0
error_estimate = false
[modal]
count = 30
[rotation]
speed = 40.0
wheel = "free"
[axle]
wheel_inertia = [0.1, 0.2, 0.1]
[contact]
points = { dx = 0.008, dy = 0.008 }
reach = 0.004
[road]
kind = "sine"
amplitude = 2e-4
wavelength = 0.1
run_in = 0.05
[time]
duration = 0.2
step = 2e-4
scheme = "linear"
"""
)
INERTIA, STEP = 0.2, 2e-4


@pytest.fixture
def run(tmp_path):
    """A run of the scene with keys changed: its folder. Collective."""
    base = MPI.COMM_WORLD.bcast(tmp_path)
    if MPI.COMM_WORLD.rank == 0:
        (base / "scene.toml").write_text(SCENE)
    MPI.COMM_WORLD.Barrier()

    def started(name: str, *sets: str, until: str = "contact", comm=MPI.COMM_SELF):
        scene = load(base / "scene.toml", list(sets))
        (base / name).mkdir(exist_ok=True)
        with console.quiet():
            run_scene(scene, base / name, comm, until=until, fresh=False, petsc_options=[])
        return base / name

    return started


def datasets(folder) -> dict[str, np.ndarray]:
    names = ("axle_force", "total_force", "hub_moment", "wheel/spin")
    with h5py.File(folder / "contact.h5") as file:
        return {name: file[name][:] for name in names if name in file}


def told_by(folder, stage: str = "contact") -> dict:
    return json.loads((folder / "summary.json").read_text())["stages"][stage]


def test_moment_and_energy_add_up_and_nothing_drives_the_wheel(run) -> None:
    folder = run("free")
    found, told = datasets(folder), told_by(folder)["indicators"]
    spin, moment = found["wheel/spin"], found["hub_moment"][:, 1]
    turned = np.cumsum(0.5 * STEP * (moment[1:] + moment[:-1]))
    off = spin[1:] - spin[0] - turned / INERTIA
    # The drive of steady rolling bears what the search of free rolling has left, 1e-4 of the load.
    drift = np.polyfit(np.arange(len(off)), off, 1)
    assert np.abs(off - np.polyval(drift, np.arange(len(off)))).max() < 1e-3 * np.ptp(spin)
    assert abs(drift[0]) / STEP * INERTIA < 2e-4 * 400.0 * 0.3
    still = run("held", "rotation.wheel=held")
    held, before = datasets(still), told_by(still)["indicators"]
    off, known = (one["energy that does not add up"]["value"] for one in (told, before))
    assert abs(off) < 1.2 * abs(known) < 5e-3 * told["energy lost in the material"]["value"]
    assert abs(told["work of the free wheel's inertia on the tire"]["value"]) > 0.1 * abs(known)
    assert "wheel/spin" not in held
    mean, dragged = (one["axle_force"][-500:, 0].mean() for one in (found, held))
    assert abs(mean) < 0.3 * abs(dragged)  # the wheel at a given rate is dragged by the wavy road


def test_a_heavy_wheel_is_held(run) -> None:
    heavy = datasets(run("heavy", "axle.wheel_inertia=[1.0,1e6,1.0]", "time.duration=0.04"))
    held = datasets(run("held", "rotation.wheel=held", "time.duration=0.04"))
    for name in ("axle_force", "hub_moment"):
        varies = np.ptp(held[name], axis=0).max()
        assert np.abs(heavy[name] - held[name]).max() < 2e-3 * varies, name
    assert np.abs(heavy["wheel/spin"]).max() < 1e-5


def test_it_goes_on_from_a_checkpoint_to_the_same_bits(run, monkeypatch) -> None:
    sets = ("time.duration=0.08",)
    whole = datasets(run("whole", *sets))
    calls, old = [], contact.Watch.__call__

    def once(watch, asked):
        calls.append(asked)
        return ("SIGTERM", True) if len(calls) == 2 else old(watch, asked)

    with monkeypatch.context() as patch:
        patch.setattr(contact.Watch, "__call__", once)
        with pytest.raises(Stopped):
            run("stopped", *sets)
    again = datasets(run("stopped", *sets))
    assert len(calls) == 2
    for name, values in whole.items():
        assert np.array_equal(again[name], values), name


@pytest.mark.long
def test_error_bars_of_a_free_wheel(run) -> None:
    folder = run("bars", until="accuracy")
    with h5py.File(folder / "accuracy.h5") as file:
        for cause in ("step", "points", "modes", "mesh"):
            assert np.isfinite(file[f"axle_force/{cause}/history"][:]).all(), cause
    assert not told_by(folder, "accuracy").get("warnings")


@pytest.mark.mpi
def test_processes_that_share_the_states_turn_it_alike(run, monkeypatch) -> None:
    alone = datasets(run("alone", "time.duration=0.02")) if MPI.COMM_WORLD.rank == 0 else None
    alone = MPI.COMM_WORLD.bcast(alone)
    monkeypatch.setattr(recursion, "SHARED_FROM", 0.0)
    shared = datasets(run("shared", "time.duration=0.02", comm=MPI.COMM_WORLD))
    # Later on friction makes much of the rounding of several processes.
    for name, values in alone.items():
        off, size = np.abs(shared[name] - values), np.ptp(values, axis=0).max()
        assert off.max() < 0.05 * size and off[:20].max() < 1e-4 * size, name


@pytest.mark.parametrize(
    ("sets", "wanted"),
    [
        (("greens.dynamic=10",), "greens.dynamic"),
        (("time.scheme=convolution",), "a convolution"),
        (("output.axle_force=false",), "output.axle_force"),
        (("contact.friction=0",), None),  # nothing turns it
    ],
)
def test_what_holds_it_is_said(run, sets, wanted) -> None:
    folder = run("still", "time.duration=0.01", *sets)
    assert "wheel/spin" not in datasets(folder)
    said = [text for text in told_by(folder)["warnings"] if "rate of rotation is held" in text]
    assert (len(said) == 1 and wanted in said[0]) if wanted else not said


@pytest.mark.long
def test_stretches_of_road_turn_it_too(run) -> None:
    """Their mean force along the road is small as the run's, not that of a wheel that is held."""
    rough = (
        "road.kind=iso8608", "road.amplitude=", "road.wavelength=", "road.shortest_wave=0.05", "road.longest_wave=0.5",
        "road.road_class=A", "road.seed=3", "contact.reach=0.006", "accuracy.estimate=false", "accuracy.chance_db=3.0",
    )  # fmt: skip
    means = []
    for wheel in ("free", "held"):
        folder = run(wheel, *rough, f"rotation.wheel={wheel}", until="stretches")
        with h5py.File(folder / "stretches.h5") as file:
            means.append(np.abs(file["axle_force"][:, :, 0].mean(axis=1)))
    assert means[0].max() < 0.3 * means[1].max()
