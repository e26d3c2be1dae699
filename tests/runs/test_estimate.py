"""Memory, disk, steps and time before they are taken: against measured runs, and refused in time."""

import shutil
from pathlib import Path

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.scene.check import explain
from tireroad.runs.scene.extent import demand
from tireroad.runs.scene.extent.estimate import estimate, memory
from tireroad.runs.scene.extent.sizes import highest_frequency, sizes
from tireroad.runs.scene.load import load


@pytest.fixture
def quickstart(root: Path) -> Path:
    return root / "runs" / "scenes" / "quickstart.toml"


def test_quickstart_is_as_measured(quickstart: Path) -> None:
    """Measured on one process: 1.17 GB, 603 points on 277 nodes, 2122 steps, modes to 513 Hz, and a
    contact.h5 of 7.3 MB, twice that with its checkpoint."""
    wanted = estimate(load(quickstart))
    assert 1.17 / 1.5 < sum(wanted.memory.values()) / 1e9 < 1.17 * 1.5
    assert wanted.sizes.points == pytest.approx(603, rel=0.3)
    assert wanted.sizes.nodes == pytest.approx(277, rel=0.4)
    assert wanted.sizes.steps == pytest.approx(2122, rel=0.3)
    assert highest_frequency(load(quickstart), 200) == pytest.approx(513, rel=0.3)
    assert 14.6 / 2 < wanted.disk["contact.h5"] / 1e6 < 14.6 * 2


def test_passenger_is_as_measured(root: Path) -> None:
    """Measured on one process without error bars: 92 s of one core and 1.69 GB; the pivot's matrices are in it."""
    scene = root / "runs" / "scenes" / "passenger.toml"
    wanted = estimate(load(scene, ["accuracy.estimate=false"]))
    assert 92 / 1.6 < sum(wanted.seconds.values()) < 92 * 1.6
    assert 1.69 / 1.6 < sum(wanted.memory.values()) / 1e9 < 1.69 * 1.6
    assert wanted.sizes.points == pytest.approx(1631, rel=0.3)
    product = estimate(load(scene, ["accuracy.estimate=false", 'contact.solver="projected-cg"']))
    pivoted = wanted
    matrix = 8.0 * pivoted.sizes.points**2
    assert pivoted.memory["contact"] - product.memory["contact"] > 3 * matrix


def test_modes_below_a_frequency_count(quickstart: Path) -> None:
    """A wall like the quickstart's with c10 = 1.2 MPa was measured to have 523 modes below 500 Hz."""
    soft = ["tire.material.model=yeoh", "tire.material.youngs_modulus=", "tire.material.c10=1.2e6"]
    soft += ["tire.material.poisson_ratio=", "modal.count=", "modal.up_to=500"]
    scene = load(quickstart, [*soft, "tire.outer_radius=0.316", "tire.minor_radius=0.105"])
    assert sizes(scene).modes == pytest.approx(523, rel=0.3)
    taken = [
        sum(memory(load(quickstart, [f"modal.up_to={f}"])).values()) for f in (500, 1000, 2000)
    ]
    assert taken[0] < taken[1] - 1e8 < taken[2] - 3e8


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["time.duration=1e5", "time.step=1e-3"], ["disk", "time.duration, time.step"]),
        (
            ["tire.segments=4000", "tire.elements_arc=1000", "tire.order=3"],
            ["memory", "GB are free"],
        ),
        (["modal.count=27000"], ["memory", "rotating pencil (modal.count"]),
        (["contact.points={dx=1e-5,dy=1e-5}"], ["contact.points"]),
    ],
)
def test_what_cannot_succeed_is_refused_by_its_key(
    quickstart, overrides, words, monkeypatch
) -> None:
    free = "tireroad.runs.scene.extent.demand.available_memory"
    monkeypatch.setattr(free, lambda: 64e9)  # whatever runs beside
    with pytest.raises(InputError) as caught:
        explain(load(quickstart, overrides))
    for word in words:
        assert word in str(caught.value)


def test_run_refuses_what_check_refuses(quickstart: Path, launch, tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out", "--set", "modal.count=27000")
    done = launch("-m", "runs", "run", quickstart, *out)
    assert done.returncode == 2 and "rotating pencil (modal.count" in done.stderr
    assert not list((tmp_path / "out").glob("*.h5"))


def test_doubt_is_a_warning_and_certainty_an_error(quickstart, monkeypatch, tmp_path) -> None:
    wanted = estimate(load(quickstart))
    needed = sum(wanted.memory.values())
    for share, outcome in ((0.5, "refused"), (1.0, "warned"), (2.0, "silent")):
        monkeypatch.setattr(demand, "available_memory", lambda share=share: share * needed)
        if outcome == "refused":
            with pytest.raises(InputError, match="matrices"):
                demand.check_demand(wanted, tmp_path)
        else:
            assert len(demand.check_demand(wanted, tmp_path)) == (outcome == "warned")
    # Each process holds its own matrices.
    with pytest.raises(InputError, match="memory"):
        demand.check_demand(wanted, tmp_path, processes=4)


def test_the_disk_is_that_of_the_result_folder(quickstart, monkeypatch, tmp_path) -> None:
    asked = []
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(
        demand.shutil, "disk_usage", lambda p: (asked.append(p), usage._replace(free=1000))[1]
    )
    with pytest.raises(InputError, match=r"disk in .*not/yet"):
        demand.check_demand(estimate(load(quickstart)), tmp_path / "not" / "yet")
    assert asked == [tmp_path]


def test_hours_are_said(quickstart: Path, monkeypatch, tmp_path: Path) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(demand.shutil, "disk_usage", lambda _: usage._replace(free=10**13))
    wanted = estimate(load(quickstart, ["time.duration=100", "time.step=1e-5"]))
    (warning,) = demand.check_demand(wanted, tmp_path)
    assert "2 hours of one core" in warning and "contact loop (time.duration" in warning
