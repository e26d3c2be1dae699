"""A stopped run goes on from its checkpoint and ends with the bits of an unbroken one."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from tires import soft_torus

SCENE = (
    """
name = "stopped"
"""
    + soft_torus(16, 6)
    + """[static]
load = 300.0
[modal]
count = 20
[rotation]
speed = 30.0
[contact]
youngs_modulus = 2e7
[road]
kind = "sine"
amplitude = 1e-4
[time]
duration = 0.4
step = 1e-5
[output]
spectra = false
"""
)


@pytest.mark.long
@pytest.mark.parametrize("name", ["SIGTERM"])
def test_stopped_and_resumed(tmp_path: Path, launch, name: str) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert launch("-m", "runs", "run", scene, "--out", broken, "--until", "greens").returncode == 0
    subprocess.run(["cp", "-r", broken, whole], check=True)
    assert launch("-m", "runs", "run", scene, "--out", whole).returncode == 0

    command = [sys.executable, "-P", "-m", "runs", "run", str(scene), "--out", str(broken)]
    root = Path(__file__).resolve().parents[3]
    environment = {**os.environ, "PYTHONPATH": str(root), "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while "contact points" not in process.stdout.readline():
        assert process.poll() is None
    time.sleep(0.5)
    process.send_signal(getattr(signal, name))
    _, error = process.communicate(timeout=600)
    assert process.returncode == 4, error
    assert f"stopped by {name}" in error and "resume" in error
    assert (broken / "checkpoint.h5").exists() and not (broken / "contact.h5").exists()

    again = launch("-m", "runs", "resume", broken)
    assert again.returncode == 0, again.stderr
    assert "continues from the checkpoint" in again.stdout
    assert not (broken / "checkpoint.h5").exists()
    with h5py.File(whole / "contact.h5") as one, h5py.File(broken / "contact.h5") as other:
        names: list[str] = []
        one.visititems(lambda name, item: names.append(name) if hasattr(item, "shape") else None)
        assert len(names) > 8 and all(name in other for name in names)
        for name in names:
            assert np.array_equal(one[name][()], other[name][()]), name


def test_resume_needs_a_result_folder(tmp_path: Path, launch) -> None:
    done = launch("-m", "runs", "resume", tmp_path)
    assert done.returncode == 2
    assert "scene.toml" in done.stderr
