"""The estimate of a small torus, which was too low by two to three: steps, files, contact memory."""

import math
from pathlib import Path

import pytest
from tires import soft_torus

from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.load import load
from tireroad.runs.scene.sizes import highest_frequency
from tireroad.runs.scene.tables.scene import Scene

SCENE = (
    soft_torus(24, 8, order=2)
    + """[static]
load = 500.0
error_estimate = false
[modal]
count = 40
[rotation]
speed = 50.0
[contact]
points = { dx = 0.006, dy = 0.006 }
youngs_modulus = 1e7
[road]
kind = "sine"
amplitude = 0.5e-3
wavelength = 0.2
[time]
duration = 0.1
[accuracy]
estimate = false
"""
)


def torus(folder: Path, *overrides: str) -> Scene:
    path = folder / "torus.toml"
    path.write_text(SCENE)
    return load(path, overrides)


@pytest.mark.parametrize(
    ("overrides", "highest", "steps"),
    [
        (["time.duration=20", "rotation.speed=60"], 256, 222039),
        (["rotation.speed=20"], 254, 875),
        (["modal.count=100"], 405, 1294),
        (["road.motion.kind=ramp", "road.motion.duration=1e-4"], 255, 16000),
    ],
)
def test_steps_are_those_of_the_rotation_shapes(
    tmp_path: Path, overrides: list[str], highest: float, steps: int
) -> None:
    """Measured on one process, but for the ramp: a sixteenth of it by the rule of the run.

    The fastest states have 1.5 to 2.05 times the highest mode's frequency.
    """
    scene = torus(tmp_path, *overrides)
    wanted = estimate(scene)
    assert highest_frequency(scene, wanted.sizes.modes) == pytest.approx(highest, rel=0.2)
    assert wanted.sizes.steps == pytest.approx(steps, rel=0.25)


@pytest.mark.parametrize(
    ("count", "youngs", "found"), [(8, 48e6, 119), (20, 480e6, 606), (60, 48e6, 313)]
)
def test_a_curved_wall_has_few_slow_modes(
    tmp_path: Path, count: int, youngs: float, found: float
) -> None:
    """Measured; the density of a flat plate's modes gave 0.29 to 0.67 of these frequencies."""
    scene = torus(tmp_path, f"tire.material.youngs_modulus={youngs}", f"modal.count={count}")
    assert highest_frequency(scene, count) == pytest.approx(found, rel=0.25)


def test_a_curved_wall_without_tension(tmp_path: Path) -> None:
    """Waves below their cut-on were 0/0: a traceback with up_to, and a highest mode at 1 mHz."""
    slack = torus(tmp_path, "static.inflation=0", "modal.count=60")
    nearly = torus(tmp_path, "static.inflation=1", "modal.count=60")
    assert highest_frequency(slack, 60) == pytest.approx(highest_frequency(nearly, 60), rel=1e-3)
    few = torus(tmp_path, "static.inflation=0", "modal.count=", "modal.up_to=200")
    assert 0 < estimate(few).sizes.modes < 60


@pytest.mark.parametrize(
    ("overrides", "written"),
    [
        (["time.duration=2", "contact.friction=0"], 50.6),
        (
            [
                "time.duration=0.5",
                "output.vibration=true",
                "output.fields=true",
                "contact.friction=0",
            ],
            21.9,
        ),
        (["contact=", "road=", "time=", "modal.count=300", "rotation.campbell.to=200"], 15.8),
    ],
)
def test_all_files_are_in_it(tmp_path: Path, overrides: list[str], written: float) -> None:
    """Measured, MB; a checkpoint, which short runs have not, doubles contact.h5."""
    wanted = estimate(torus(tmp_path, *overrides))
    assert written / 1.1 < sum(wanted.disk.values()) / 1e6 < 1.5 * written
    assert all(math.isfinite(size) and size > 0 for size in wanted.disk.values())


GRID = "contact.points={{dx={0},dy={0}}}"


@pytest.mark.parametrize(
    ("overrides", "taken"),
    [
        (["time.duration=0.1"], 0.29),
        ([GRID.format(0.002), "time.duration=0.05", "contact.friction=0.8"], 0.50),
        ([GRID.format(0.0012), "time.duration=0.01", "time.step=5e-5"], 0.67),
        (
            [
                GRID.format(0.0012),
                "time.duration=0.01",
                "time.step=5e-5",
                "contact.friction=0.8",
            ],
            0.67,
        ),
    ],
)
def test_results_between_writes_and_the_usual_set_are_in_it(
    tmp_path: Path, overrides: list[str], taken: float
) -> None:
    """Measured on one process, GB; 0.38, 0.42 and 0.47 were estimated for the last three."""
    wanted = estimate(torus(tmp_path, *overrides))
    assert taken / 1.05 < sum(wanted.memory.values()) / 1e9 < 1.3 * taken


def test_the_training_of_large_motions_is_in_it(tmp_path: Path) -> None:
    """Fields of 300 states and stiffnesses of all cells: more on a finer mesh, nothing of a linear tire."""
    name, large = "training of large motions", 'motion.kind="large"'
    few = estimate(torus(tmp_path, large)).memory[name]
    finer = estimate(torus(tmp_path, large, "tire.segments=48")).memory[name]
    assert 2.0 < finer / few < 3.0
    assert few > 8 * 2 * 300 * estimate(torus(tmp_path)).sizes.free
    assert name not in estimate(torus(tmp_path)).memory


def test_slow_rubber_takes_memory_where_moduli_depend_on_frequency(
    root: Path, tmp_path: Path
) -> None:
    """435 poles for 549 loads standing, 55 for 741 at 80 km/h; none in a torus of one modulus."""
    scene = root / "runs" / "scenes" / "quickstart.toml"
    rolling, standing = load(scene), load(scene, ["rotation.speed=0"])
    taken = [estimate(one) for one in (rolling, standing)]
    loads = [(3 if one.contact.has_friction else 1) for one in (rolling, standing)]
    poles = []
    for one, each in zip(taken, loads, strict=True):
        count = each * one.sizes.nodes
        rest = one.memory["slow rubber"] - 8.0 * 12 * count**2
        poles.append(rest / (128.0 * count) / count)
    assert poles == pytest.approx([55 / 741, 435 / 549], rel=0.1)
    assert "slow rubber" not in estimate(torus(tmp_path)).memory
    without = estimate(load(scene, ['greens.residual="none"']))
    assert "slow rubber" not in without.memory
