"""Processor time before it is taken, and what friction and damping by the stiffness take: against measured runs, and in its growth."""

from pathlib import Path

import pytest

from tireroad.runs.scene.estimate import (
    DAMPING,
    FRICTION,
    LOAD_ERROR,
    Estimate,
    estimate,
    memory_of,
)
from tireroad.runs.scene.load import load

SMALL = ["tire.segments=26", "tire.elements_arc=8", "modal.count=100"]
LARGE = ["tire.segments=150", "tire.elements_arc=42"]
FINE = ["tire.segments=30", "tire.elements_arc=26", "modal.up_to=547.3"]
# Processor time (s) by stage of one core of a shared server (Intel Xeon) beside other work, one BLAS thread, 2026-11-23,
# without error bars.
MEASURED = [
    ("torus", SMALL, {"static": 1.4, "modes": 1.73}),
    ("torus", ["contact.friction=0"], {"static": 6.2, "modes": 9.21, "greens": 2.57}),
    ("torus", LARGE, {"static": 105.0}),
    (
        "passenger",
        ["contact.friction=0"],
        {"static": 9.12, "modes": 12.7, "greens": 9.44, "contact loop": 8.84},
    ),
    ("torus", [], {"contact loop": 2.3}),  # 2026-11-28, 1.3 s on a core nearly twice as fast
    ("passenger", FINE, {"static": 39.3, "modes": 69.7}),
]
RUBBING = """
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
DAMPED = """
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
RUBBING_FINE = ["tire.segments=24", "tire.elements_arc=12", "rotation.speed=40.0"]


def told(root: Path, scene: str, settings: list[str]) -> Estimate:
    """Of a scene with all its stages."""
    return estimate(load(root / "runs" / "scenes" / f"{scene}.toml", settings))


@pytest.mark.parametrize(("scene", "settings", "taken"), MEASURED)
def test_seconds_are_as_measured(root: Path, scene: str, settings: list[str], taken: dict) -> None:
    seconds = told(root, scene, settings).seconds
    for stage, measured in taken.items():
        assert measured / 1.6 < seconds[stage] < 1.6 * measured, stage


@pytest.mark.parametrize(
    ("friction", "each"),
    [(["contact.friction=0.8"], 1.1e-3), (["contact.brush_stiffness=2000.0"], 1.1e-3)],
)
def test_what_a_step_with_horizontal_forces_costs(
    root: Path, friction: list[str], each: float
) -> None:
    """Measured 0.5 ms a step of the same scene on a core nearly twice as fast, with either (2026-11-28)."""
    found = told(root, "torus", ["time.step=1e-4", "time.duration=0.1", *friction])
    assert each / 1.6 < found.seconds["contact loop"] / 1000 < 1.6 * each


@pytest.mark.parametrize(("scene", "share"), [("torus", 0.49), ("passenger", 0.35)])
def test_error_bars_count(root: Path, scene: str, share: float) -> None:
    """Their time over that of all other stages as measured, one BLAS thread, 2026-11-24."""
    seconds = told(root, scene, []).seconds
    bars = seconds.pop("error bars")
    assert bars == pytest.approx(share * sum(seconds.values()), rel=0.25)
    assert "error bars" not in told(root, scene, ["accuracy.estimate=false"]).seconds


def test_the_error_of_the_load_counts(root: Path) -> None:
    """12 s beside 6.6 s of the state (2026-11-25), of which nothing was told."""
    bare, given = (
        told(root, "torus", [f"static.error_estimate={one}"]) for one in ("false", "true")
    )
    assert 12 / 1.6 < given.seconds[LOAD_ERROR] < 1.6 * 12
    assert given.seconds == bare.seconds | {LOAD_ERROR: given.seconds[LOAD_ERROR]}
    off = told(root, "point_force", ["static.error_estimate=true"])
    assert LOAD_ERROR not in off.seconds


@pytest.mark.parametrize(
    ("settings", "stages"),
    [
        ("tire.segments={}", ("static", "modes", "greens")),
        ("tire.elements_arc={}", ("static", "modes", "greens")),
        ("modal.count={}", ("modes", "rotating", "contact loop")),
    ],
)
def test_more_takes_longer(root: Path, settings: str, stages: tuple[str, ...]) -> None:
    growing = [told(root, "torus", [settings.format(k)]) for k in (40, 80, 160, 320)]
    for stage in stages:
        for kind in ("seconds", "work"):
            times = [getattr(one, kind)[stage] for one in growing]
            assert times == sorted(times) and times[-1] > 1.2 * times[0], (stage, kind)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "scene.toml").write_text(RUBBING)
    return tmp_path / "scene.toml"


def static(scene: Path, *settings: str) -> Estimate:
    """Of the static state alone."""
    return estimate(load(scene, settings), "static")


@pytest.mark.parametrize(
    ("settings", "seconds", "taken"),
    [
        (["static.friction_steps=6"], 66, 0.86),
        (["rotation.speed=40.0"], 38, 1.21),
        ([*RUBBING_FINE, "rotation.slip_angle=1.0"], 106, 1.98),
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
    rolling = [*RUBBING_FINE, "rotation.rolling_radius=0.31"]
    takes = [
        static(scene, *settings).work["static"]
        for settings in (
            [*rolling, "static.friction="],
            rolling,
            [*rolling, "rotation.slip_angle=1.0"],
            [*RUBBING_FINE, "rotation.slip_angle=1.0"],
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


def damped(folder: Path, *settings: str) -> Estimate:
    file = folder / "scene.toml"
    file.write_text(DAMPED)
    return estimate(load(file, list(settings)), until="static")


def test_much_damping_is_as_measured(tmp_path: Path) -> None:
    """Processor time of one core beside other work, and memory (2026-11-25); told were 2 s and 0.31 GB."""
    much = damped(tmp_path, "damping.stiffness=1e-3")
    assert 0.514 / 1.5 < sum(much.memory.values()) / 1e9 < 0.514 * 1.5
    assert 8.8 / 2 < much.seconds["static"] < 8.8 * 2


@pytest.mark.parametrize(
    "settings",
    [["damping.stiffness=1e-5"], ["damping.stiffness=1e-3", "static.steady_rolling=false"]],
)
def test_little_damping_or_a_state_at_rest_adds_nothing(tmp_path: Path, settings: list) -> None:
    given, none = damped(tmp_path, *settings), damped(tmp_path)
    assert DAMPING not in given.memory
    assert (given.memory, given.seconds) == (none.memory, none.seconds)
