"""How far a reader goes from outside to where something is computed: files entered, functions deep."""

import pytest

PROFILE = """
import os, sys
from tireroad.tests.started import ROOT

files, importing, rounds = set(), 0, 0


def own(code):
    return code.co_filename.startswith(f"{ROOT}/") and f"{ROOT}/tests/" not in code.co_filename


def told(frame):
    depth = 0
    while frame is not None:
        depth += own(frame.f_code)
        frame = frame.f_back
    print("journey", len(files), depth, flush=True)


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
        files.add(code.co_filename)
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
SCENE = """
[tire]
segments = 12
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 300.0
"""


def journey(launch, script: str, *arguments: object) -> tuple[int, int]:
    """Files of the program entered, and its functions on the stack at the end."""
    done = launch("-c", PROFILE + script, *arguments)
    line = next(line for line in done.stdout.splitlines() if line.startswith("journey"))
    files, depth = line.split()[1:]
    return int(files), int(depth)


@pytest.mark.slow
def test_from_the_command_to_the_first_tangent(launch, tmp_path) -> None:
    """It was 113 files and 34 functions."""
    (tmp_path / "scene.toml").write_text(SCENE)
    files, depth = journey(launch, TANGENT, tmp_path / "scene.toml", tmp_path / "out")
    assert 20 < files <= 45 and 8 < depth <= 16


@pytest.mark.slow
def test_from_the_library_to_the_modes(launch) -> None:
    """It was 46 files."""
    files, _ = journey(launch, MODES)
    assert 10 < files <= 27


@pytest.mark.slow
def test_one_time_step(launch) -> None:
    """With friction, on a grid of points; it was 13 files."""
    files, _ = journey(launch, STEP)
    assert 2 < files <= 6
