"""How far a reader goes from outside to where something is computed: files entered, functions deep."""

import pytest

PROFILE = """
import os, sys
from tireroad.tests.started import ROOT

files, importing, stack = set(), 0, []


def own(code):
    return code.co_filename.startswith(f"{ROOT}/") and f"{ROOT}/tests/" not in code.co_filename


def told(frame):
    depth = 0
    while frame is not None:
        depth += own(frame.f_code)
        frame = frame.f_back
    print("journey", len(files), depth, flush=True)


def profile(frame, event, argument):
    global importing
    code = frame.f_code
    if code.co_name == "<module>":  # what a module does at its import is not read on the way
        importing += (event == "call") - (event == "return")
    elif event == "call" and not importing and own(code) and not code.co_name[0].isupper():
        files.add(code.co_filename)
        if code.co_name == END:
            sys.setprofile(None)
            told(frame)
            os._exit(0)


def follow(end, function):
    global END
    END = end
    sys.setprofile(profile)
    function()
    sys.setprofile(None)
    told(None)
"""
TANGENT = """
from tireroad.runs import cli
scene, out = sys.argv[1:]
follow("_take_tangent", lambda: cli.main(["run", scene, "--out", out, "--until", "static"]))
"""
MODES = """
import tireroad as tr
tire = tr.torus(segments=12, elements_arc=6, order=2, youngs_modulus=48e6)
static = tr.press(tire, inflation=2e5, load=300.0)
follow("", lambda: tr.modes(tire, static, count=20))
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
