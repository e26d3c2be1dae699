"""Scenes through all their stages: what runs, what is reused, and what must come out exactly."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

pytestmark = pytest.mark.slow

TIRE = (
    soft_torus(20, 6, footprint_size=0.4)
    + """[modal]
count = 30
"""
)


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    return tmp_path_factory.mktemp("pipeline")


@pytest.fixture(scope="module")
def run(base, ran):
    """Run a scene text in a folder of its own; the folder and its summary's stages."""

    def started(name, text, *options):
        scene = base / f"{name}.toml"
        scene.write_text(f'name = "{name}"\n{text}')
        return base / name, ran(scene, base / name, *options)[1]

    return started


def dataset(folder, file, name):
    with h5py.File(folder / file) as stored:
        return stored[name][:]


FLAT = (
    TIRE
    + """
[static]
load = 400.0
[contact]
[road]
kind = "flat"
[time]
duration = 0.02
step = 1e-4
"""
)


@pytest.mark.long
@pytest.mark.parametrize("rotation", ["", "[rotation]\nspeed = 40.0\nfree_rolling = false\n"])
def test_flat_road_at_rest_leaves_the_tire_exactly_at_rest(run, rotation):
    folder, stages = run("rolling-flat" if rotation else "flat", FLAT + rotation)
    force = dataset(folder, "contact.h5", "normal_force")
    assert force.sum(axis=1) == pytest.approx(400.0, rel=1e-6)
    assert np.abs(force - force[0]).max() == 0.0
    assert np.abs(dataset(folder, "contact.h5", "displacement")).max() == 0.0
    assert stages["contact"]["indicators"]["factorisations"]["value"] <= 1
    assert (stages["rotating"]["status"] == "skipped") == (rotation == "")


@pytest.mark.long
@pytest.mark.parametrize("wanted", [True, False])
def test_the_load_comes_with_its_estimated_error_and_a_breakdown_of_the_time(run, wanted):
    option = () if wanted else ("--set", "static.error_estimate=false")
    folder, stages = run("static", FLAT, "--until", "static", *option)
    static = stages["static"]
    assert ("estimated error of the load" in static["indicators"]) == wanted
    assert ("error estimate" in static["cost"]) == wanted
    assert {"factorisation", "assembly", "solve", "other"} <= set(static["cost"])
    assert sum(static["cost"].values()) == pytest.approx(static["seconds"], rel=0.3)
    log = (folder / "log.txt").read_text().split("---")[-1]
    assert ("estimated error of the load" in log) == wanted
    assert "factorisation" in log


@pytest.mark.long
def test_another_road_reuses_everything_before_it(run):
    road = FLAT.replace('kind = "flat"', 'kind = "sine"\namplitude = 1e-4\nwavelength = 0.2')
    rolling = "[rotation]\nspeed = 40.0\n"
    _, first = run("again", FLAT + rolling)
    folder, second = run("again", road + rolling)
    assert {first[s]["status"] for s in ("static", "modes", "rotating")} == {"computed"}
    assert {second[s]["status"] for s in ("static", "modes", "rotating")} == {"reused"}
    assert second["contact"]["status"] == "computed"
    assert second["static"]["headline"] == first["static"]["headline"]
    assert dataset(folder, "contact.h5", "total_force")[:, 2].std() > 0.1
    _, third = run("again", road + rolling, "--set", "static.load=380", "--until", "modes")
    assert third["static"]["status"] == "computed"
    assert third["greens"]["reason"] == "--until modes"


POINT = (
    TIRE
    + """
[damping]
mass = 300.0
[[force]]
angle = 0.0
direction = [0.0, 0.0, 1.0]
amplitude = 2.0
frequency = 0.0
[[force]]
angle = 40.0
arc = 20.0
spread = [5.0, 5.0]
direction = [1.0, 0.0, 1.0]
amplitude = 0.0
[time]
duration = 0.15
[output]
receptance = { to = 200.0, step = 50.0 }
"""
)


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 40.0])
def test_constant_force_ends_at_the_static_flexibility_and_on_the_axle(run, speed):
    text = POINT + (f"[rotation]\nspeed = {speed}\n" if speed else "")
    folder, _ = run(f"point-{speed:g}", text)
    flexibility = dataset(folder, "greens.h5", "force/static_flexibility")
    displacement = dataset(folder, "response.h5", "displacement")[-1].ravel()
    assert displacement == pytest.approx(
        2.0 * flexibility[:, 0], abs=1e-6 * np.abs(flexibility).max()
    )
    assert dataset(folder, "response.h5", "axle_force")[-1] == pytest.approx([0, 0, 2.0], abs=1e-5)
    receptance = dataset(folder, "response.h5", "receptance")
    assert receptance.shape == (5, 2, 2)
    assert receptance[0, 0, 0] == pytest.approx(flexibility[2, 0], rel=1e-9)
    along = (flexibility[3, 0] + flexibility[5, 0]) / np.sqrt(2)
    assert receptance[0, 1, 0] == pytest.approx(along, rel=1e-9)
    reciprocal = receptance[:, 0, 1] - receptance[:, 1, 0]
    # Maxwell-Betti holds for the tire that stands, read over the spot that is loaded; rotation
    # takes it away. The second force is spread and read at its centre: equal to a few per cent.
    size = np.abs(receptance).max()
    assert np.abs(reciprocal).max() < 0.05 * size if speed == 0 else np.abs(reciprocal).max() > 0


