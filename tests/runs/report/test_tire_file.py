"""check of a deck or mesh alone: what it guesses, what it takes from the steps, and the scene that it writes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tireroad.fem.decks.history import history
from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.report.input_file import describe_tire
from tireroad.runs.scene.load import load

DECKS = Path(__file__).parents[2] / "fem" / "decks"
sys.path.insert(0, str(DECKS))

from torus_decks import CORDS, RUBBER, Torus, membranes, plain  # noqa: E402

STEPS = """*STEP
*STATIC
*DSLOAD
INSIDE, P, 0.24
*END STEP
*STEP
*CLOAD
ROADREF, 2, 3300.
*FRICTION
0.8
*TRANSPORT VELOCITY
ALL, 33.
*END STEP
"""
REVOLVE = """*HEADING
second deck
*SYMMETRIC MODEL GENERATION, REVOLVE
0., 0., 0., 0., 1., 0.
1., 0., 0.
90., 4,
270., 12,
*STEP
*DSLOAD
INSIDE, P, 200000.
*TRANSPORT VELOCITY
ALL, 22.
*FREQUENCY
300
*END STEP
"""


def test_a_scene_to_start_from(tmp_path: Path) -> None:
    """The written scene loads, with the unit, faces and half of the deck, and the figures of its steps in SI."""
    torus = Torus(half=True, scale=1e3)
    rubber = RUBBER.replace("6.0E6", "6.0").replace("1200.", "1.2E-9")
    text = plain(torus, materials=rubber).replace("OUTSIDE", "STREAD")
    text = text.replace("INSIDE", "INSIDENODES") + "*SURFACE, NAME=INSIDE\n"
    inner = [n for n, nodes in torus.cells() if nodes[0] < torus.label(1, 0)]
    (tmp_path / "deck.inp").write_text(text + "".join(f"{n}, S4\n" for n in inner) + STEPS)
    told = describe_tire(tmp_path / "deck.inp", tmp_path / "out")
    scene = load(tmp_path / "out" / "scene.toml")
    shape = scene.tire.shape
    assert (shape.length_unit, shape.mirror) == ("mm", True)
    assert (shape.rim, shape.inner, shape.tread) == (("RIMNODES",), "INSIDE", "STREAD")
    assert scene.static.inflation == pytest.approx(0.24e6)
    assert scene.static.load == pytest.approx(3300)
    assert scene.rotation.speed == pytest.approx(33)
    assert "under pressure in a step" in told and "friction = 0.8" in told
    assert (tmp_path / "out" / "section.png").stat().st_size > 10_000


def test_names_on_no_face_are_left_out(tmp_path: Path) -> None:
    """A wheel's set has RIM in its name, too, and holds nothing of the tire."""
    text = plain(Torus()) + "*NODE, NSET=RIMREFERENCE\n999999, 0., 0.\n"
    (tmp_path / "deck.inp").write_text(text)
    told = describe_tire(tmp_path / "deck.inp", tmp_path)
    assert 'rim = ["RIMNODES"]' in told


def test_nothing_suggests_a_rim(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_text(plain(Torus()).replace("RIMNODES", "ENDS"))
    with pytest.raises(InputError, match="(?s)what the wheel holds.*scene.toml.*ENDS"):
        describe_tire(tmp_path / "deck.inp", tmp_path)
    assert "rim = []" in (tmp_path / "scene.toml").read_text()


def test_a_deck_of_steps_alone(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """A second deck has no mesh: what it says of revolution, pressure and speed is told."""
    (tmp_path / "roll.inp").write_text(REVOLVE)
    found = history(tmp_path / "roll.inp")
    assert (found.segments, found.angle, found.speed, found.modes) == (16, 360.0, 22.0, 300)
    assert main(["check", str(tmp_path / "roll.inp")]) == 0
    told = capsys.readouterr().out
    assert "segments = 16" in told and "speed = 22" in told and "inflation = 200000" in told


def test_fitted_rubber_is_drawn(tmp_path: Path) -> None:
    data = "*HYPERELASTIC, OGDEN, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n1.5E5, 0.1\n2.6E5, 0.2\n3.4E5, 0.3\n"
    law = RUBBER.replace("*ELASTIC\n6.0E6, 0.45\n", data)
    (tmp_path / "deck.inp").write_text(plain(Torus(), materials=law))
    told = describe_tire(tmp_path / "deck.inp", tmp_path)
    assert "fitted to uniaxial test data" in told
    assert (tmp_path / "test_data.png").stat().st_size > 10_000


def test_cords_and_gmsh(tmp_path: Path) -> None:
    text = (
        plain(Torus())
        + membranes("BELT", 0.004, [-0.5, -0.25, 0.0, 0.25, 0.5], 90001, 9001)
        + CORDS
    )
    (tmp_path / "belted.inp").write_text(text)
    assert "cords BELT: -20 deg" in describe_tire(tmp_path / "belted.inp", tmp_path)
    told = describe_tire(DECKS / "meshes" / "quad_4.1_0.msh", tmp_path)
    assert 'length_unit = "m"' in told and "region" in told


def test_a_run_says_what_it_takes_of_the_file(tmp_path: Path) -> None:
    """In summary.json, static.h5 and the report, as check prints it; also where the stage is reused."""
    (tmp_path / "deck.inp").write_text(
        plain(Torus(arcs=8, wall=1)) + STEPS.split("*STEP")[0] + "*PREPRINT\n"
    )
    (tmp_path / "scene.toml").write_text(
        '[tire]\nsection = "file"\nfile = "deck.inp"\nrim = ["RIMNODES"]\nsegments = 8\n'
        "[static]\ninflation = 2e4\nerror_estimate = false\n"
    )
    out = tmp_path / "out"
    for _ in range(2):
        assert (
            main(["run", str(tmp_path / "scene.toml"), "--out", str(out), "--until", "static"]) == 0
        )
        notes = json.loads((out / "summary.json").read_text())["stages"]["static"]["notes"]
        assert any("region WALL" in line for line in notes)
        assert any("*PREPRINT: not used" in line for line in notes)
    assert main(["report", str(out)]) == 0
    page = (out / "report.html").read_text()
    assert "What the run takes" in page and "*PREPRINT: not used" in page
