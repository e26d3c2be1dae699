"""Stages of one number of processes, reused on another: the answer is that of a fresh run."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

SCENE = (
    """
name = "reuse"
"""
    + soft_torus(20, 6, footprint_size=0.4)
    + """[static]
load = 400.0
error_estimate = false
[modal]
count = 20
[rotation]
speed = 40.0
[greens]
residual = "attachment"
[contact]
[road]
[time]
duration = 0.002
step = 1e-4
"""
)
FREQUENCY = np.linspace(20.0, 190.0, 18)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    """Run the scene on some processes in the folder of a name: its summary's stages, its receptances."""
    base = tmp_path_factory.mktemp("reuse")
    scene = base / "scene.toml"
    scene.write_text(SCENE)

    def started(name: str, processes: int, *options: str):
        stages = ran(scene, base / name, *options, processes=processes)[1]
        return stages, receptance(base / name) if (base / name / "greens.h5").exists() else None

    return started


def receptance(folder) -> np.ndarray:
    """H (f, c, c) m/N between the contact points, of the stored states."""
    from tireroad.runs.stages.greens import read_responses

    with h5py.File(folder / "greens.h5") as file:
        return read_responses(file)["contact"].receptance(FREQUENCY)


@pytest.mark.long
def test_modes_of_other_processes_with_attachments(run) -> None:
    """1 -> 2 -> 3 -> 1: eigenvectors have other signs there, and the rotating matrices between modes
    and attachments have them too."""
    _, fresh = run("fresh", 1, "--until", "greens")
    size = np.linalg.norm(fresh, axis=(1, 2))
    run("moved", 1, "--until", "rotating")
    for processes in (2, 3, 1):
        # Another band of interest, which changes no response: the Green's functions are made anew.
        option = "--set", f"greens.band={200 + processes}"
        stages, found = run("moved", processes, "--until", "greens", *option)
        assert stages["rotating"]["status"] == "reused"
        assert stages["greens"]["status"] == "computed"
        off = np.linalg.norm(found - fresh, axis=(1, 2)) / size
        assert off.max() < 1e-6, processes
