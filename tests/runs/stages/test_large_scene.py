"""Large motions of a scene: trained on its road, used by the loop, told in its results; refused in words; alike on any processes."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.errors import InputError
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process.signals import Stopped
from tireroad.runs.report.page import write_report
from tireroad.runs.results.datasets import declared
from tireroad.runs.scene.load import load
from tireroad.runs.scene.rules import remarks
from tireroad.runs.stages import contact

COMM = MPI.COMM_WORLD
SCENE = """
name = "large"
[tire]
segments = 12
elements_arc = 4
order = 2
[tire.material]
youngs_modulus = 2e7
[static]
inflation = 2e5
load = 900.0
error_estimate = false
[modal]
count = 60
[damping]
mass = 200.0
[contact]
points = { dx = 0.01, dy = 0.02 }
youngs_modulus = 1e7
friction = 0.5
[time]
step = 2e-4
duration = 0.04
[accuracy]
estimate = false
"""
CLEAT = """
[rotation]
speed = 20.0
[road]
kind = "cleat"
height = 0.008
length = 0.04
ramp = 0.015
position = 0.17
run_in = 0.0
"""
LARGE = '[motion]\nkind = "large"\n'
CORNER = '[axle]\nkind = "corner"\nlocked = ["x", "y", "rx", "ry", "rz"]\n'
AIR = '[tire.cavity]\ngas = "air"\n'


def run(folder: Path, text: str, comm=MPI.COMM_SELF, until="spectra", fresh=False):
    """The folder with results of a scene, and the stages of its summary."""
    folder = comm.bcast(folder)
    path = folder.parent / f"{folder.name}.toml"
    if comm.rank == 0:
        path.write_text(text)
    comm.Barrier()
    scene = load(path)
    run_scene(scene, folder, comm, until=until, fresh=fresh, petsc_options=[])
    return folder, json.loads((folder / "summary.json").read_text())["stages"]


def forces(folder: Path) -> np.ndarray:
    with h5py.File(folder / "contact.h5") as file:
        return file["total_force"][:]


def value(stages, stage: str, name: str):
    entry = stages[stage]
    return (entry["headline"] | entry["indicators"])[name]["value"]


@pytest.fixture(scope="module")
def cleat(tmp_path_factory):
    base = tmp_path_factory.mktemp("cleat")
    return run(base / "linear", SCENE + CLEAT), run(base / "large", SCENE + CLEAT + LARGE)


@pytest.mark.slow
def test_a_cleat_trains_the_tire_and_changes_its_forces(cleat):
    (straight, told), (large, stages) = cleat
    assert told["nonlinear"]["status"] == "skipped"
    assert not (straight / "nonlinear.h5").exists()
    assert stages["nonlinear"]["status"] == "computed"
    assert value(stages, "nonlinear", "force of the run left out") < 5.0
    with h5py.File(large / "nonlinear.h5") as file:
        assert 3 < file["shape"].shape[2] <= 160
        assert file.attrs["outside"] < 0.2  # of a state, four vectors
        for name, held in file.items():
            if isinstance(held, h5py.Group):
                assert all(declared("nonlinear.h5", f"{name}/{one}") for one in held)
                continue
            known = declared("nonlinear.h5", name)
            assert known and (known.unit, known.shape.count(",") + 1) == (
                held.attrs["unit"],
                held.ndim,
            )
    assert value(stages, "contact", "motion") == "large"
    linear, found = forces(straight)[:, 2], forces(large)[:, 2]
    rise = np.abs(linear - linear[0]).max()
    assert 0.03 * rise < np.abs(found - linear).max() < 0.5 * rise
    # Before the cleat both tires roll on a level road.
    before = slice(0, 20)
    assert np.abs(found - linear)[before].max() < 0.01 * linear[0]


@pytest.mark.slow
def test_energy_closes_and_the_motion_stays_in_the_training(cleat):
    _, (large, stages) = cleat
    moved = abs(value(stages, "contact", "work of contact on the tire"))
    assert abs(value(stages, "contact", "energy left in the nonlinear force")) > 1e-6 * moved
    assert abs(value(stages, "contact", "energy that does not add up")) < 0.01 * moved
    assert value(stages, "contact", "force left out by the nonlinear training") < 10.0
    write_report(large)
    assert "the nonlinear training leaves out" in (large / "report.html").read_text(
        encoding="utf-8"
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "more", ["", AIR, CORNER, AIR + CORNER], ids=["held", "air", "corner", "both"]
)
def test_without_the_nonlinear_force_it_is_the_linear_tire(tmp_path, more):
    """The response to forces of the road, of points and of the hub, is that of the linear Green's functions."""
    folder, _ = run(tmp_path / "large", SCENE + CLEAT + more + LARGE, until="nonlinear")
    with h5py.File(folder / "greens.h5") as one, h5py.File(folder / "nonlinear.h5") as other:
        groups = one["contact"], other["response"]
        linear, large = ({name: held[:] for name, held in group.items()} for group in groups)
    rows, columns = linear["residual"].shape
    k = large["residual"].shape[1] - columns
    seen = np.r_[0:columns, columns + k : rows + k]
    assert k > 3
    assert np.array_equal(large["eigenvalue"], linear["eigenvalue"])
    for name, found in (("output", large["output"][seen]), ("input", large["input"][:, :columns])):
        assert np.allclose(found, linear[name], rtol=0, atol=1e-9 * abs(linear[name]).max())
    found, wanted = large["residual"][seen][:, :columns], linear["residual"]
    # Readings of the hub have other units than those of the points.
    for some in (slice(0, columns), slice(columns, None)):
        assert np.allclose(found[some], wanted[some], rtol=0, atol=1e-6 * abs(wanted[some]).max())
    if "left_out" in linear:  # not with air
        assert np.allclose(large["left_out"][:, :columns], linear["left_out"], atol=1e-9)


