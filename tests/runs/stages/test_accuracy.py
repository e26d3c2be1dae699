"""Error bars of a run: companions that are the runs they stand for, and where the bars go."""

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

from tireroad.contact.results.error_bars import CAUSES, Bars, Relation, bars, measured
from tireroad.contact.results.spectra import wide_enough
from tireroad.contact.tread.kernel import KernelTread
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.greens.basis import Basis
from tireroad.greens.fewer_modes import of_fewer_modes
from tireroad.runs.files.disk import Refused
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.stages import accuracy, contact, rolling
from tireroad.runs.stages.accuracy import (
    Companion,
    ReferenceRun,
    Vibrations,
    _dealt,
    backed,
    coarser,
    coarser_job,
    companions,
)
from tireroad.runs.stages.greens import as_read
from tireroad.runs.stages.replay import PatchForces, on_other_mesh
from tireroad.runs.stages.rolling import ContactForces
from tireroad.runs.stages.setup import points_of
from tireroad.runs.stages.sound import SoundStage
from tireroad.runs.stages.stage import Job

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "sure"
"""
    + soft_torus(20, 8, footprint_size=0.4)
    + """[static]
load = 400.0
error_estimate = false
[modal]
count = 30
[rotation]
speed = 40.0
[contact]
points = { dx = 0.008, dy = 0.008 }
reach = 0.004
[road]
kind = "sine"
amplitude = 2e-4
wavelength = 0.1
run_in = 0.05
[time]
duration = 0.03
step = 1e-4
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of the scene with keys changed, up to a stage: its folder and what it leaves."""
    base = tmp_path_factory.mktemp("accuracy")
    (base / "scene.toml").write_text(SCENE)

    def started(name: str, until: str | None, *sets: str):
        scene = load(base / "scene.toml", list(sets))
        (base / name).mkdir(exist_ok=True)
        with console.quiet():
            return base / name, run_scene(
                scene, base / name, MPI.COMM_SELF, until=until, fresh=False, petsc_options=[]
            )

    return started


@pytest.fixture(scope="module")
def whole(run):
    return run("whole", "spectra")


@pytest.fixture(scope="module")
def frictionless(run):
    return run("frictionless", "spectra", "contact.friction=0")


def contact_force(folder) -> np.ndarray:
    with h5py.File(folder / "contact.h5") as file:
        return file["total_force"][:]


@pytest.mark.long
@pytest.mark.parametrize(
    ("cause", "sets"),
    [
        ("step", ("time.step=2e-4",)),
        ("points", ("time.step=2e-4", "contact.points={dx=0.004,dy=0.004}")),
        ("mesh", ("time.step=2e-4", "tire.segments=10", "tire.elements_arc=4")),
    ],
)
@pytest.mark.parametrize(
    ("friction", "allowed"),
    # The turns of friction end at a residual of 1e-3 of the largest bound: rounding may end them one earlier or later, and
    # then other bristles adhere.
    [(0.0, 1e-8), (1.0, 1e-3)],
)
def test_a_companion_is_the_run_it_stands_for(
    run, whole, frictionless, cause, sets, friction, allowed
):
    given = _given(whole if friction else frictionless)
    other, _ = run(f"{cause}-{friction}", "contact", f"contact.friction={friction}", *sets)
    told = companions(cause, given)
    assert len(told) == (2 if cause == "mesh" else 1)
    forces, beside, part, *_ = told[0]
    assert forces.step == 2e-4 and (beside is None) == (cause == "step")
    # Elements of order 2 make 3; the footprint is a few points wide, so that finer ones tell, whose errors have
    # nothing to do with the run's.
    wanted = {"step": 1.0 if friction else 1 / 3, "points": 1 / np.sqrt(1 + 0.5**3), "mesh": 1 / 7}
    assert part == pytest.approx(wanted[cause])
    found = forces.contact
    assert found[:, 2] == pytest.approx(contact_force(other)[:, 2], rel=allowed)
    assert found[:20, 2] == pytest.approx(contact_force(other)[:20, 2], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_the_step_is_told_by_the_order_of_the_scheme(whole, scheme):
    """Against steps an eighth as long with linear forces, which are as good as none."""
    limit, step = 200.0, 4e-4
    given = replace(_given(whole), scheme=scheme, step=step, steps=70)
    fine = replace(given, scheme="linear", step=step / 8, steps=8 * 70)
    own, exact = (one.repeated(one.equilibrated, one.response, coarser=1) for one in (given, fine))
    (told,) = companions("step", given)
    estimated = told.bars(own, 0.0, limit, limit)["contact_force"].history[2]
    both = (measured(found.contact, found.step, limit) for found in (own, exact))
    assert 0.5 < estimated / bars(*both, 1.0).history[2] < 2.0


@pytest.mark.long
def test_fewer_modes_have_attachment_modes_of_their_own(run):
    """Their error is that of a run with so many modes: within a factor of two of that against twice the modes."""
    rough = 'road={kind="texture",rms=2e-4,roll_off=0.2,cut_off=0.03,run_in=0.05}'
    sets = "greens.residual=attachment", "contact.youngs_modulus=1e7", rough, "time.duration=0.06"
    _, whole = run("attached", "contact", *sets)
    _, finer = run("attached-finer", "contact", *sets, "modal.count=60")
    history, exact = (one.done["contact"].product for one in (whole, finer))
    given = replace(_given((None, whole)), steps=600, attached=whole.greens.attached)
    limit = 0.8 * whole.rolling.highest / (2 * np.pi)
    (told,) = companions("modes", given)
    assert told.within == pytest.approx(np.sqrt(0.5))
    own = ContactForces(history.total_force, history.axle_force, history.step)
    estimated = told.bars(own, 0.02, limit, limit)["contact_force"].history[2]
    both = (measured(one.total_force[200:], one.step, limit) for one in (history, exact))
    assert 0.5 < estimated / bars(*both, 1.0).history[2] < 2.0


def test_an_order_is_doubted_where_runs_differ_by_more_than_they_vary():
    """A seventh of the difference is told of elements of twice the size: 0.3 of the variation is twice all of it."""
    nothing = np.zeros(3)

    def bars_of(history: float) -> dict[str, Bars]:
        return {"contact_force": Bars(nothing, nothing, np.zeros((0, 3)), np.full(3, history))}

    mesh = Companion(ContactForces(np.zeros((0, 3)), None, 1e-4), None, 1 / 7)
    assert "2.1 times" in (mesh.doubt(bars_of(0.3)) or "")
    assert mesh.doubt(bars_of(0.1)) is None and mesh.doubt(bars_of(np.nan)) is None
    assert mesh._replace(random=True).doubt(bars_of(0.3)) is None


def test_companions_are_dealt_to_the_process_with_the_least_to_do():
    causes = ("points", "mesh", "modes", "step")
    assert _dealt(causes, 1) == [list(causes)]
    assert _dealt(causes, 2) == [["points"], ["mesh", "modes", "step"]]
    assert _dealt(causes, 3) == [["points"], ["mesh"], ["modes", "step"]]
    assert _dealt((), 2) == [[], []]


@pytest.mark.long
def test_the_rubber_between_nodes_is_what_finer_elements_have(run, whole):
    """How much further a point sinks than those beside it, with nodes a third as far apart."""
    _, finer = run("finer", "greens", "tire.segments=40", "tire.footprint_size=0.1")
    given, fine = _given(whole), _given((None, finer))
    made = backed(given.job, given.static.product, given.setup, given.response)
    wall = made.contact.law.wall
    own = sinks(given.setup.patch, given.response)
    told = sinks(made.setup.patch, made.response, wall)
    true = sinks(fine.setup.patch, fine.response)
    assert 0.5 < (told - own) / (true - own) < 2.0


def sinks(patch, response, wall=None) -> float:
    """Of the points near the middle, m/N: under their own force beyond those under one two points away."""
    p = len(patch.index)  # the nodes come first
    nodes = (response.static() + response.residual)[:p, :p]
    flexibility = patch.weights @ (patch.weights @ nodes.T).T
    if wall is not None:
        every = np.arange(len(patch.points))
        flexibility = flexibility + KernelTread(patch.places, wall).block(every, every)
    number = np.rint(patch.points[:, :2] / patch.places.spacing).astype(int)
    at = {tuple(place): k for k, place in enumerate(number)}
    middle = [at[i, 0] for i in (-2, -1, 0, 1, 2)]
    beside = [[at[i - 2, 0], at[i + 2, 0]] for i in (-2, -1, 0, 1, 2)]
    return float(
        np.mean(
            [
                flexibility[k, k] - flexibility[k, b].mean()
                for k, b in zip(middle, beside, strict=True)
            ]
        )
    )


def _given(whole) -> ReferenceRun:
    _, done = whole
    return ReferenceRun(
        job=done.job,
        static=done.done["static"],
        setup=done.setup,
        response=done.greens.contact,
        rolling=done.rolling,
        step=1e-4,
        steps=300,
    )


def test_bars_are_in_the_summary_and_beside_the_bands(whole):
    folder, _ = whole
    stages = json.loads((folder / "summary.json").read_text())["stages"]
    told = stages["accuracy"]
    assert set(told["cost"]) == {*CAUSES, "coarser mesh"}
    assert told["headline"]["error of the mean contact force"]["value"] > 0
    with h5py.File(folder / "accuracy.h5") as file:
        assert set(file["contact_force"]) == set(CAUSES)
    with h5py.File(folder / "spectra.h5") as file:
        shape = file["third_octave/level"].shape
        assert file["third_octave/level_error"].shape == shape


def test_a_repeated_loop_tells_the_vibration_of_the_run(whole):
    """The forces on the nodes that a loop hands over and those in the file of the run move the whole tire alike, to rounding but for
    where turns of friction end."""
    folder, done = whole
    given = replace(_given(whole), since=0.0051, up_to=400.0)
    again = given.repeated(given.equilibrated, given.response, coarser=1).lines
    history = done.done["contact"].product
    forces = PatchForces.of(done.job, given.setup, history, given.whole.seen)
    own = given.whole.lines_of(forces, given.steps)
    assert own.shape == again.shape and own.shape[1] == Basis.of(done.rolling).coordinates
    assert np.linalg.norm(again - own) < 1e-3 * np.linalg.norm(own)
    late = given.whole.lines_of(forces, given.steps - 20)
    assert np.linalg.norm(late - own) > 1e-2 * np.linalg.norm(own)


def test_fewer_modes_move_what_their_combinations_of_all_do(whole):
    """Readings of the patch by their own coordinates and by those of the run that these are."""
    given = replace(_given(whole), up_to=400.0)
    points = given.probes
    seen = as_read(given.rolling, points)
    loads = points.loads[points.counted]
    arguments = seen, seen.basis.shape, loads, accuracy.FEWER, "static", (), MPI.COMM_SELF
    _, rolling, turn = of_fewer_modes(given.response, *arguments)
    few = given.whole.of_combinations(rolling, turn, loads)
    assert few.into.shape == (given.whole.basis.coordinates, few.basis.coordinates)
    assert few.basis.coordinates < 0.9 * given.whole.basis.coordinates
    np.testing.assert_allclose(given.whole.seen @ few.into, few.seen, atol=1e-9)


def test_modes_of_a_coarser_mesh_are_known_in_those_of_the_run(whole):
    """Its lowest modes are nearly combinations of unit length of the run's lowest."""
    _, done = whole
    job, parts = coarser(done.job, done.done["static"])
    run, other = (Basis.of(one) for one in (done.rolling, parts["rotating"].product))
    into = on_other_mesh(run, done.job.tire.lattice, other, job.tire.lattice)
    assert into.shape == (run.coordinates, other.coordinates)
    assert np.linalg.norm(into[:, :8], axis=0) == pytest.approx(np.ones(8), abs=0.05)
    assert np.linalg.norm(into[10:, :6], axis=0).max() < 0.1


