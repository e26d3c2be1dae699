"""Further stretches of road: how many, which, and what the levels make of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.contact.results import chance
from tireroad.contact.results.spectra import confidence, third_octaves
from tireroad.contact.roads.kinds.iso8608 import Iso8608
from tireroad.contact.roads.kinds.shapes import Cleat, Flat
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.stages.stretches import StretchPlan, _with_room, stretches

SCENE = (
    """
name = "chance"
"""
    + soft_torus(20, 6, footprint_size=0.4)
    + """[static]
load = 400.0
error_estimate = false
[modal]
count = 30
[rotation]
speed = 40.0
[contact]
points = { dx = 0.01, dy = 0.01 }
reach = 0.006
friction = 0.0
[road]
kind = "iso8608"
shortest_wave = 0.05
longest_wave = 0.5
road_class = "A"
seed = 3
run_in = 0.05
[time]
duration = 0.2
step = 2e-4
[accuracy]
estimate = false
chance_db = 3.0
"""
)


def finished(folder, comm, *sets):
    """A run of the scene in a folder; the parts it leaves."""
    if comm.rank == 0:  # another process could read what is half written
        folder.mkdir(exist_ok=True, parents=True)
        (folder / "given.toml").write_text(SCENE)
    comm.Barrier()
    with console.quiet():
        scene = load(folder / "given.toml", list(sets))
        return run_scene(scene, folder, comm, until="spectra", fresh=False, petsc_options=[])


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chance")
    return folder, finished(folder, MPI.COMM_SELF)


@pytest.mark.slow
def test_bands_are_within_what_was_asked_and_pooled_over_all_windows(run):
    folder, done = run
    history, more = done.done["contact"].product, done.done["stretches"].product
    with h5py.File(folder / "spectra.h5") as file:
        levels = {name: held[()] for name, held in file["third_octave"].items()}
        start, limit = round(file.attrs["left_out"] / history.step), file.attrs["limit"]
    asked = chance.asked(1 / (more.length * history.step), limit)
    sure = levels["confidence"][-len(asked) :]
    assert len(asked) and np.abs(sure).max() <= 3.0
    assert levels["windows"].tolist() == list(more.held) and len(more.held) == 3
    own = history.total_force[start:]
    assert more.length == len(own)
    records = [own, *more.contact_force]
    every = [
        third_octaves(window, history.step, limit)[1]
        for record in records
        for window in chance.windows(record, len(own))
    ]
    by_hand = 10 * np.log10(np.mean(10 ** (np.array(every) / 10), axis=0))
    np.testing.assert_allclose(levels["contact_level"], by_hand, atol=1e-9)
    spacing = 1 / (len(own) * history.step)
    degrees = chance.freedom(levels["centre"], spacing, more.held)
    np.testing.assert_allclose(levels["confidence"], confidence(degrees))
    assert levels["contact_level_spread"].shape == (*by_hand.shape, 2)
    assert (levels["contact_level_spread"][..., 2, 0] < 0).all()


@pytest.mark.slow
def test_stretches_are_other_samples_and_like_the_run(run):
    """No two agree (correlation below a half in 0.2 s), their deviations are those of one road within chance."""
    _, done = run
    history, more = done.done["contact"].product, done.done["stretches"].product
    own = history.total_force[-more.length :, 2]
    parts = [own, *(force[: more.length, 2] for force in more.contact_force)]
    assert np.abs(np.corrcoef(parts) - np.eye(3)).max() < 0.5
    deviations = np.std(parts, axis=1)
    assert deviations.max() < 2.5 * deviations.min()
    means = np.mean(parts, axis=1)
    assert np.ptp(means) < 0.02 * means.mean()


@pytest.mark.slow
def test_a_shape_has_no_chance_and_is_run_over_once(tmp_path):
    done = finished(tmp_path, MPI.COMM_SELF, 'road={kind="sine",wavelength=0.1,amplitude=1e-4}')
    assert "stretches" not in done.done and not (tmp_path / "stretches.h5").exists()
    with h5py.File(tmp_path / "spectra.h5") as file:
        assert "confidence" not in file["third_octave"] and "level" in file["third_octave"]


@pytest.mark.slow
@pytest.mark.mpi
def test_each_process_rolls_over_its_own_and_finds_what_one_would(tmp_path_factory):
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("processes"))
    together = finished(folder / "together", comm).done["stretches"].product
    alone = finished(folder / f"alone-{comm.rank}", MPI.COMM_SELF).done["stretches"].product
    assert together.length == alone.length
    np.testing.assert_allclose(together.contact_force, alone.contact_force, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(together.hub_moment, alone.hub_moment, rtol=1e-6, atol=1e-3)


def test_another_sample_has_a_seed_of_its_own():
    """No seed of a user's own sweep, 0 to 999, and none of another member's."""
    drawn = {
        Iso8608(seed=seed).another(number).seed for seed in range(50) for number in range(1, 20)
    }
    assert len(drawn) == 50 * 19 and min(drawn) > 999
    assert Iso8608(seed=4).another(2) == Iso8608(seed=4).another(2)
    assert Cleat().another(1) is None


def measured(length: float):
    """A road of so many metres, from a file, as `stretches` sees it: placed, and with the setup of a run of 0.2 s at 20 m/s."""

    class Surface:
        kind, sampled, start = "grid", True, None
        measured = (0.0, length)
        extent = (0.0, length), (-1.0, 1.0)

        def another(self, number):
            return None

        def make(self):
            return self

    rolled = SimpleNamespace(speed=20.0, travel=4.0)
    patch = SimpleNamespace(extent=(-0.1, 0.1, -0.1, 0.1))
    return Surface(), SimpleNamespace(rolled=rolled, patch=patch)


@pytest.mark.parametrize(
    ("length", "stretches_", "windows"),
    [(200.0, 2, 10), (34.0, 1, 13), (12.0, 1, 2), (9.0, 1, 1), (8.0, 0, 0)],
)
def test_a_measured_road_has_as_many_windows_as_its_rest_has_room_for(
    monkeypatch, length, stretches_, windows
):
    """The run ends at 4.1 m, with its patch; a window is 4 m, its half 2 m, a run-in and a patch 0.2 m each."""
    surface, setup = measured(length)
    road = SimpleNamespace(surface=surface, start=0.0, drum_radius=None, run_in=0.1, kind="grid")
    module = "tireroad.runs.stages.stretches"
    monkeypatch.setattr(f"{module}.road_of", lambda given: given)
    monkeypatch.setattr(f"{module}.run_in", lambda *_: 0.01)
    found = _with_room(road, setup, StretchPlan(2, 10), 2000, 1e-4)
    assert (found.stretches, found.windows) == (stretches_, windows)
    on_a_drum = SimpleNamespace(**vars(road) | {"drum_radius": 0.8})
    assert _with_room(on_a_drum, setup, StretchPlan(2, 10), 2000, 1e-4).stretches == 0


class Slope(Flat):
    """A road whose height tells where it is: z = x / 1000."""

    def height(self, x, y):
        return 1e-3 * np.asarray(x)

    def highest(self, x0, x1, y0, y1):
        return 1e-3 * x1

    def lowest(self, x0, x1, y0, y1):
        return 1e-3 * x0


@pytest.mark.slow
def test_stretches_of_a_road_that_is_not_drawn_follow_the_run(run):
    """One behind the other, with the length of a footprint between them."""
    _, done = run
    setup, road = done.setup, replace(done.job.scene.road, kind="flat", surface=Slope(), start=2.0)
    x0, x1, _, _ = setup.patch.extent
    travel = 0.5 * setup.rolled.speed
    found = list(stretches(road, setup, StretchPlan(2, 3), 0.5))
    for number, one in enumerate(found):
        assert one.rolled.duration == 0.5
        begun = 2.0 + setup.rolled.travel + x1 - x0 + number * (travel + x1 - x0)
        ahead = x1 + np.array([0.6, 0.9]) * travel
        np.testing.assert_allclose(one.road.height(ahead, np.zeros(2)), 1e-3 * (begun + ahead))
    assert len(found) == 2
