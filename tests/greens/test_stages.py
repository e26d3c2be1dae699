"""The stages greens and response through the program: what they store, reuse and say."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

SCENE = (
    soft_torus(16, 6)
    + """[static]
steady_rolling = false
[modal]
count = 40
[rotation]
speed = 30.0
[[force]]
angle = 20.0
spread = [3.0, 3.0]
frequency = 60.0
[[force]]
angle = 5.0
direction = [1.0, 0.0, 1.0]
frequency = 0.0
[time]
duration = 0.02
step = 5e-5
[output]
impulse = true
receptance = { to = 80.0, step = 20.0, direct = 2 }
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    """Run the scene with more options, in one folder; its path and the summary's stages."""
    folder = tmp_path_factory.mktemp("stages")
    scene = folder / "scene.toml"
    scene.write_text(f'name = "stages"\n{SCENE}')

    def started(*options: str):
        return folder / "out", ran(scene, folder / "out", *options)[1]

    return started


def off(stages: dict) -> float:
    """The receptance's distance from the full matrices'."""
    indicators = stages["response"]["indicators"]
    return next(v["value"] for name, v in indicators.items() if "off the full" in name)


@pytest.mark.long
def test_every_residual_and_its_distance_from_the_full_matrices(run) -> None:
    """From one set of modes; the modes reused, attachments find all their unknowns again."""
    distance = {}
    for option in ("none", "static", "attachment"):
        _, stages = run("--set", f"greens.residual={option}", "--until", "response")
        distance[option] = off(stages)
        status = "computed" if option == "none" else "reused"
        assert stages["modes"]["status"] == status
    assert distance["none"] > 0.2
    assert distance["static"] < distance["none"] / 3
    assert distance["attachment"] < distance["static"] / 3


@pytest.mark.long
def test_stored_responses_give_the_same_again(run) -> None:
    """A longer run reuses the Green's functions from their file, residual states included."""
    options = "--set", "greens.residual=attachment", "--until", "response"
    out, _ = run(*options, "--set", "time.duration=0.01")
    with h5py.File(out / "response.h5") as file:
        short = file["displacement"][:]
    _, stages = run(*options)
    assert stages["greens"]["status"] == "reused"
    with h5py.File(out / "response.h5") as file:
        assert np.array_equal(file["displacement"][: len(short)], short)


@pytest.mark.slow
def test_impulse_response_is_that_of_the_stored_states(run) -> None:
    """Starts from nothing, and its transform at 0 Hz is the static flexibility of the states."""
    out, _ = run("--set", "greens.residual=none", "--until", "response")
    with h5py.File(out / "response.h5") as file:
        g, receptance = file["impulse"][:], file["receptance"][0]
        step = file["time"][1]
    assert g.shape[1:] == (2, 2)
    assert np.abs(g[0]).max() < 1e-9 * np.abs(g).max()
    assert np.abs(g.sum(axis=0) * step - receptance).max() < 0.05 * np.abs(receptance).max()


@pytest.mark.slow
def test_impulse_response_with_what_is_at_once_is_that_of_the_receptance(run) -> None:
    """Without the residual's part of it, the impulse response of few modes was 37 % short at 0 Hz."""
    out, _ = run("--set", "greens.residual=static", "--until", "response")
    with h5py.File(out / "response.h5") as file:
        g, receptance, step = file["impulse"][:], file["receptance"][0], file["time"][1]
        assert file["impulse_at_once"].attrs["unit"] == "m/N"
        at_once = file["impulse_at_once"][:]
    short = g.sum(axis=0) * step - receptance
    size = np.abs(receptance).max()
    assert np.abs(short + at_once).max() < 0.05 * size < np.abs(short).max()


@pytest.mark.slow
def test_states_made_static_are_told(run) -> None:
    few = "--set", "greens.dynamic=15", "--set", "greens.band=60"
    out, stages = run("--set", "greens.residual=static", *few, "--until", "response")
    indicators = stages["greens"]["indicators"]
    lost = next(v["value"] for k, v in indicators.items() if "made static" in k)
    assert 0 < lost < 0.2
    with h5py.File(out / "greens.h5") as file:
        assert file["force/eigenvalue"].shape == (15,)


@pytest.mark.long
def test_states_of_the_full_problem_take_the_static_residual_only(run, launch, tmp_path) -> None:
    """Its own states complete with K_Omega^-1; residuals that complete the modes are refused."""
    full = "--set", "rotation.method=full", "--set", "rotation.count=20", "--until", "response"
    _, stages = run("--set", "greens.residual=static", *full)
    assert off(stages) < 0.2
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    options = "--set", "greens.residual=attachment", "--set", "rotation.method=full"
    done = launch("-m", "runs", "check", scene, *options)
    assert done.returncode == 2
    assert 'rotation.method = "projected"' in done.stdout + done.stderr
