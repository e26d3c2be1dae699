"""The test command: counts over all processes, one line at the end, failure anywhere is failure."""

from pathlib import Path

import pytest

from tireroad.tests.run_tests import _chosen

SUITE = """
import pytest
from mpi4py import MPI

def test_alone():
    assert MPI.COMM_WORLD.size == 1

@pytest.mark.mpi
def test_sum():
    comm = MPI.COMM_WORLD
    assert comm.allreduce(1) == comm.size

@pytest.mark.skip(reason="to be counted")
def test_left():
    pass
"""
BROKEN = """
@pytest.mark.mpi
def test_last_fails():
    comm = MPI.COMM_WORLD
    assert comm.size == 1 or comm.rank < comm.size - 1, f"seen on process {comm.rank}"
"""


def run(launch, folder: Path, text: str, *arguments: str):
    file = folder / "test_sample.py"
    file.write_text(text)
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n    mpi\n    slow\n    long\n")
    done = launch("-m", "runs", "test", *arguments, file)
    return done, done.stdout.splitlines()[-1]


@pytest.mark.slow
def test_all_runs_are_summed(launch, tmp_path: Path) -> None:
    done, last = run(launch, tmp_path, SUITE)
    assert (done.returncode, last) == (0, "4 passed, 0 failed, 1 skipped")


@pytest.mark.slow
def test_the_fast_part_is_on_one_process_without_slow_ones(launch, tmp_path: Path) -> None:
    slow = "\n@pytest.mark.slow\ndef test_long():\n    assert False\n"
    done, last = run(launch, tmp_path, SUITE + slow, "--fast")
    assert (done.returncode, last) == (0, "1 passed, 0 failed, 1 skipped")


def test_long_ones_run_when_all_or_they_are_asked_for() -> None:
    assert _chosen(["-x"]) == (["-m", "not long", "-x"], (1, 2, 3))
    assert _chosen(["--all", "-x"]) == (["-x"], (1, 2, 3))
    assert _chosen(["tests/fem"]) == (["tests/fem"], (1, 2, 3))
    assert _chosen(["--durations", "40"])[0][:2] == ["-m", "not long"]
    assert _chosen(["-m", "long"]) == (["-m", "long"], (1, 2, 3))
    assert _chosen(["--fast"])[1] == (1,)


@pytest.mark.slow
def test_failure_on_one_process_fails(launch, tmp_path: Path) -> None:
    done, last = run(launch, tmp_path, SUITE + BROKEN)
    assert (done.returncode, last) == (1, "5 passed, 2 failed, 1 skipped")
    assert "seen on process 1" in done.stdout and "seen on process 2" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("text", ["import nothing_of_this_name\n", "# no tests\n"])
def test_suite_that_cannot_run_fails(launch, tmp_path: Path, text: str) -> None:
    done, last = run(launch, tmp_path, text)
    assert done.returncode == 1
    assert last.startswith("0 passed")


@pytest.mark.slow
def test_collection_counts_all_runs(launch, tmp_path: Path) -> None:
    done, last = run(launch, tmp_path, SUITE, "--collect-only", "-q")
    assert (done.returncode, last) == (0, "5 collected")