def test_the_sound_errs_as_vibrations_of_companions_do(run):
    """At each microphone, by the pressure of each companion's vibration; unknown where nothing is estimated."""
    sets = ('sound={microphones=["cpx"],up_to=300.0}', "time.duration=0.1")
    _, done = run("heard", "sound", *sets)
    sound, known = done.done["sound"].product, done.done["accuracy"].product
    assert set(known.vibrations) == set(CAUSES) and not known.absent
    assert np.isfinite(sound.error).all() and (sound.error > sound.of_elements).all()
    random, count = np.random.default_rng(1), known.vibrations["step"][0].run.shape[1]
    lines = random.normal(size=(150, count)) + 1j * random.normal(size=(150, count))
    alike = [Vibrations(lines, 1.6 * lines, Relation(share=1 / 3))]
    product = replace(known, vibrations={"step": alike}, spacing=2.0)
    stage = SimpleNamespace(accuracy=SimpleNamespace(product=product))
    paths, bands = done.done["radiation"].product, np.array([100.0, 199.526])
    volumes = random.normal(size=(paths.near.ahead.shape[2], count))
    found = SoundStage._errors(stage, paths, volumes, bands)
    assert found == pytest.approx(np.full((2, 2), 20 * np.log10(1.2)), abs=1e-6)
    stage.accuracy = None
    assert np.isnan(SoundStage._errors(stage, paths, volumes, bands)).all()


