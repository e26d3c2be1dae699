"""The modal keys of a scene through the whole program."""

import json
import re

import h5py
import numpy as np
import pytest
from tires import soft_torus

pytestmark = pytest.mark.slow

TIRE = (
    soft_torus(16, 4)
    + """[static]
load = 300.0
[modal]
count = 300
[damping]
mass = 50.0
[rotation]
speed = 50.0
count = 24
method = "{method}"
{more}
[greens]
residual = "{residual}"
[[force]]
frequency = 20.0
[time]
duration = 0.002
step = 1e-4
[output]
receptance = {{ to = 60.0, step = 10.0 }}
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("modal")


def run(launch, folder, name, processes=1, options=(), **keys):
    keys = {"method": "projected", "more": "", "residual": "static"} | keys
    scene = folder / f"{name}.toml"
    scene.write_text(TIRE.format(**keys))
    done = launch("-m", "runs", "run", scene, "--out", folder / name, *options, processes=processes)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def read(folder, name, file, dataset):
    with h5py.File(folder / name / file) as stored:
        return stored[dataset][:]


@pytest.mark.long
def test_full_states_drive_the_same_response(launch, folder):
    """24 pairs of the full problem and a residual, against 300 projected modes with the same."""
    run(launch, folder, "projected", residual="static")
    run(launch, folder, "full", method="full", residual="static")
    one = read(folder, "full", "response.h5", "receptance")
    many = read(folder, "projected", "response.h5", "receptance")
    np.testing.assert_allclose(one, many, rtol=0.02)
    states = read(folder, "full", "rotating.h5", "eigenvalue")
    exact = read(folder, "projected", "rotating.h5", "eigenvalue")
    error = [np.abs(exact - s).min() / abs(s) for s in states]
    assert max(error) < 1e-3
    again = run(launch, folder, "full", method="full", residual="static")
    assert "rotating  reused" in again


@pytest.mark.long
def test_full_states_on_two_processes(launch, folder):
    run(launch, folder, "one", method="full")
    run(launch, folder, "two", processes=2, method="full")
    np.testing.assert_allclose(
        read(folder, "two", "response.h5", "receptance"),
        read(folder, "one", "response.h5", "receptance"),
        rtol=1e-6,
    )


@pytest.mark.long
def test_modes_up_to_a_frequency_and_campbell(launch, folder):
    more = "campbell = { to = 60.0, step = 20.0, branches = 5 }"
    run(launch, folder, "swept", more=more, options=["--set", "modal.up_to=300"])
    frequency = read(folder, "swept", "modes.h5", "frequency")
    with h5py.File(folder / "swept" / "modes.h5") as stored:
        assert stored.attrs["inertia_count"] == len(frequency)
    assert 280 < frequency.max() < 300
    lines = read(folder, "swept", "rotating.h5", "campbell/frequency")
    assert lines.shape == (4, 5)
    np.testing.assert_allclose(lines[0], frequency[:5], rtol=0.02)
    assert (folder / "swept" / "report.html").read_text().count("Branches followed") >= 1


def test_round_tire_names_its_modes(launch, folder):
    scene = folder / "round.toml"
    scene.write_text("[tire]\nsegments = 16\nelements_arc = 4\n[modal]\ncount = 20\n")
    done = launch("-m", "runs", "run", scene, "--out", folder / "round", "--until", "modes")
    assert done.returncode == 0, done.stderr
    assert "solved by wave number 16" in done.stdout
    assert re.search(r"^  [RLT]\d [\d.]+ Hz, ", done.stdout, re.MULTILINE)
    wave = read(folder, "round", "modes.h5", "wave_number")
    name = read(folder, "round", "modes.h5", "name").astype(str)
    frequency = read(folder, "round", "modes.h5", "frequency")
    assert (read(folder, "round", "modes.h5", "wave_share") > 0.99).all()
    for n in range(1, 4):
        pair = frequency[(wave == n) & (name == f"R{n}")]
        assert len(pair) == 2
        assert pair[1] == pytest.approx(pair[0], rel=1e-6)


@pytest.mark.long
def test_full_states_in_a_window(launch, folder):
    """All of the projected ones between two frequencies, and none beside them."""
    run(launch, folder, "window", method="full", more="window = [60.0, 100.0]")
    run(launch, folder, "projected")
    inside = read(folder, "window", "rotating.h5", "frequency")
    every = read(folder, "projected", "rotating.h5", "frequency")
    wanted = np.sort(every[(every >= 60.0) & (every <= 100.0)])
    assert len(wanted) > 4
    np.testing.assert_allclose(np.sort(inside), wanted, rtol=1e-3)
    indicators = json.loads((folder / "window" / "summary.json").read_text())["stages"]["rotating"]
    error = indicators["indicators"]["truncation error of the projected eigenvalues"]["value"]
    assert 0 < error < 1e-3


@pytest.mark.parametrize(
    ("method", "window", "words"),
    [("full", "[9.0, 3.0]", "ascend"), ("projected", "[3.0, 9.0]", "method")],
)
def test_windows_that_mean_nothing(launch, folder, method, window, words):
    scene = folder / "nothing.toml"
    scene.write_text(TIRE.format(method=method, more=f"window = {window}", residual="none"))
    done = launch("-m", "runs", "check", scene)
    assert done.returncode == 2
    assert words in done.stderr


def test_full_method_refuses_attachment_modes(launch, folder):
    scene = folder / "refused.toml"
    scene.write_text(TIRE.format(method="full", more="", residual="attachment"))
    done = launch("-m", "runs", "check", scene)
    assert done.returncode == 2
    assert "attachment" in done.stderr
