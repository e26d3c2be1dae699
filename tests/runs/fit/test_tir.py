"""export --tir of a run, read again by fit."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_results import sealed, write_results

from tireroad.runs.cli import main
from tireroad.runs.fit import read, tir_values

SCENE = """[tire]
section = "radial"
segments = 12
elements_arc = 12
[static]
inflation = 2.2e5
load = 3000.0
error_estimate = false
[stiffness]
steps = 5
"""


@pytest.mark.long
def test_there_and_back(tmp_path: Path) -> None:
    """Stiffness, footprint and mass are those of the run; modes those of its mesh; the curves follow their points."""
    (tmp_path / "scene.toml").write_text(SCENE)
    out = tmp_path / "out"
    assert (
        main(["run", str(tmp_path / "scene.toml"), "--out", str(out), "--until", "stiffness"]) == 0
    )
    assert main(["export", str(out), "--tir"]) == 0
    path = out / "export" / "tire.tir"
    heads = (out / "export" / "stiffness.csv").read_text().splitlines()
    assert heads[0].startswith('"deflection [m]"') and "load [N]" in heads[0] and len(heads) == 6
    found, values = read(path), tir_values(path.read_text())
    with h5py.File(out / "stiffness.h5") as file:
        for name in ("vertical", "longitudinal", "lateral", "torsional"):
            assert found.values[f"{name}_stiffness"] == pytest.approx(
                float(file[name][()]), rel=1e-6
            )
        curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
    assert (found.size, found.load) == ("205/60 R15", pytest.approx(3000, rel=1e-3))
    assert found.values["mass"] == pytest.approx(9.3, abs=0.2)
    assert found.values["lateral_frequency"] == pytest.approx(43, abs=3)
    d = curve["deflection"] / float(values["UNLOADED_RADIUS"])
    load = float(values["FNOMIN"]) * (float(values["Q_FZ1"]) * d + float(values["Q_FZ2"]) * d**2)
    np.testing.assert_allclose(load, curve["load"], rtol=0.1)
    at = np.interp(3000, curve["load"], curve["footprint_length"])
    assert found.values["footprint_length"] == pytest.approx(at, rel=0.15)
    assert 4 < float(values["BELT_MASS"]) < found.values["mass"]


def test_without_a_static_state(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "scene.toml").write_text("")
    assert main(["export", str(tmp_path), "--tir"]) == 2
    assert "static" in capsys.readouterr().err


def test_what_can_be_is_written_and_the_rest_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Without receptances nothing was written, the .tir neither; without [stiffness] it said nothing."""
    scene = SCENE.replace("[stiffness]\nsteps = 5\n", "[rotation]\nspeed = 70.0\n")
    write_results(tmp_path)
    (tmp_path / "scene.toml").write_text(scene)
    (tmp_path / "response.h5").unlink()
    with sealed(tmp_path / "static.h5", "a") as file:
        file.attrs.update(mass=9.2, load=3000.0, rolling_radius=0.306, inflation=2.2e5)
    assert main(["export", str(tmp_path), "--tir", "--uff"]) == 2
    told = capsys.readouterr()
    assert "modes.csv" in told.out and "tire.tir" in told.out and "response.uff" not in told.out
    assert "no response.uff" in told.err and "[output.receptance]" in told.err
    assert "tire.tir: VERTICAL_STIFFNESS" in told.err and "[stiffness]" in told.err
    text = (tmp_path / "export" / "tire.tir").read_text()
    sections = re.findall(r"^\[(\w+)\]$", text, re.MULTILINE)
    assert sections[:4] == ["MDI_HEADER", "UNITS", "MODEL", "DIMENSION"]
    values = tir_values(text)
    assert float(values["FNOMIN"]) == 3000.0
    assert float(values["LONGVL"]) == pytest.approx(70.0 * 0.306)
    assert values["TYRESIDE"] == "SYMMETRIC" and "VERTICAL_STIFFNESS" not in values
    assert read(tmp_path / "export" / "tire.tir").values["mass"] == pytest.approx(9.2)
    assert main(["export", str(tmp_path), "--tir"]) == 0