@pytest.mark.long
def test_bands_have_error_bars_that_companions_are_too_short_for(run, monkeypatch):
    monkeypatch.setattr(accuracy, "_PERIODS", (2, 4))
    folder, done = run("longer", "spectra", "time.duration=0.2", "road.run_in=0.01")
    found = done.done["accuracy"].product
    with h5py.File(folder / "spectra.h5") as file:
        assert np.isfinite(file["third_octave/level_error"][:]).all()
        centre = file["third_octave/centre"][:]
    assert found.window < 0.1 and len(centre) > len(wide_enough(1 / found.window, 200.0))


@pytest.mark.long
def test_a_full_disk_is_no_lack_of_a_companion(run, whole, monkeypatch):
    """Kept as a result, it would stay after space was made."""

    def full(cause, given):
        raise Refused("the disk is full")

    monkeypatch.setattr("tireroad.runs.stages.accuracy.companions", full)
    shutil.copytree(whole[0], whole[0].with_name("full"))
    with pytest.raises(Refused, match="the disk is full"):
        run("full", "accuracy", "accuracy.up_to=300")


@pytest.mark.long
def test_companions_of_a_run_that_begins_at_rest_begin_so(run, monkeypatch):
    """Each looked for the steady rolling that the run had not found, and failed."""

    def nothing(*given):
        raise ConvergenceError("nothing rolls steadily")

    for stage in (contact, rolling, accuracy):
        monkeypatch.setattr(stage, "rolling_steadily", nothing)
    _, done = run("rest", "accuracy", "rotation.free_rolling=")
    found = done.done["accuracy"].product
    assert not done.done["contact"].product.steady and not found.absent
    assert set(found.by_cause["contact_force"]) == set(CAUSES)


