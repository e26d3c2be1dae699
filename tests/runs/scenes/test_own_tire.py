"""A tire from a file through the program: the scene's keys, check, and frequencies against the torus."""

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "fem" / "decks"))

from torus_decks import CORDS, HALF_ANGLE, Torus, membranes, plain

from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.sections.file import fingerprint, own_section

TIRE = """
[tire]
section = "file"
file = "tire.inp"
rim = "RIMNODES"
segments = 8
order = 2
[tire.cavity]
gas = "none"
[static]
inflation = 2e4
[modal]
count = 8
"""
TORUS = """
[tire]
segments = 8
elements_arc = 8
elements_thickness = 2
order = 2
grading = "uniform"
[tire.material]
youngs_modulus = 6e6
[static]
inflation = 2e4
[modal]
count = 8
"""
BELT = '[[tire.cords]]\nname = "B"\ndepth = 0.006\narc = [-120.0, 120.0]\nangle = -20.0\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arcs = np.linspace(-HALF_ANGLE, HALF_ANGLE, 65)
    belt = membranes("B", 0.006, arcs, 9001, 9001, True, 70.0)
    (tmp_path / "tire.inp").write_text(plain(Torus(arcs=8, wall=1)) + belt + CORDS)
    (tmp_path / "own.toml").write_text(TIRE)
    (tmp_path / "torus.toml").write_text(TORUS + BELT)
    return tmp_path


def frequencies(folder, name):
    scene, out = str(folder / f"{name}.toml"), str(folder / name)
    assert main(["run", scene, "--until", "modes", "--out", out]) == 0
    with h5py.File(folder / name / "modes.h5") as file:
        return file["frequency"][:]


@pytest.mark.long
def test_frequencies_of_the_torus(folder):
    """A torus with a slanted ply from a deck, embedded at half the wall, and the built-in one of the same
    elements: static state and modes agree to rounding (asked: 0.1 %).
    """
    assert frequencies(folder, "own") == pytest.approx(frequencies(folder, "torus"), rel=1e-6)


def test_resolved_scene_reads_back(folder):
    scene = load(folder / "own.toml")
    (folder / "again.toml").write_text(dumps(scene))
    assert load(folder / "again.toml") == scene
    assert scene.tire.proportions().outer_radius == pytest.approx(0.32)
    assert "outer_radius" not in dumps(scene)


def test_a_mesh_is_a_file(folder):
    """The same tire and hash with mesh = "…" and no section as with section = "file" and file = "…"."""
    text = (folder / "own.toml").read_text()
    (folder / "mesh.toml").write_text(
        text.replace('section = "file"', "").replace("file =", "mesh =")
    )
    one, other = load(folder / "own.toml").tire, load(folder / "mesh.toml").tire
    assert other.section == "file" and fingerprint(one) == fingerprint(other)
    (folder / "both.toml").write_text(text.replace("file =", 'mesh = "tire.inp"\nfile ='))
    with pytest.raises(InputError, match="needs one of file"):
        load(folder / "both.toml")


def test_check_tells_what_is_used(folder, capsys):
    assert main(["check", str(folder / "own.toml")]) == 0
    told = capsys.readouterr().out
    for part in ("cords B: -20 deg", "region WALL: RUBBER", "not used of the file", "*HEADING"):
        assert part in told
    assert (folder / "results" / "own" / "section.png").stat().st_size > 10_000


def test_another_deck_is_another_tire(folder):
    """The hash of the static stage follows what the file gives, not its name or comments."""
    tire = load(folder / "own.toml").tire
    before = fingerprint(tire)
    text = (folder / "tire.inp").read_text()
    (folder / "tire.inp").write_text(text + "** a remark\n")
    assert fingerprint(tire) == before
    (folder / "tire.inp").write_text(text.replace("172.2E9", "172.3E9"))
    assert fingerprint(tire) != before


