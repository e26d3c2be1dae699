"""Memory and time of static states with friction: against measured runs, and in their growth."""

from pathlib import Path

import pytest

from tireroad.runs.scene.extent.demand import memory_of
from tireroad.runs.scene.extent.estimate import Estimate, estimate
from tireroad.runs.scene.extent.static_state import FRICTION, LOAD_ERROR
from tireroad.runs.scene.load import load

SCENE = """
[tire]
section = "radial"
segments = 16
elements_arc = 8
[static]
inflation = 2.2e5
load = 3000.0
friction = 0.8
error_estimate = false
"""
FINE = ["tire.segments=24", "tire.elements_arc=12", "rotation.speed=40.0"]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def static(scene: Path, *settings: str) -> Estimate:
    """Of the static state alone."""
    return estimate(load(scene, settings), "static")


@pytest.mark.parametrize(
    ("settings", "seconds", "taken"),
    [
        (["static.friction_steps=6"], 66, 0.86),
        (["rotation.speed=40.0"], 38, 1.21),
        ([*FINE, "rotation.slip_angle=1.0"], 106, 1.98),
    ],
)
def test_friction_is_as_measured(scene: Path, settings: list, seconds: float, taken: float) -> None:
    """Processor time (s) of one core beside other work, and GB, on one process (2026-11-25). Told
    were 6 to 11 s, and 0.68 to 0.99 GB, as without friction."""
    found = static(scene, *settings)
    assert seconds / 1.6 < found.seconds["static"] < 1.6 * seconds
    assert taken / 1.3 < sum(found.memory.values()) / 1e9 < 1.3 * taken


def test_each_part_of_friction_takes_its_time(scene: Path) -> None:
    """Pressing, rolling freely and slipping are found one after another."""
    rolling = [*FINE, "rotation.rolling_radius=0.31"]
    takes = [
        static(scene, *settings).work["static"]
        for settings in (
            [*rolling, "static.friction="],
            rolling,
            [*rolling, "rotation.slip_angle=1.0"],
            [*FINE, "rotation.slip_angle=1.0"],
        )
    ]
    assert takes == sorted(takes) and takes[1] > 2 * takes[0]
    standing = [static(scene, f"static.friction_steps={k}").work["static"] for k in (5, 10, 20)]
    assert standing[2] - standing[1] == pytest.approx(2 * (standing[1] - standing[0]))


def test_friction_without_a_road_takes_nothing(scene: Path) -> None:
    bare, given = (static(scene, "static.load=", *more) for more in ([], ["static.friction="]))
    assert (bare.seconds, bare.memory) == (given.seconds, given.memory)


def test_the_larger_of_friction_and_the_load_s_error_counts(scene: Path) -> None:
    """One is released before the other comes. Processes share a factor by rows."""
    both = static(scene, "rotation.speed=40.0", "static.error_estimate=true").memory
    assert len(both.keys() & {FRICTION, LOAD_ERROR}) == 1
    alone = static(scene)
    assert memory_of(alone, 4)[FRICTION] == alone.memory[FRICTION]
