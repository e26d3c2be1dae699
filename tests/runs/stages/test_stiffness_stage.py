"""[stiffness]: its file, its figures, what is reused, and what is refused."""

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import StiffnessTable, deflections
from tireroad.runs.stages.stiffness import slides

TIRE = (
    soft_torus(16, 10, footprint_size=0.3)
    + """[modal]
count = 10
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    base = tmp_path_factory.mktemp("stiffness")

    def started(name, text, *options):
        scene = base / f"{name}.toml"
        scene.write_text(f'name = "{name}"\n{TIRE}{text}')
        return base / name, ran(scene, base / name, *options)[1]

    return started


@pytest.mark.long
def test_curve_and_stiffness_of_a_loaded_tire(run):
    """The curve passes the scene's own state; later stages get that state back to the last bit."""
    text = "[static]\nload = 900.0\nerror_estimate = false\n"
    plain, _ = run("plain", text)
    folder, stages = run("loaded", text + "[stiffness]\nsteps = 4\n")
    with h5py.File(folder / "stiffness.h5") as file, h5py.File(folder / "static.h5") as static:
        curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
        assert curve["deflection"][-1] == pytest.approx(1.5 * static.attrs["deflection"])
        between = np.interp(static.attrs["deflection"], curve["deflection"], curve["load"])
        assert between == pytest.approx(900.0, rel=0.03)
        slope = np.interp(900.0, curve["load"], curve["stiffness"])
        assert file["vertical"][()] == pytest.approx(slope, rel=0.1)
        assert file["vertical_stuck"][()] > file["vertical_tangent"][()]
        # Nodes come into contact one by one: on a coarse mesh the tangent lags behind the slope.
        assert file["vertical_tangent"][()] == pytest.approx(slope, rel=0.3)
        assert file["lateral"].attrs["unit"] == "N/m"
        assert all(item.attrs["unit"] for item in file["curve"].values())
        assert min(file[n][()] for n in ("longitudinal", "lateral", "torsional")) > 0
    for one in ("footprint_length", "footprint_area", "load"):
        assert np.all(np.diff(curve[one]) > 0)
    assert stages["stiffness"]["headline"]["lateral"]["unit"] == "N/m"
    with h5py.File(plain / "modes.h5") as one, h5py.File(folder / "modes.h5") as other:
        assert np.array_equal(one["frequency"][:], other["frequency"][:])
    assert "Load, deflection and stiffness" in (folder / "report.html").read_text()
    _, again = run("loaded", text + "[stiffness]\nsteps = 4\n")
    assert again["stiffness"]["status"] == "reused"


@pytest.mark.long
def test_deflections_without_a_road_of_the_scene(run):
    folder, stages = run(
        "given", "[stiffness]\ndeflections = [0.004, 0.012]\n", "--until", "stiffness"
    )
    with h5py.File(folder / "stiffness.h5") as file:
        assert file["curve/deflection"][:] == pytest.approx([0.004, 0.012])
        assert file["load"][()] == file["curve/load"][-1]
        assert file["torsional"][()] > 0
    assert stages["modes"]["status"] == "skipped"


@pytest.mark.long
def test_vertical_alone(run):
    folder, _ = run(
        "vertical",
        '[static]\ndeflection = 0.01\n[stiffness]\nwhich = "vertical"\nup_to = 0.01\nsteps = 2\n',
        "--until",
        "stiffness",
    )
    with h5py.File(folder / "stiffness.h5") as file:
        assert "lateral" not in file
        assert file["vertical"][()] == pytest.approx(file["curve/stiffness"][-1], rel=1e-6)


def test_steps_and_lists():
    assert deflections(StiffnessTable(steps=3), 0.02) == pytest.approx([0.01, 0.02, 0.03])
    assert deflections(StiffnessTable(up_to=0.01, steps=2), None) == pytest.approx([0.005, 0.01])
    assert deflections(StiffnessTable(deflections=(0.001, 0.002)), 0.5) == [0.001, 0.002]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[stiffness]\n", "stiffness.up_to"),
        ("[stiffness]\ndeflections = [0.02, 0.01]\n", "must ascend"),
        ("[stiffness]\ndeflections = [-0.02]\n", "stiffness.deflections"),
        ("[stiffness]\ndeflections = 0.02\n", "must be a list"),
    ],
)
def test_what_makes_no_curve_is_refused(tmp_path, text, named):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=named):
        load(path)


@pytest.mark.long
@pytest.mark.parametrize("rolls", [False, True], ids=["standing", "rolling"])
def test_force_over_the_way_with_friction(run, rolls):
    """Up to mu times the load, from the slope of what sticks; in the file, the summary and the report."""
    text = "[static]\nload = 900.0\nfriction = 0.5\nerror_estimate = false\n"
    text += "[rotation]\nspeed = 40.0\n" if rolls else ""
    more = "[stiffness]\nsteps = 2\nslide_steps = 4\n"
    folder, stages = run(f"slide-{rolls}", text + more)
    with h5py.File(folder / "stiffness.h5") as file:
        for name in ("longitudinal", "lateral"):
            curve = {key: item[()] for key, item in file[f"slide/{name}"].items()}
            units = {key: item.attrs["unit"] for key, item in file[f"slide/{name}"].items()}
            assert units["moved"] == ("-" if rolls else "m")
            assert np.all(np.diff(curve["force"]) > 0)
            assert 0.97 * 450.0 < curve["force"][-1] <= 450.0 * (1 + 1e-9)
            assert curve["force"][0] < 1.01 * curve["start"] * curve["moved"][0]
            if not rolls:
                end = 2 * 450.0 / file[name][()]
                assert curve["moved"] == pytest.approx(end * np.arange(1, 5) / 4)
    title = "cornering stiffness" if rolls else "lateral, secant at half of its largest force"
    assert stages["stiffness"]["headline"][title]["value"] > 0
    assert "Force along and across the road with friction" in (folder / "report.html").read_text()
    _, again = run(f"slide-{rolls}", text + more)
    assert again["stiffness"]["status"] == "reused"


def test_nothing_slides_where_friction_is_zero() -> None:
    """The way to slide by would be 0, and its tangents 0/0."""
    scene = SimpleNamespace(
        stiffness=SimpleNamespace(slide_steps=4), static=SimpleNamespace(friction=0.0)
    )
    state = SimpleNamespace(pull=np.zeros((3, 2)))
    assert slides(SimpleNamespace(scene=scene), state, None) == {}
