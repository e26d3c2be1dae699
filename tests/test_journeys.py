"""How far a reader goes from outside to where something is computed: files, functions, and how deep."""

import pytest

PROFILE = """
import os, sys
from tireroad.tests.started import ROOT

files, functions, importing, rounds = set(), set(), 0, 0


def own(code):
    return code.co_filename.startswith(f"{ROOT}/") and f"{ROOT}/tests/" not in code.co_filename


def told(frame):
    depth = 0
    while frame is not None:
        depth += own(frame.f_code)
        frame = frame.f_back
    print("journey", len(files), len(functions), depth, flush=True)


def profile(frame, event, argument):
    global importing, rounds
    code = frame.f_code
    if code.co_name == "<module>":  # what a module does at its import is not read on the way
        importing += (event == "call") - (event == "return")
    elif event == "call" and not importing and own(code) and not code.co_name[0].isupper():
        if code.co_name == ROUND:
            rounds += 1
            if rounds == 2:  # the first one prepares
                files.clear()
                functions.clear()
        files.add(code.co_filename)
        functions.add((code.co_filename, code.co_qualname))
        if code.co_name == END or rounds == 3:
            sys.setprofile(None)
            told(frame)
            os._exit(0)


def follow(function, end="", every=""):
    # To the call of `end`, or the second round from one call of `every` to the next.
    global END, ROUND
    END, ROUND = end, every
    sys.setprofile(profile)
    function()
    sys.setprofile(None)
    told(None)
"""
TANGENT = """
from tireroad.runs import cli
scene, out = sys.argv[1:]
follow(lambda: cli.main(["run", scene, "--out", out, "--until", "static"]), end="_take_tangent")
"""
MODES = """
import tireroad as tr
tire = tr.torus(segments=12, elements_arc=6, order=2, youngs_modulus=48e6)
static = tr.press(tire, inflation=2e5, load=300.0)
follow(lambda: tr.modes(tire, static, count=20))
"""
STEP = """
import tireroad as tr
tire = tr.torus(segments=12, elements_arc=6, order=2, youngs_modulus=48e6)
static = tr.press(tire, inflation=2e5, load=300.0)
turning = tr.roll(tr.modes(tire, static, count=20), tr.Turning(speed=50.0, damping=(500.0, 0.0)))
road = tr.make_road(kind="sine", amplitude=5e-4, wavelength=0.2)
follow(lambda: tr.drive(turning, road, duration=0.01, spacing=0.004), every="predict")
"""
LOADED = """
from tireroad.runs.scene.load import load
follow(lambda: load(sys.argv[1]))
"""
SCENE = """
[tire]
segments = 12
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 300.0
"""
ON_A_ROAD = """
[contact]
[road]
kind = "sine"
[time]
"""


def journey(launch, script: str, *arguments: object) -> tuple[int, int, int]:
    """Files of the program entered, functions called, and functions on the stack at the end."""
    done = launch("-c", PROFILE + script, *arguments)
    line = next(line for line in done.stdout.splitlines() if line.startswith("journey"))
    files, functions, depth = map(int, line.split()[1:])
    return files, functions, depth


@pytest.mark.slow
def test_from_the_command_to_the_first_tangent(launch, tmp_path) -> None:
    """It was 113 files, and 34 functions deep."""
    (tmp_path / "scene.toml").write_text(SCENE)
    files, functions, depth = journey(launch, TANGENT, tmp_path / "scene.toml", tmp_path / "out")
    assert 20 < files <= 52 and functions <= 484 and 8 < depth <= 16


@pytest.mark.slow
def test_from_the_library_to_the_modes(launch) -> None:
    """It was 46 files."""
    files, functions, _ = journey(launch, MODES)
    assert 10 < files <= 27 and functions <= 234


@pytest.mark.slow
def test_one_time_step(launch) -> None:
    """With friction, on a grid of points, over a road that is read where the points lie; it was 13 files and 77 functions."""
    files, functions, _ = journey(launch, STEP)
    assert 2 < files <= 10 and functions <= 40


@pytest.mark.slow
def test_from_a_file_to_a_scene(launch, tmp_path) -> None:
    """Of a tire on a road; it was 31 files, then 15 with 158 functions."""
    (tmp_path / "scene.toml").write_text(SCENE + ON_A_ROAD)
    files, functions, _ = journey(launch, LOADED, tmp_path / "scene.toml")
    assert 10 < files <= 13 and functions <= 113