@pytest.mark.parametrize(
    ("add", "message"),
    [
        ('rim = "RIMS"', r"own\.toml, line 4: tire\.inp: tire\.rim: .*did you mean RIM"),
        ('length_unit = "mm"', r"is this deck in m\?"),
        ("mirror = true", r"mirror = true is for a half section"),
        ("outer_radius = 0.3", r"outer_radius is only valid for section = torus"),
        ('[[tire.region]]\nname = "TREAD"', r"tire\.region\.0 name = \"TREAD\" .*WALL"),
        ('[[tire.cords]]\nname = "C"', r"tire\.cords\.0 name = \"C\" is not a line of the file: B"),
    ],
)
def test_messages(folder, add, message):
    text = TIRE.replace('rim = "RIMNODES"\n', "") if add.startswith("rim") else TIRE
    text = text + add if add.startswith("[") else text.replace("segments", add + "\nsegments")
    (folder / "own.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        load(folder / "own.toml")


def test_materials_of_the_scene(folder):
    """[[tire.region]] by name replaces the file's compound, [[tire.cords]] by name its cords."""
    from tireroad.runs.scene.sections.file import own_cords, own_materials

    (folder / "own.toml").write_text(
        TIRE + '[[tire.region]]\nname = "wall"\ndynamic = 1.4\nloss_factor = 0.1\n'
    )
    tire = load(folder / "own.toml").tire
    (wall,) = own_materials(tire).values()
    assert (wall.law.youngs_modulus, wall.dynamic, wall.loss_factor) == (6e6, 1.4, 0.1)
    (folder / "own.toml").write_text(
        TIRE
        + '[[tire.region]]\nname = "WALL"\n[tire.region.material]\nyoungs_modulus = 9e6\n'
        + '[[tire.cords]]\nname = "B"\nangle = 30.0\narea = 3e-7\n'
    )
    tire = load(folder / "own.toml").tire
    assert own_materials(tire)["WALL"].law.youngs_modulus == 9e6
    (belt,) = own_cords(tire)
    assert (np.degrees(belt.angle), belt.area) == (pytest.approx(30), 3e-7)


def test_a_compound_without_losses_of_its_own_has_those_of_the_tire(folder):
    """They were dropped without a word, and a run, whose damping was taken to be theirs, crashed."""
    from tireroad.runs.scene.sections.file import own_materials

    (folder / "own.toml").write_text(TIRE)
    tire = load(folder / "own.toml", ["tire.loss_factor=0.2", "tire.dynamic=1.3"]).tire
    (wall,) = own_materials(tire).values()
    assert (wall.dynamic, wall.loss_factor) == (1.3, 0.2)
    assert tire.shape.has_losses(tire)
    assert not (plain := load(folder / "own.toml").tire).shape.has_losses(plain)
    region = TIRE + '[[tire.region]]\nname = "WALL"\nloss_factor = 0.1\n'
    (folder / "own.toml").write_text(region)
    (wall,) = own_materials(load(folder / "own.toml", ["tire.loss_factor=0.2"]).tire).values()
    assert wall.loss_factor == 0.1


def test_documented_example(folder):
    """The first scene of docs/how-to/own-tire.md: half a deck in millimetres, tonnes and MPa."""
    page = Path(__file__).parents[3] / "docs" / "how-to" / "own-tire.md"
    (folder / "half.toml").write_text(page.read_text().split("```toml\n")[1].split("```")[0])
    rubber = "*MATERIAL, NAME=RUBBER\n*HYPERELASTIC, NEO HOOKE\n1.0\n*DENSITY\n1.2E-9\n"
    deck = plain(Torus(half=True, scale=1e3), materials=rubber)
    deck = deck.replace("RIMNODES", "RIMNOD").replace("OUTSIDE", "STREAD")
    (folder / "AXI.inp").write_text(deck)
    tire = load(folder / "half.toml").tire
    assert (tire.proportions().outer_radius, tire.proportions().along) == (pytest.approx(0.32), 12)
    (compound,) = own_section(tire).rubbers
    assert compound.density == pytest.approx(1200)
    assert compound.coefficients["youngs_modulus"] == pytest.approx(2e6 * 2 * 1.49)
