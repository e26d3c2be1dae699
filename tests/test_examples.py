"""The examples run, and give the numbers they are pinned to."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from started import environment
from tires import soft_torus

from tireroad.fem.tire.material import MATERIALS
from tireroad.runs.scene.outputs import OUTPUTS
from tireroad.runs.scene.tables.tire import SECTIONS

pytestmark = pytest.mark.slow

SCENE = (
    soft_torus(12, 4)
    + """[static]
load = 300.0
[modal]
count = 12
[rotation]
speed = 50.0
[contact]
youngs_modulus = 1e7
[road]
kind = "sine"
amplitude = 2e-4
[time]
duration = 0.05
step = 2e-4
"""
)
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.fixture(autouse=True)
def _examples_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    for path in EXAMPLES.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_make_road_writes_what_is_shipped(tmp_path: Path) -> None:
    import make_road

    assert make_road.main(tmp_path / "road.npz") == pytest.approx(0.4, rel=1e-6)
    made = np.load(tmp_path / "road.npz")
    shipped = np.load(EXAMPLES.parent / "runs" / "scenes" / "measured_road.npz")
    assert all(np.allclose(made[key], shipped[key], atol=1e-9) for key in "xyz")
    # Valleys deeper than peaks are high.
    assert ((made["z"] / made["z"].std()) ** 3).mean() < -0.5


def test_load_deflection() -> None:
    import load_deflection

    rows = np.array(load_deflection.main())
    assert rows[:, 1] == pytest.approx([209.6, 559.3, 888.6], rel=1e-3)
    assert (np.diff(rows[:, 2]) > 0).all()


def test_campbell() -> None:
    import campbell

    found = campbell.main()
    assert list(found) == ["L0", "L1-", "L1+", "L2-", "L2+", "T0"]
    # A pair splits by about n Omega / 2 pi times what Coriolis forces leave.
    assert found["L1-"][:2] == pytest.approx([58.55, 54.61], rel=1e-3)
    assert found["L1+"][:2] == pytest.approx([58.56, 62.49], rel=1e-3)


def test_receptance() -> None:
    import receptance

    standing, rolling = receptance.main().values()
    assert 1e6 * standing[4] == pytest.approx(13.046, rel=1e-3)
    assert 1e6 * rolling[4] == pytest.approx(13.604, rel=1e-3)


def test_rolling() -> None:
    import rolling

    run = rolling.main()
    assert run.total_force[0] == pytest.approx(300.0, rel=0.02)
    assert run.total_force.mean() == pytest.approx(302.82, rel=1e-3)
    assert run.total_force.std() == pytest.approx(12.84, rel=1e-2)


def test_own_tread() -> None:
    import own_tread

    mean, deviation = own_tread.main()
    assert mean == pytest.approx(300.5, rel=1e-3)
    assert deviation == pytest.approx(8.818, rel=1e-2)


def test_own_material_stiffens() -> None:
    import own_material

    neo_hookean, gent = own_material.main()
    MATERIALS.forget("gent")  # the key reference lists what is registered
    assert neo_hookean == pytest.approx(559.3, rel=1e-3)
    assert gent == pytest.approx(569.7, rel=1e-3) and gent > 1.001 * neo_hookean


def test_own_section() -> None:
    import own_section

    circle, ellipse = own_section.main()
    SECTIONS.forget("ellipse")
    assert circle == pytest.approx(575.9, rel=1e-3)
    assert ellipse == pytest.approx(594.6, rel=1e-3)


@pytest.mark.long
def test_own_output(capfd: pytest.CaptureFixture[str]) -> None:
    """Points 5 mm apart: the tire at rest touches on 50 mm or so; pinned when it was written."""
    import own_output

    length = own_output.main()
    OUTPUTS.forget("footprint_length")
    assert length.min() == pytest.approx(0.050, abs=1e-9)
    assert length.max() == pytest.approx(0.055, abs=1e-9)
    assert "mean length of the footprint 0.0508 m" in capfd.readouterr().out


@pytest.mark.long
def test_read_results(launch, tmp_path: Path) -> None:
    import read_results

    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    done = launch("-m", "runs", "run", scene, "--out", tmp_path / "out")
    assert done.returncode == 0
    found = read_results.main(str(tmp_path / "out"))
    assert found["load at rest"] == pytest.approx(300.0, rel=1e-6)
    assert found["mean"] == pytest.approx(300.0, rel=0.05) and found["deviation"] > 0


@pytest.mark.long
def test_own_road_and_tread(capsys: pytest.CaptureFixture[str]) -> None:
    """Registered classes serve in a scene as ours do; pinned when it was written."""
    import own_road

    from tireroad.contact.roads.road import ROADS
    from tireroad.contact.tread.law import TREADS

    try:
        assert own_road.main() == pytest.approx(673.40, rel=1e-3)
        assert capsys.readouterr().out.endswith("N at most\n")
    finally:
        ROADS.forget("humps")
        TREADS.forget("brush-blocks")


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.py")), ids=lambda file: file.stem)
def test_an_example_says_how_it_is_run(file: Path) -> None:
    text = file.read_text()
    assert '__name__ == "__main__"' not in text or f"./tireroad python examples/{file.name}" in text


def test_an_example_runs_as_it_says(tmp_path: Path) -> None:
    """With the launcher's python, from any folder, the neighbour of a script found beside it."""
    done = subprocess.run(
        [EXAMPLES.parent / "tireroad", "python", EXAMPLES / "load_deflection.py"],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("footprint") == 3