@pytest.mark.slow
def test_a_small_road_changes_nothing(tmp_path):
    small = SCENE.replace("[time]", '[time]\nscheme = "damped"') + CLEAT.replace("0.008", "0.0005")
    found = [
        forces(run(tmp_path / name, small + kind)[0]) for name, kind in (("a", ""), ("b", LARGE))
    ]
    size, change = np.abs(found[0] - found[0][0]).max(), np.abs(found[1] - found[0])
    assert change.max() > 1e-4 * size
    assert change.max() < 2e-3 * found[0][0, 2]
    assert np.sqrt(np.mean(change**2)) < 0.03 * np.sqrt(np.mean((found[0] - found[0][0]) ** 2))


@pytest.mark.slow
def test_auto_takes_what_the_road_asks_for(tmp_path):
    auto = '[motion]\nkind = "auto"\n'
    _, low = run(
        tmp_path / "low", SCENE + CLEAT.replace("0.008", "0.001") + auto, until="nonlinear"
    )
    assert low["nonlinear"]["status"] == "skipped"
    assert "takes a linear tire" in low["nonlinear"]["reason"]
    _, high = run(tmp_path / "high", SCENE + CLEAT + auto, until="nonlinear")
    assert high["nonlinear"]["status"] == "computed"
    attached = '[greens]\nresidual = "attachment"\n'
    _, other = run(tmp_path / "other", SCENE + CLEAT + auto + attached, until="nonlinear")
    assert "greens.residual" in other["nonlinear"]["reason"]


