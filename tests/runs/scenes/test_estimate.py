"""Memory, disk, steps and time before they are taken: against measured runs, and refused in time."""

import shutil
from pathlib import Path

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.check import explain
from tireroad.runs.process import demand
from tireroad.runs.scene import estimate as scene_estimate
from tireroad.runs.scene.estimate import estimate, memory
from tireroad.runs.scene.load import load
from tireroad.runs.scene.sizes import highest_frequency, sizes

ON_DISK = """
from pathlib import Path
import numpy as np
from scipy import sparse
from tireroad.runs.process.surroundings import factors_on_disk
from tireroad.modal.solver.slicing import Shifted
folder = Path({folder!r}) / "factors"
folder.mkdir()
matrix = sparse.diags([-1.0, 2.5, -1.0], [-1, 0, 1], shape=(900, 900), format="csr")
with factors_on_disk(folder):
    factor = Shifted(matrix, 0.1)
    answer = factor.solve(np.ones((900, 2)))
    factor_files = any(folder.iterdir())
right = np.allclose(matrix @ answer - 0.1 * answer, 1.0)
print(factor._factor.getMumpsIcntl(22), factor_files, right, Shifted(matrix, 0.1)._factor.getMumpsIcntl(22))
"""


@pytest.fixture
def torus(root: Path) -> Path:
    return root / "runs" / "scenes" / "torus.toml"


def test_torus_is_as_measured(torus: Path) -> None:
    """Measured on one process: 1.17 GB, 603 points on 277 nodes, 2122 steps, modes to 513 Hz, and a
    contact.h5 of 7.3 MB, twice that with its checkpoint."""
    wanted = estimate(load(torus))
    assert 1.17 / 1.5 < sum(wanted.memory.values()) / 1e9 < 1.17 * 1.5
    assert wanted.sizes.points == pytest.approx(603, rel=0.3)
    assert wanted.sizes.nodes == pytest.approx(277, rel=0.4)
    assert wanted.sizes.steps == pytest.approx(2122, rel=0.3)
    assert highest_frequency(load(torus), 200) == pytest.approx(513, rel=0.3)
    assert 14.6 / 2 < wanted.disk["contact.h5"] / 1e6 < 14.6 * 2


def test_passenger_is_as_measured(root: Path) -> None:
    """Measured on one process without error bars: 43 s of one core and 1.69 GB; the pivot's matrices are in it."""
    scene = root / "runs" / "scenes" / "passenger.toml"
    wanted = estimate(load(scene, ["accuracy.estimate=false", "contact.friction=0"]))
    assert 43 / 1.6 < sum(wanted.seconds.values()) < 43 * 1.6
    assert 1.69 / 1.6 < sum(wanted.memory.values()) / 1e9 < 1.69 * 1.6
    assert wanted.sizes.points == pytest.approx(1631, rel=0.3)
    product = estimate(
        load(
            scene,
            ["accuracy.estimate=false", "contact.friction=0", 'contact.solver="projected-cg"'],
        )
    )
    pivoted = wanted
    matrix = 8.0 * pivoted.sizes.points**2
    # The results of a block are counted at another time than it pivots.
    assert pivoted.memory["contact"] - product.memory["contact"] > 2 * matrix


@pytest.mark.parametrize(
    ("segments", "along", "taken"), [(16, 12, 2.1), (20, 16, 2.4), (30, 26, 6.8)]
)
def test_the_estimate_of_the_load_is_in_it(
    root: Path, segments: int, along: int, taken: float
) -> None:
    """Measured on one process: GB of the static state of 30,240 to 102,060 unknowns, of which 1.4 to 2 were told before."""
    mesh = [f"tire.segments={segments}", f"tire.elements_arc={along}", "static.error_estimate=true"]
    wanted = estimate(load(root / "runs" / "scenes" / "passenger.toml", mesh), until="static")
    assert taken / 1.25 < sum(wanted.memory.values()) / 1e9 < taken * 1.25


def test_modes_below_a_frequency_count(torus: Path) -> None:
    """A wall like the torus's with c10 = 1.2 MPa was measured to have 523 modes below 500 Hz."""
    soft = ["tire.material.model=yeoh", "tire.material.youngs_modulus=", "tire.material.c10=1.2e6"]
    soft += ["tire.material.poisson_ratio=", "modal.count=", "modal.up_to=500"]
    scene = load(torus, [*soft, "tire.outer_radius=0.316", "tire.minor_radius=0.105"])
    assert sizes(scene).modes == pytest.approx(523, rel=0.3)
    taken = [sum(memory(load(torus, [f"modal.up_to={f}"])).values()) for f in (500, 1000, 2000)]
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
def test_what_cannot_succeed_is_refused_by_its_key(torus, overrides, words, monkeypatch) -> None:
    free = "tireroad.runs.process.demand.available_memory"
    monkeypatch.setattr(free, lambda: 64e9)  # whatever runs beside
    with pytest.raises(InputError) as caught:
        explain(load(torus, overrides))
    for word in words:
        assert word in str(caught.value)


