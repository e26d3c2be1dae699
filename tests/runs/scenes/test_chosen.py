"""Keys of the file that a variant chosen by --set does not use are dropped, and said."""

from pathlib import Path

import pytest
from full_scene import CONTRACT, refused

from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.sweep.definition import read


@pytest.fixture
def path(scene_file) -> Path:
    return scene_file(CONTRACT)


@pytest.mark.parametrize(
    ("item", "lost"),
    [
        ("contact.tread=winkler", ["contact.youngs_modulus", "contact.poisson_ratio"]),
        ("contact.tread=none", ["contact.youngs_modulus", "contact.poisson_ratio"]),
        ("road.motion.kind=ramp", ["road.motion.frequency"]),
        (
            "tire.material.model=mooney-rivlin",
            ["tire.material.youngs_modulus", "tire.material.poisson_ratio"],
        ),
        ("road.kind=cobblestones", []),
        (
            "tire.section=radial",
            ["tire.outer_radius", "tire.minor_radius", "tire.thickness", "tire.half_angle"]
            + ["tire.elements_thickness", "tire.material"],
        ),
    ],
)
def test_what_is_of_no_use_is_dropped(path: Path, scene_file, item: str, lost: list[str]) -> None:
    said: list[str] = []
    scene = load(path, [item], said.append)
    assert [line.partition(" ")[0] for line in said] == ([f"{lost[0]},"] if lost[1:] else lost)
    assert all(key in said[0] for key in lost)
    written = dumps(scene)
    assert load(scene_file(written, "resolved.toml")) == scene
    table, _, key = item.partition("=")[0].rpartition(".")
    own = written.partition(f"\n[{table}]")[2].partition("\n[")[0]
    assert f"\n{key} = " in own
    assert not [one for one in lost if f"\n{one.rpartition('.')[2]} = " in own]


def test_a_table_within_an_array_is_fitted_too(scene_file) -> None:
    region = '[[tire.region]]\nmaterial = { model = "yeoh", c20 = 1e5 }\n'
    scene = load(scene_file(region), ["tire.region.0.material.model=linear"])
    assert scene.tire.region[0].material.law.youngs_modulus == 4.8e8


@pytest.mark.parametrize(
    ("items", "word"),
    [
        (
            ["contact.tread=winkler", "contact.poisson_ratio=0.4"],
            "contact.poisson_ratio is only valid for",
        ),
        (
            ["road.motion.kind=ramp", "road.motion.frequency=9"],
            "road.motion.frequency is only valid for",
        ),
        (
            ['contact={tread="winkler",youngs_modulus=1e7}'],
            "contact.youngs_modulus is only valid for",
        ),
        (["road.wavelength=0.1"], "road.wavelength is only valid for kind = sine"),
        (["road.kind=grid"], "road needs file"),
        (["contact.tread=jelly"], "contact.tread must be one of"),
    ],
)
def test_what_set_itself_contradicts_is_refused(path: Path, items: list[str], word: str) -> None:
    message = refused(path, *items)
    assert word in message and "\n" not in message


def test_a_file_that_contradicts_itself_is_refused(scene_file) -> None:
    text = CONTRACT.replace('"half-space"', '"winkler"')
    assert "youngs_modulus is only valid for tread = " in refused(
        scene_file(text), "static.load=400"
    )


def test_an_axis_of_a_sweep_chooses_as_set_does(path: Path, scene_file) -> None:
    values = 'key = "contact.tread"\nvalues = ["half-space", "winkler"]\n'
    sweep = read(scene_file(f'scene = "{path.name}"\n[[axis]]\n{values}', "sweep.toml"))
    half_space, winkler = (sweep.load(member).contact for member in sweep.members)
    assert half_space.law.youngs_modulus == 3.4e8 and winkler.tread == "winkler"


NOTE = 'note: road.motion.frequency is not used with kind = "ramp", which --set chose\n'


def test_check_says_what_it_dropped(path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(path.parent)
    assert main(["check", str(path), "--set", "road.motion.kind=ramp"]) == 0
    assert capsys.readouterr().out.count(NOTE) == 1


@pytest.mark.slow
def test_run_says_what_it_dropped(launch, path: Path, tmp_path: Path) -> None:
    small = [
        "tire.segments=8",
        "tire.elements_arc=4",
        "tire.order=1",
        "static.load=",
        "modal.count=9",
    ]
    sets = [f"--set={one}" for one in (*small, "contact=", "road.motion.kind=ramp")]
    out = tmp_path / "out"
    done = launch("-m", "runs", "run", path, *sets, "--out", out, "--until", "static")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count(NOTE) == 1
    assert NOTE in (out / "log.txt").read_text(encoding="utf-8")


RADIAL = """[tire]
section = "radial"
[static]
load = 4000.0
inflation = 2.2e5
[time]
[contact]
"""


@pytest.mark.parametrize(
    ("contact", "in_series", "thickness"),
    [
        ("", False, 7.95e-3),
        ("thickness = 6e-3", False, 6e-3),
        ('tread = "layer"', True, 10e-3),
        ("in_series = true", True, 10e-3),
        ('points = "nodes"', True, 10e-3),
        ("brush_stiffness_per_area = 1e8", True, 10e-3),
    ],
)
def test_a_contact_that_is_left_open_is_the_tires_own_tread(
    scene_file, contact: str, in_series: bool, thickness: float
) -> None:
    """The tread of 205/60 R15 is 8 mm thick at the crown."""
    said: list[str] = []
    scene = load(scene_file(RADIAL + contact), [], said.append)
    assert scene.contact.in_series is in_series
    assert scene.contact.law.thickness == pytest.approx(thickness, rel=0.01)
    assert any("in_series" in line for line in said) is not in_series
    again = load(scene_file(dumps(scene), "resolved.toml"))
    assert again.contact == scene.contact


@pytest.mark.parametrize(
    ("scene", "loss_factor"),
    [
        (RADIAL, 0.0),
        (RADIAL + "[rotation]\ntravel_speed = 20.0\n", 0.3),
        (RADIAL + "loss_factor = 0.1\n[rotation]\nspeed = 70.0\n", 0.1),
        (RADIAL + 'tread = "layer"\n[rotation]\nspeed = 70.0\n', 0.0),
    ],
    ids=["standing", "rolling", "given", "in series"],
)
def test_the_tires_own_tread_has_its_losses(scene_file, scene, loss_factor) -> None:
    """Of a tire that stands, its slow rubber has them."""
    assert load(scene_file(scene)).contact.law.loss_factor == loss_factor


def test_a_tread_of_the_tires_own_where_that_is_not_known(scene_file) -> None:
    with pytest.raises(InputError, match="contact.in_series = false.*nodes have all"):
        load(scene_file(RADIAL + 'points = "nodes"\nin_series = false'))