@pytest.mark.slow
def test_error_bars_compare_linear_companions_with_a_linear_run(tmp_path):
    """They are those of the linear tire with the same scheme, not its difference from the nonlinear one."""
    text = SCENE.replace("[time]", '[time]\nscheme = "damped"').split("[accuracy]")[0]
    found = []
    for name, kind in (("straight", ""), ("large", LARGE)):
        folder, _ = run(tmp_path / name, text + CLEAT + kind, until="accuracy")
        with h5py.File(folder / "accuracy.h5") as file:
            causes = file["contact_force"]
            found.append({c: causes[f"{c}/deviation"][:] for c in causes})
    assert found[0].keys() == found[1].keys() >= {"step", "points"}
    for cause, bar in found[0].items():
        assert np.allclose(found[1][cause], bar, rtol=1e-6, atol=1e-6 * np.abs(bar).max())


class StopsOnce:
    """In place of the loop's watch: stops after a block."""

    left = 1

    def __init__(self, comm, every):
        pass

    def __call__(self, asked):
        StopsOnce.left -= 1
        return ("SIGTERM" if StopsOnce.left == 0 else ""), False


@pytest.mark.slow
def test_it_goes_on_from_a_checkpoint_with_the_same_bits(cleat, tmp_path, monkeypatch):
    _, (whole, stages) = cleat
    monkeypatch.setattr(contact, "Watch", StopsOnce)
    StopsOnce.left = 2
    with pytest.raises(Stopped):
        run(tmp_path / "broken", SCENE + CLEAT + LARGE)
    folder, told = run(tmp_path / "broken", SCENE + CLEAT + LARGE)
    assert StopsOnce.left < 0
    with h5py.File(whole / "contact.h5") as one, h5py.File(folder / "contact.h5") as other:
        for name in ("total_force", "normal_force", "horizontal_force", "axle_force", "hub_moment"):
            assert np.array_equal(one[name][:], other[name][:])
    for name in ("energy left in the nonlinear force", "evaluations of the reduced force a step"):
        assert value(told, "contact", name) == value(stages, "contact", name)
    outside = [
        value(s, "contact", "force left out by the nonlinear training") for s in (stages, told)
    ]
    assert outside[1] == pytest.approx(outside[0], rel=1e-6)


@pytest.mark.slow
@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(tmp_path_factory):
    base = COMM.bcast(tmp_path_factory.mktemp("several") if not COMM.rank else None)
    several, stages = run(base / "several", SCENE + CLEAT + LARGE, COMM)
    alone = None
    if not COMM.rank:
        alone = forces(run(base / "alone", SCENE + CLEAT + LARGE)[0])
        found = forces(several)
        # The trainings differ by what their states are solved to.
        assert np.abs(found - alone).max() < 5e-3 * np.abs(alone).max()
    COMM.Barrier()


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('[greens]\nresidual = "attachment"\n', "greens.residual"),
        ("[greens]\ndynamic = 20\n", "greens.dynamic"),
        ('[time]\nscheme = "convolution"\n', "time.scheme"),
        ("[road]\ndrum_radius = 1.5\n", "road.drum_radius"),
        ("[output]\nvibration = true\n", "output.vibration"),
        ("[accuracy]\nchance_db = 1.0\n", "accuracy.chance_db"),
    ],
)
def test_what_it_does_not_have_is_refused(tmp_path, more, told):
    path = tmp_path / "refused.toml"
    head = more.split("\n")[0]
    text = SCENE + CLEAT + LARGE
    text = text.replace(f"{head}\n", more) if head in text else text + more
    path.write_text(text)
    with pytest.raises(InputError, match=told):
        load(path)


def test_check_tells_that_its_training_takes_time(tmp_path):
    path = tmp_path / "checked.toml"
    path.write_text(SCENE + CLEAT + LARGE)
    assert any("their training" in note for note in remarks(load(path)))
    path.write_text(SCENE + CLEAT)
    assert not any("training" in note for note in remarks(load(path)))


def test_without_a_loop_it_is_refused(tmp_path):
    path = tmp_path / "refused.toml"
    path.write_text(SCENE.split("[contact]")[0] + LARGE)
    with pytest.raises(InputError, match="motion.kind"):
        load(path)
