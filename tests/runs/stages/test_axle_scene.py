"""A wheel that moves through all stages: limits, what is written and told, what is reused and refused."""

import json
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import axle_of
from tireroad.runs.stages import corner

SCENE = (
    soft_torus(20, 6)
    + """[static]
load = 500.0
error_estimate = false
[modal]
count = 60
[rotation]
speed = 50.0
[contact]
points = "nodes"
youngs_modulus = 1e7
reach = 0.02
[road]
kind = "sine"
amplitude = 0.5e-3
wavelength = 0.2
[time]
duration = 0.04
step = 2e-4
"""
)
POINT_FORCE = (
    soft_torus(12, 5)
    + """[modal]
count = 20
[[force]]
angle = 40.0
arc = 10.0
amplitude = 10.0
frequency = 40.0
direction = [0.3, 1.0, 1.0]
[time]
duration = 0.03
step = 5e-4
"""
)
CAR = """
[axle]
kind = "corner"
body_mass = 300.0
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    base = tmp_path_factory.mktemp("axle")
    folder = base / "wheel"

    def started(text, *options, status=0):
        scene = base / "wheel.toml"
        scene.write_text(f'name = "wheel"\n{text}')
        summary = ran(scene, folder, *options, status=status)[1]
        with h5py.File(folder / "contact.h5") as file:
            names: list[str] = []
            file.visit(names.append)
            kept = {n: file[n][:] for n in names if isinstance(file[n], h5py.Dataset)}
        return kept, summary, folder

    return started


@pytest.mark.long
def test_corner_free_wheel_and_the_fixed_axle_as_its_limit(run):
    """In one folder, so that what does not depend on the axle is computed once."""
    car, summary, folder = run(SCENE + CAR)
    wheel, body = car["wheel/translation"], car["body/height"]
    assert car["hub_moment"].shape == wheel.shape == (200, 3)
    assert np.abs(wheel[:, :2]).max() == 0.0
    # The hub's force is that of its spring and damper, here by differences over two steps.
    stretch = wheel[:, 2] - body
    rate = np.gradient(stretch, car["time"])
    spring = 500.0 + 25e3 * stretch + 2.4e3 * rate
    change = np.ptp(car["axle_force"][:, 2])
    assert np.abs(spring - car["axle_force"][:, 2])[2:-2].max() < 0.01 * change
    # Of the force on the hub the body alone has the change: m_b times its acceleration.
    share = np.gradient(np.gradient(body, car["time"]), car["time"])[3:-3]
    assert 300.0 * share == pytest.approx(car["axle_force"][3:-3, 2] - 500.0, abs=0.02 * change)
    told = summary["greens"]["indicators"]
    off = [v["value"] for k, v in told.items() if "blocked force" in k]
    assert off
    assert off[0] < 1e-6
    assert "Wheel and body" in (folder / "report.html").read_text()
    with h5py.File(folder / "spectra.h5") as file:
        assert file["wheel/translation"].shape == file["axle_force"].shape
        assert file["body/height"].attrs["unit"] == "m"

    short = ("--until", "contact")
    limit = ("axle.stiffness=[0,0,1e15,0,0,0]", "axle.body_mass=")
    # Turns of friction end at 1e-3 of the bound: rounding may end them earlier or later.
    for friction, allowed in ((0.0, 1e-6), (1.0, 2e-4)):
        rubs = f"--set=contact.friction={friction}"
        stiff, again, _ = run(SCENE + CAR, *(f"--set={one}" for one in limit), rubs, *short)
        assert again["modes"]["status"] == "reused"
        fixed, _, _ = run(SCENE, rubs, *short)
        for name in ("axle_force", "total_force", "hub_moment"):
            vary = np.ptp(fixed[name], axis=0).max()
            assert np.abs(stiff[name] - fixed[name]).max() < allowed * vary, name
    assert np.abs(car["hub_moment"] - fixed["hub_moment"]).max() > 0.01 * vary

    free, _, _ = run(SCENE + '[axle]\nkind = "free"\n', *short)
    # As constant as rounding leaves it, at the load to which the state at rest was found.
    assert free["axle_force"][:, 2] == pytest.approx(500.0, rel=1e-10)
    assert np.ptp(free["axle_force"][:, 2]) < 1e-12 * 500.0
    assert np.ptp(free["total_force"][:, 2]) > 1.0


@pytest.mark.parametrize(
    ("axle", "told"),
    [
        ("stiffness = [0, 0, 0, 0, 0, 0]", "carries the static load: the corner is unstable"),
        ('locked = ["x", "y", "ry", "rz"]', "no spring along rx"),
        ("stiffness = [1, 2, 3]", "6 numbers"),
        ("stiffness = [0, 0, -1.0, 0, 0, 0]", "symmetric and positive semidefinite"),
        ('locked = ["w"]', "must be a list of x, y, z"),
        ('body_mass = 3.0\nlocked = ["x", "y", "z", "rx", "rz"]', "no part where z is locked"),
        ('body_mass = 3.0\n[modal]\nrim = "free"\n[damping]\nmass = 0.0', "massless|without mass"),
        (
            '[modal]\nroad = "held"',
            'keeps the wheel of axle.kind = "corner" where it is: take modal.road = "forces"',
        ),
    ],
)
def test_a_corner_that_cannot_be_is_refused(tmp_path, axle, told):
    scene = tmp_path / "bad.toml"
    text = SCENE if "[modal]" not in axle else SCENE.replace("[modal]\ncount = 60\n", "")
    scene.write_text(text + f'[axle]\nkind = "corner"\n{axle}\n')
    with pytest.raises(InputError) as error:
        load(scene)
    assert any(one in str(error.value) for one in told.split("|"))


def test_springs_are_a_diagonal_or_a_matrix(tmp_path):
    scene = tmp_path / "good.toml"
    rows = np.diag([0, 0, 2e4, 0, 0, 0]).tolist()
    scene.write_text(SCENE + f'[axle]\nkind = "corner"\nstiffness = {rows}\n')
    one = load(scene)
    scene.write_text(SCENE + '[axle]\nkind = "corner"\nstiffness = [0, 0, 2e4, 0, 0, 0]\n')
    assert (axle_of(one).stiffness == axle_of(load(scene)).stiffness).all()


@pytest.mark.long
def test_a_travel_speed_is_the_speed_over_the_road(tmp_path, launch):
    """The wheel's speed times the rolling radius of the state that rolls at it; written back, and told once only."""
    scene, folder = tmp_path / "wheel.toml", tmp_path / "wheel"
    scene.write_text('name = "wheel"\n' + SCENE.replace("speed = 50.0", "travel_speed = 20.0"))
    done = launch("-m", "runs", "run", scene, "--out", folder, "--until", "static")
    assert done.returncode == 0, done.stderr
    with h5py.File(folder / "static.h5") as file:
        speed, radius = file.attrs["rolling_speed"], file.attrs["rolling_radius"]
    assert speed * radius == pytest.approx(20.0, rel=2e-6)
    assert load(folder / "scene.toml").rotation.travel_speed == 20.0
    stage = json.loads((folder / "summary.json").read_text())["stages"]["static"]
    assert sum(stage["cost"].values()) > 0.8 * stage["seconds"]  # of all solutions, not of the last
    scene.write_text(SCENE.replace("speed = 50.0", "speed = 50.0\ntravel_speed = 20.0"))
    with pytest.raises(InputError, match="twice"):
        load(scene)


