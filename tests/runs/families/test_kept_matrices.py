"""What a run leaves to the next in the same process: the same bits as those of a run alone, and nothing for too long."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.runs.stages import matrices

SCENE = (
    soft_torus(16, 8)
    + """[static]
load = 500.0
steady_rolling = false
error_estimate = false
[modal]
count = 40
[rotation]
speed = 40.0
[contact]
youngs_modulus = 1e7
reach = 0.02
points = { dx = 0.008, dy = 0.008 }
[road]
kind = "sine"
amplitude = 0.5e-3
wavelength = 0.2
[time]
duration = 0.02
step = 2e-4
"""
)
FAMILY = """
import os, sys
import tireroad
from tireroad.fem import model
from tireroad.runs.cli import main
from tireroad.runs.stages import matrices
made = []
real = model.SmallMotions.__init__
model.SmallMotions.__init__ = lambda *given, **named: (made.append(1), real(*given, **named))[1]
matrices.keep_matrices()
for speed in (40.0, 45.0, 50.0):
    assert main(["run", sys.argv[1], "--out", f"{sys.argv[2]}/{speed:g}", "--set", f"rotation.speed={speed}"]) == 0
    print("made", len(made))
"""


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch):
    monkeypatch.setattr(matrices, "_kept", None)


def test_the_last_two_are_kept() -> None:
    made = []

    def once(key: str) -> str:
        return matrices.memoize("kind", key, lambda: made.append(key) or key)

    once("alone"), once("alone")
    assert made == ["alone", "alone"]  # of a run by itself nothing is
    matrices.keep_matrices()
    for key in ("run", "coarser", "run", "coarser", "other", "coarser", "run"):
        assert once(key) == key
    assert made[2:] == ["run", "coarser", "other", "run"]
    matrices.forget_matrices()
    once("run")
    assert made[-1] == "run" and len(made) == 7


def arrays(folder: Path) -> dict[str, np.ndarray]:
    found = {}
    for name in ("greens", "contact", "accuracy"):
        with h5py.File(folder / f"{name}.h5") as file:
            file.visititems(
                lambda key, item, name=name: (
                    found.update({f"{name}/{key}": item[()]})
                    if isinstance(item, h5py.Dataset)
                    else None
                )
            )
    return found


@pytest.mark.long
def test_members_that_share_matrices_have_the_bits_of_a_run_alone(
    tmp_path, launch, monkeypatch
) -> None:
    """Three speeds: matrices of the run's own mesh and of its coarser companion's, made once each."""
    scene, script = tmp_path / "base.toml", tmp_path / "family.py"
    scene.write_text(SCENE)
    script.write_text(FAMILY)
    monkeypatch.setenv("TIREROAD_CACHE", str(tmp_path / "cache"))
    done = launch(script, scene, tmp_path)
    assert done.returncode == 0, done.stderr
    counts = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("made ")]
    assert counts == ["2", "2", "2"]
    monkeypatch.setenv("TIREROAD_CACHE", "off")
    out = "--out", tmp_path / "alone", "--set", "rotation.speed=50.0"
    assert launch("-m", "runs", "run", scene, *out).returncode == 0
    alone, member = arrays(tmp_path / "alone"), arrays(tmp_path / "50")
    assert alone.keys() == member.keys() and len(alone) > 20
    for name, values in alone.items():
        assert np.array_equal(values, member[name], equal_nan=values.dtype.kind in "fc"), name
