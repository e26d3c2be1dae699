"""export --tir of a run, read again by fit."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

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