@pytest.mark.long
def test_measured_belgian_block_road(run, roads):
    text = (
        TIRE
        + f"""
[static]
load = 400.0
[rotation]
speed = 30.0
[contact]
[road]
kind = "crg"
file = "{roads / "belgian_block.crg"}"
start = 2.0
longest_wave = 0.5
[time]
duration = 0.03
"""
    )
    folder, stages = run("belgian", text)
    assert stages["contact"]["indicators"]["worst complementarity residual"]["value"] < 1e-9
    load = dataset(folder, "contact.h5", "total_force")[:, 2]
    assert load.max() > 1.1 * 400.0
    with h5py.File(folder / "spectra.h5") as file:
        assert file["frequency"][:].max() <= file.attrs["limit"] < 0.5 / 1e-4
        assert "highest mode" in file.attrs["limit_cause"]
    told = stages["spectra"]["headline"]
    highest = stages["modes"]["headline"]["highest mode"]["value"]
    assert told["valid up to"]["value"] == pytest.approx(0.8 * highest, rel=1e-3)
    assert "spectra end at" in (folder / "log.txt").read_text()
    page = (folder / "report.html").read_text()
    assert "belgian_block.crg" in page


@pytest.mark.long
def test_missing_scene_tire_that_cannot_carry_and_full_patch_are_told_in_one_line(base, launch):
    scene = base / "heavy.toml"
    scene.write_text(FLAT.replace("load = 400.0", "load = 4e6"))
    coarse = ("--set", "tire.segments=12", "--set", "tire.elements_arc=4")
    done = launch("-m", "runs", "run", scene, "--out", base / "heavy", *coarse)
    assert done.returncode == 3
    assert "Traceback" not in done.stderr
    assert "static" in done.stderr and "load" in done.stderr
    scene.write_text(
        FLAT.replace('kind = "flat"', 'kind = "sine"\namplitude = 0.02\nwavelength = 0.4').replace(
            "[contact]", "[contact]\nreach = 1e-3"
        )
        + "[rotation]\nspeed = 40.0\n"
    )
    done = launch("-m", "runs", "run", scene, "--out", base / "edge", "--set", "name=edge")
    assert done.returncode == 3
    assert "contact.reach" in done.stderr and "Traceback" not in done.stderr
    assert not (base / "edge" / "contact.h5").exists()
    assert (base / "edge" / "greens.h5").exists()


@pytest.mark.long
def test_a_force_on_the_tire_in_contact_ends_where_statics_has_it(run):
    """Point force and contact in one loop: once settled, df = -A_aa^-1 B_a F on the points that
    touch, with the exact static flexibility; found at contact.h5 and response.h5 alike."""
    tire, after = FLAT.replace("duration = 0.02", "duration = 0.15").split("[contact]")
    force = (
        "[[force]]\nangle = 30.0\ndirection = [0.0, 0.0, 1.0]\namplitude = 2.0\nfrequency = 0.0\n"
    )
    damping = "[damping]\nmass = 400.0\n"
    folder, stages = run("pushed", tire + damping + force + '[contact]\ntread = "none"\n' + after)
    flexibility = dataset(folder, "greens.h5", "contact/static_flexibility")
    normal = dataset(folder, "contact.h5", "normal_force")
    touching = np.flatnonzero(normal[0] > 0)
    assert np.array_equal(touching, np.flatnonzero(normal[-1] > 0))
    change = (
        normal[-1, touching]
        - dataset(folder, "static.h5", "contact/force")[:, 2][
            dataset(folder, "static.h5", "contact/force")[:, 2] > 0
        ]
    )
    own = np.linalg.solve(flexibility[np.ix_(touching, touching)], -2.0 * flexibility[touching, -1])
    assert change == pytest.approx(own, abs=1e-4 * np.abs(own).max())
    moved = flexibility[-3:, touching] @ own + 2.0 * flexibility[-3:, -1]
    found = dataset(folder, "response.h5", "displacement")[-1, 0]
    assert found == pytest.approx(moved, abs=1e-4 * np.abs(moved).max())
    axle = dataset(folder, "response.h5", "axle_force")[-1]
    total = dataset(folder, "contact.h5", "total_force")[-1]
    assert axle == pytest.approx(total + [0.0, 0.0, 2.0], abs=1e-3)
    work = stages["contact"]["indicators"]["work of the prescribed forces"]["value"]
    assert work == pytest.approx(2.0 * found[2], rel=1e-6)


@pytest.mark.long
def test_the_estimated_memory_is_about_what_a_run_takes(run):
    from tireroad.runs.scene.estimate import memory
    from tireroad.runs.scene.load import load

    folder, stages = run("again", FLAT + "[rotation]\nspeed = 40.0\n")
    taken = stages["contact"]["indicators"]["largest memory of a process so far"]["value"]
    estimate = sum(memory(load(folder / "scene.toml")).values()) * 1e-9
    assert taken / 2 < estimate < 2 * taken
