"""Scenes beyond what a tire can do: the message names the cause."""

from pathlib import Path

import pytest

SCENE = """
name = "limits"
tire = {segments = 12, elements_arc = 4, material = {youngs_modulus = 48e6}}
static = {load = 300.0, error_estimate = false}
modal = {count = 8}
rotation = {speed = 50.0}
contact = {youngs_modulus = 1e7}
road = {kind = "step"}
time = {duration = 0.004, step = 2e-4}
"""


def _run(launch, folder: Path, *overrides: str):
    (folder / "scene.toml").write_text(SCENE)
    given = [part for item in overrides for part in ("--set", item)]
    return launch("-m", "runs", "run", folder / "scene.toml", "--out", folder / "out", *given)


@pytest.mark.long
def test_too_much_speed_is_named(launch, tmp_path: Path) -> None:
    """1000 rad/s: no rolling shape. Not "the tire may fold": at rest the same loads converge."""
    done = _run(launch, tmp_path, "rotation.speed=1000", "road=", "contact=", "static.load=")
    assert done.returncode == 3, done.stderr
    assert "no steady rolling shape at rotation.speed = 1000 rad/s" in done.stderr
    assert "fold" not in done.stderr


@pytest.mark.slow
def test_a_road_up_to_the_flanks_is_named(launch, tmp_path: Path) -> None:
    done = _run(launch, tmp_path, "road.offset=0.5", 'contact.points="nodes"')
    assert done.returncode == 2, done.stderr
    assert "road's height" in done.stderr and "contact.reach" in done.stderr
    again = _run(launch, tmp_path, "contact.points={dx=1e-5,dy=1e-5}")
    assert again.returncode == 2 and "contact.points" in again.stderr


@pytest.mark.long
def test_states_of_the_full_matrices_carry_a_contact(launch, tmp_path: Path) -> None:
    """Their coordinates are not the modes': the energy balance tells the work alone (it crashed)."""
    done = _run(launch, tmp_path, "rotation.method=full", "road.kind=flat")
    assert done.returncode == 0, done.stderr
    assert "J into the tire" in done.stdout


@pytest.mark.slow
def test_beyond_the_critical_speed_is_said(launch, tmp_path: Path) -> None:
    """On the shape at rest modes exist beyond it; what is computed has little meaning."""
    still = ("static.steady_rolling=false", "rotation.speed=600", "damping.mass=0")
    done = _run(launch, tmp_path, *still, "road.kind=flat", "modal.count=12")
    assert "rotation.speed = 600 rad/s lies beyond the tire's critical speed of 3" in done.stderr
