"""What damping by the stiffness takes in the static state, before it is taken."""

from pathlib import Path

import pytest

from tireroad.runs.scene.extent.estimate import Estimate, estimate
from tireroad.runs.scene.extent.static_state import DAMPING
from tireroad.runs.scene.load import load

SCENE = """
[tire]
segments = 22
elements_arc = 10
order = 2
[static]
inflation = 1.31e5
load = 313.0
error_estimate = false
[rotation]
speed = 100.0
"""


def static(folder: Path, *settings: str) -> Estimate:
    file = folder / "scene.toml"
    file.write_text(SCENE)
    return estimate(load(file, list(settings)), until="static")


def test_much_damping_is_as_measured(tmp_path: Path) -> None:
    """Processor time of one core beside other work, and memory (2026-11-25); told were 2 s and 0.31 GB."""
    much = static(tmp_path, "damping.stiffness=1e-3")
    assert 0.514 / 1.5 < sum(much.memory.values()) / 1e9 < 0.514 * 1.5
    assert 8.8 / 2 < much.seconds["static"] < 8.8 * 2


@pytest.mark.parametrize(
    "settings",
    [["damping.stiffness=1e-5"], ["damping.stiffness=1e-3", "static.steady_rolling=false"]],
)
def test_little_damping_or_a_state_at_rest_adds_nothing(tmp_path: Path, settings: list) -> None:
    given, none = static(tmp_path, *settings), static(tmp_path)
    assert DAMPING not in given.memory
    assert (given.memory, given.seconds) == (none.memory, none.seconds)