def test_check_tells_what_each_process_takes(torus: Path, monkeypatch) -> None:
    """Two have more than one together, and each less; factors that do not fit are on disk."""
    scene, told = load(torus), []
    for count, free in ((1, 1e12), (2, 1e12), (2, 1.2e9)):
        monkeypatch.setattr(demand, "available_memory", lambda free=free: free)
        line = next(x for x in explain(scene, count).splitlines() if "estimated memory" in x)
        told.append(float(line.split()[2]))
    assert told[0] / 2 < told[1] < told[0]
    assert told[2] < told[1] and line.endswith("GB in each of 2 processes, factors on disk")


@pytest.mark.slow
def test_run_refuses_what_check_refuses(torus: Path, launch, tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out", "--set", "modal.count=27000")
    done = launch("-m", "runs", "run", torus, *out)
    assert done.returncode == 2 and "rotating pencil (modal.count" in done.stderr
    assert not list((tmp_path / "out").glob("*.h5"))


def test_doubt_is_a_warning_and_certainty_an_error(torus, monkeypatch, tmp_path) -> None:
    wanted = estimate(load(torus))
    needed = sum(wanted.memory.values())
    for share, outcome in ((0.5, "refused"), (1.0, "warned"), (2.0, "silent")):
        monkeypatch.setattr(demand, "available_memory", lambda share=share: share * needed)
        if outcome == "refused":
            with pytest.raises(InputError, match="matrices"):
                demand.check_demand(wanted, tmp_path)
        else:
            told = " ".join(demand.check_demand(wanted, tmp_path))
            assert ("GB are free" in told) == ("out of core" in told) == (outcome == "warned")
    # Factors and matrices are spread over the processes; each one has a program and a pencil of its own.
    together = scene_estimate.memory_of(wanted, 4)
    assert together["matrices"] == wanted.memory["matrices"]
    assert together["program"] == 4 * wanted.memory["program"]


def test_factors_go_to_disk_where_memory_is_short(torus, monkeypatch, tmp_path) -> None:
    """Twelve times the mesh: its factor, and with it the run, fits only so; said, and not refused."""
    larger = ["tire.segments=300", "tire.elements_arc=32", "modal.count=20"]
    wanted = estimate(load(torus, larger), until="static")
    needed, factor = sum(wanted.memory.values()), wanted.memory[scene_estimate.FACTOR]
    assert factor > needed / 4
    room = (needed - scene_estimate.ON_DISK * factor) / demand.DOUBTFUL * 1.01
    monkeypatch.setattr(demand, "available_memory", lambda: room)
    assert demand.out_of_core(wanted, 1)
    (warning,) = (one for one in demand.check_demand(wanted, tmp_path) if "memory" in one)
    assert "MUMPS out of core" in warning
    monkeypatch.setattr(demand, "available_memory", lambda: 2 * needed)
    assert not demand.out_of_core(wanted, 1)


def test_a_factor_on_disk_is_a_factor(tmp_path: Path, launch) -> None:
    """In a process of its own: PETSc's options stay as they are to its end."""
    script = tmp_path / "on_disk.py"
    script.write_text(ON_DISK.format(folder=str(tmp_path)))
    done = launch(script)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", "True", "True", "0"]


def test_the_disk_is_that_of_the_result_folder(torus, monkeypatch, tmp_path) -> None:
    asked = []
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(
        demand.shutil,
        "disk_usage",
        lambda p: (asked.append(p), usage._replace(free=1000))[1],
    )
    with pytest.raises(InputError, match=r"disk in .*not/yet"):
        demand.check_demand(estimate(load(torus)), tmp_path / "not" / "yet")
    assert asked == [tmp_path]


def test_hours_are_said(torus: Path, monkeypatch, tmp_path: Path) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(demand.shutil, "disk_usage", lambda _: usage._replace(free=10**13))
    wanted = estimate(load(torus, ["time.duration=100", "time.step=1e-5"]))
    (warning,) = demand.check_demand(wanted, tmp_path)
    assert "7 hours of one core" in warning and "contact loop (time.duration" in warning