@pytest.mark.parametrize(
    ("contact", "told"),
    [
        ('tread = "viscoelastic"', "needs a grid"),
        ('tread = "viscoelastic"\nrelaxation = [0.6, 0.5]', "sum below 1"),
        ("brush_stiffness = 1e4\nbrush_stiffness_per_area = 1e7", "two brushes"),
        ("friction = 0.5\nshear = false", "needs a tread that shears"),
    ],
)
def test_treads_and_brushes_that_cannot_be(tmp_path, contact, told):
    scene = tmp_path / "bad.toml"
    scene.write_text(SCENE.replace('points = "nodes"', f'points = "nodes"\n{contact}'))
    with pytest.raises(InputError, match=told):
        load(scene)


@pytest.mark.parametrize(
    ("change", "known"),
    [
        ("", True),
        ("output.axle_force=false", False),
        ("greens.residual=dirac", True),
        ("rotation.method=full", True),
    ],
)
def test_moments_are_read_where_they_are_known(tmp_path, change: str, known: bool) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    scene = load(tmp_path / "scene.toml", [change] if change else [])
    job = SimpleNamespace(scene=scene, axle=None)
    assert (corner.readings(job) > 0) == known


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 50.0])
def test_the_hub_moment_of_point_forces_is_that_of_a_held_axle_in_the_limit(
    tmp_path, speed
) -> None:
    """On a corner response.h5 had none; on stiff springs it is that of a wheel that is held."""
    (tmp_path / "scene.toml").write_text(POINT_FORCE)
    stiff = 'axle={kind="corner",locked=[],damping=[0,0,0,0,0,0],stiffness=[1e12,1e12,1e12,1e11,1e11,1e11]}'
    found = []
    for name, more in (("held", []), ("corner", [stiff])):
        scene = load(tmp_path / "scene.toml", [f"rotation.speed={speed}", *more])
        with console.quiet():
            run_scene(
                scene,
                tmp_path / name,
                MPI.COMM_SELF,
                until="response",
                fresh=False,
                petsc_options=[],
            )
        with h5py.File(tmp_path / name / "response.h5") as file:
            found.append(file["hub_moment"][:])
    assert np.abs(found[0]).max(axis=0).min() > 1.0
    assert np.abs(found[1] - found[0]).max() < 1e-4


@pytest.mark.long
def test_moments_with_every_residual_in_a_loop(run) -> None:
    """Beside those with attachment modes: as far off as sixty modes are, and none about x and z, which mirror symmetry forbids."""
    short = ("--set=contact.friction=0", "--until", "contact")
    base, _, _ = run(SCENE, "--set=greens.residual=attachment", *short)
    force, moment = (np.ptp(base[name], axis=0).max() for name in ("axle_force", "hub_moment"))
    for change in ("greens.residual=dirac", "rotation.method=full"):
        found, _, _ = run(SCENE, f"--set={change}", *short)
        off = np.abs(found["hub_moment"] - base["hub_moment"]).max(axis=0) / moment
        assert 0 < off[1] < 0.12, change
        assert off[[0, 2]].max() < 1e-4, change  # of the places at which the road is met
        assert np.abs(found["axle_force"] - base["axle_force"]).max() < 0.03 * force, change