@pytest.mark.parametrize("up_to", [100.0, 400.0])
def test_records_of_companions_have_as_many_lines_whatever_the_band(up_to):
    least, most = accuracy.records(1e-5, up_to)
    assert least * 1e-5 * up_to == pytest.approx(16, rel=1e-3)
    assert most == pytest.approx(2 * least, abs=1)
    assert accuracy.records(1e-3, up_to)[0] >= 64  # steps, where they are long


@pytest.mark.long
def test_what_cannot_be_estimated_is_said_not_to_be(run):
    folder, _ = run("nodes", "accuracy", "contact.points=nodes", "contact.reach=")
    told = json.loads((folder / "summary.json").read_text())["stages"]["accuracy"]["headline"]
    assert "take a grid" in told["error by the points"]["value"]


@pytest.mark.long
def test_points_chosen_are_those_of_a_scene_that_names_them(run):
    """To the last bit; and the coarser mesh's companion has them too, whatever its own footprint asks for."""
    _, auto = run("auto", "contact", "contact.points=auto")
    own = auto.done["setup"].product.patch
    dx, dy = own.places.spacing
    _, named = run("named", "contact", f"contact.points={{ dx = {dx}, dy = {dy} }}")
    forces = [one.done["contact"].product.total_force[:] for one in (auto, named)]
    assert np.array_equal(*forces) and forces[0].any()
    job, done = coarser(auto.job, auto.done["static"])
    assert done["setup"].product.patch.places.spacing == (dx, dy)
    alone = points_of(replace(job, scene=auto.job.scene), done["static"].product)
    assert (alone.dx, alone.dy) != (dx, dy)


def test_it_can_be_left_out(run):
    folder, _ = run("whole", "spectra", "accuracy.estimate=false")
    stages = json.loads((folder / "summary.json").read_text())["stages"]
    assert stages["accuracy"]["status"] == "skipped"
    with h5py.File(folder / "spectra.h5") as file:
        for name in ("level_error", "contact_level_error"):
            assert np.isnan(file[f"third_octave/{name}"][:]).all()
        assert file.attrs["unknown_error"] == "unknown: accuracy.estimate is false"
    told = stages["spectra"]["headline"]["numerical error of the third octaves"]["value"]
    assert told == "unknown: accuracy.estimate is false"


def test_the_coarser_tire_turns_as_fast(tmp_path) -> None:
    """At a travel speed, too, where its own rolling radius would give another speed."""
    (tmp_path / "scene.toml").write_text(SCENE.replace("speed = 40.0", "travel_speed = 6.0"))
    job = Job(load(tmp_path / "scene.toml"), tmp_path, MPI.COMM_SELF)
    job.found["speed"] = 19.0
    other = coarser_job(job)
    assert other.speed == 19.0 and other.scene.rotation.travel_speed is None


@pytest.mark.parametrize("sizes", [(12, 16), (24, 6)])
def test_a_mesh_too_coarse_to_be_halved_is_said_to_be(tmp_path, sizes) -> None:
    """Not that a key of the halved mesh, which no one wrote, is out of its range."""
    mesh = "segments = {}\nelements_arc = {}\n".format(*sizes)
    (tmp_path / "scene.toml").write_text(f"[tire]\n{mesh}[static]\nload = 300.0\n")
    job = Job(load(tmp_path / "scene.toml"), tmp_path, MPI.COMM_SELF)
    with pytest.raises(InputError, match="16 elements around and 8 along"):
        coarser_job(job)
