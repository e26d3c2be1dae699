"""`validate SCENE.toml`: a scene of one's own against full finite elements in time."""

import json
from pathlib import Path

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.validation.own_scene import against_elements

SCENE = """
[tire]
segments = 12
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[damping]
mass = 300.0
[rotation]
speed = 60.0
[modal]
count = {modes}
[contact]
points = "nodes"
youngs_modulus = 1e7
[road]
kind = "sine"
amplitude = 5e-4
wavelength = 0.1
[time]
duration = {duration}
step = 2e-4
"""


def written(folder: Path, modes: int = 150, duration: float = 0.2, more: str = "") -> Path:
    path = folder / "mine.toml"
    path.write_text(SCENE.format(modes=modes, duration=duration) + more)
    return path


@pytest.mark.long
def test_a_scene_is_held_against_full_elements(tmp_path: Path) -> None:
    """More modes come nearer, and both are farther off than the reference's own step."""
    few, many = (against_elements(written(tmp_path, modes), 0.03)[0] for modes in (20, 150))
    names = [name for name, _ in many.columns]
    off = {
        count: [row[names.index("the run")] for row in table.rows if row[1] == "vertical"]
        for count, table in (("few", few), ("many", many))
    }
    assert all(many < 0.6 * few for few, many in zip(off["few"], off["many"], strict=True))
    assert off["many"][0] < 3.0
    vertical = next(row for row in many.rows if row[:2] == ["contact force", "vertical"])
    assert vertical[2] == pytest.approx(500.0, rel=0.1)
    assert vertical[4] < vertical[5]
    assert "0.03 s" in many.title and "150 modes" in many.title


@pytest.mark.slow
def test_moduli_over_frequency_are_told_from_what_modes_cost(tmp_path: Path) -> None:
    """With the rubber of the full elements the modes are within 1.5 %, nearer than these at the same step; as run 9 % off."""
    rubber = "elements_arc = 6\ndynamic = 1.2\nloss_factor = 0.2\nexponent = 0.1\n"
    text = SCENE.replace("elements_arc = 6\n", rubber).replace("[damping]\nmass = 300.0\n", "")
    path = tmp_path / "mine.toml"
    path.write_text(text.format(modes=150, duration=0.2))
    (table,) = against_elements(path, 0.03)
    names = [name for name, _ in table.columns]
    row = next(row for row in table.rows if row[:2] == ["axle force", "vertical"])
    step, run, same = (
        row[names.index(name)]
        for name in ("full FE at the run's step", "the run", "modes with its rubber")
    )
    assert same < 1.5 < step < run
    assert any("moduli of 100 Hz" in note for note in table.notes)


@pytest.mark.slow
def test_full_elements_have_the_prony_series_of_a_scene(tmp_path: Path) -> None:
    """On elements of one length around they relax, and nothing stands in for them; on others they have moduli of 100 Hz."""
    series = "prony_shares = [0.1, 0.15, 0.2]\nprony_times = [1e-2, 1.6e-3, 3e-4]\n"
    text = SCENE.replace("[damping]\nmass = 300.0\n", "").format(modes=150, duration=0.2)
    tables = []
    for size in ("footprint_size = 1.0\n", ""):
        path = tmp_path / "mine.toml"
        path.write_text(text.replace("elements_arc = 6\n", f"elements_arc = 6\n{size}{series}"))
        tables += against_elements(path, 0.03)
    relaxing, one_modulus = tables
    assert any("Prony series" in note for note in relaxing.notes)
    assert any("moduli of 100 Hz" in note for note in one_modulus.notes)
    off = []
    for table in tables:
        names = [name for name, _ in table.columns]
        row = next(row for row in table.rows if row[:2] == ["axle force", "vertical"])
        off.append(row[names.index("the run")])
    assert "modes with its rubber" not in [name for name, _ in relaxing.columns]
    assert off[0] < 0.5 * off[1]


@pytest.mark.long
def test_the_command_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    out = tmp_path / "found.json"
    assert main(["validate", str(written(tmp_path, 40, 0.01)), "--out", str(out)]) == 0
    found = json.loads(out.read_text())["results"]
    ((table,),) = found.values()
    assert [row[0] for row in table["rows"]] == ["contact force"] * 3 + ["axle force"] * 3
    assert out.with_suffix(".html").exists()
    assert "full finite elements: 100 steps of 0.0001 s" in capsys.readouterr().out


def test_what_cannot_be_validated_is_refused(tmp_path: Path) -> None:
    force = '\n[[force]]\npoint = [0.0, 0.0, 0.3]\nkind = "impulse"\n'
    with pytest.raises(InputError, match="force"):
        against_elements(written(tmp_path, more=force))
    bare = tmp_path / "bare.toml"
    bare.write_text("[static]\nload = 500.0\n")
    with pytest.raises(InputError, match="without \\[contact\\]"):
        against_elements(bare)
