"""A scene that is refused before anything is computed leaves finished results as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from synthetic_results import write_results

from tireroad.fem.errors import InputError
from tireroad.runs import pipeline
from tireroad.runs.scene.load import load

SCENE = """
name = "synthetic-torus"
[tire]
segments = 16
[static]
load = 300.0
[contact]
[road]
kind = "sine"
amplitude = 1e-4
wavelength = 0.2
[time]
duration = 0.01
"""


@pytest.mark.parametrize("check", ["check_road", "check_demand"])
def test_a_refused_scene_writes_nothing_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, check: str
) -> None:
    def refuse(*_: object) -> None:
        raise InputError("refused")

    folder = write_results(tmp_path / "run")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    (tmp_path / "scene.toml").write_text(SCENE)
    monkeypatch.setattr(pipeline, check, refuse)
    scene = load(tmp_path / "scene.toml")
    with pytest.raises(InputError, match="refused"):
        pipeline.run_scene(scene, folder, MPI.COMM_SELF, until=None, fresh=False, petsc_options=[])
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.slow
def test_a_road_narrower_than_the_footprint_is_refused_before_the_modes(tmp_path: Path) -> None:
    x, y = np.linspace(-1.0, 3.0, 81), np.linspace(-0.01, 0.01, 3)
    np.savez(tmp_path / "road.npz", x=x, y=y, z=np.zeros((len(x), len(y))))
    text = SCENE.partition("[road]")[0] + '[road]\nkind = "grid"\nfile = "road.npz"\n'
    (tmp_path / "scene.toml").write_text(text + "[time]\nduration = 0.01\n")
    scene, folder = load(tmp_path / "scene.toml"), tmp_path / "run"
    with pytest.raises(InputError, match="the tire needs y from .* the road has -0.01 to 0.01 m"):
        pipeline.run_scene(scene, folder, MPI.COMM_SELF, until=None, fresh=False, petsc_options=[])
    assert (folder / "static.h5").exists()
    assert not (folder / "modes.h5").exists()
