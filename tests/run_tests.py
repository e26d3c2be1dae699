"""`tireroad test`: the suite on one process, then its tests marked `mpi` on 2 and on 3.

Tests marked `long` run with `--all`, or if named; with `--fast` only tests on one process that are
not marked `slow` run, a few seconds each at most. A test under mpirun fails if it fails on any
process. If it fails on one while the others wait in a collective call, all are ended together. Run
as a module, this file is the worker: `python3 -m tireroad.tests.run_tests FOLDER PROCESSES
[pytest arguments]`.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PARALLEL = (2, 3)
LONGEST = 4 * 3600.0
"""Seconds after which a whole run under mpirun counts as hung."""
PATIENCE = 120.0
"""Seconds that processes wait for each other after a test that failed on one of them."""


class Recorder:
    """Stores the number of collected tests and their outcomes in a file for the parent process."""

    def __init__(self, file: Path, comm: Any) -> None:
        self.file, self.comm = file, comm
        self.collected = 0
        self.outcomes: dict[str, str] = {}
        self.failures: list[str] = []

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list) -> None:
        if self.comm is not None:
            others = [item for item in items if item.get_closest_marker("mpi") is None]
            items[:] = [item for item in items if item.get_closest_marker("mpi") is not None]
            config.hook.pytest_deselected(items=others)
        self.collected = len(items)
        self.save()

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.outcomes[report.nodeid] = "failed"

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.outcomes[report.nodeid] = "failed"
            self.failures.append(report.longreprtext)
        elif report.when == "call" or report.skipped:
            self.outcomes.setdefault(report.nodeid, report.outcome)

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        """Under mpirun: continue only when all processes have finished the test."""
        if self.comm is None:
            return
        from tireroad.runs.process.mpi import all_here

        failed = self.outcomes.get(nodeid) == "failed"
        if not all_here(self.comm, PATIENCE if failed else None):
            print(f"{nodeid} failed on process {self.comm.rank}:", file=sys.stderr)
            print("\n".join(self.failures), file=sys.stderr, flush=True)
            self.save()
            self.comm.Abort(1)

    def pytest_sessionfinish(self) -> None:
        self.save()

    def save(self) -> None:
        text = json.dumps({"collected": self.collected, "outcomes": self.outcomes})
        self.file.write_text(text, encoding="utf-8")


def worker(folder: Path, processes: int, arguments: list[str]) -> int:
    """One process of a run: pytest with a recorder. All but the root print to files."""
    comm, rank = None, 0
    if processes > 1:
        from mpi4py import MPI

        comm = MPI.COMM_WORLD.Dup()
        rank = comm.rank
        if rank:
            target = os.open(folder / f"{processes}-{rank}.txt", os.O_WRONLY | os.O_CREAT)
            os.dup2(target, sys.stdout.fileno())
    recorder = Recorder(folder / f"{processes}-{rank}.json", comm)
    if processes == 1:
        arguments = [*_at_once(arguments), *arguments]
    return int(pytest.main(arguments, plugins=[recorder]))


def _at_once(arguments: list[str]) -> list[str]:
    """Options for running test files in parallel, if pytest-xdist is installed and it pays off."""
    alone = {"--collect-only", "--co", "--pdb", "-s", "-n", "-x"} & set(arguments)
    cores = min(os.cpu_count() or 1, 8)
    if alone or cores == 1 or importlib.util.find_spec("xdist") is None:
        return []
    return ["-n", str(cores), "--dist", "loadscope"]


def _command(processes: int) -> list[str]:
    here = [sys.executable, "-P", "-m", "tireroad.tests.run_tests"]
    if processes == 1:
        return here
    return ["mpirun", "-n", str(processes), *here]


def _run(folder: Path, processes: int, arguments: list[str]) -> tuple[int, dict[str, str], int]:
    """Status, outcome of each test (failed if failed on any process), number of tests collected."""
    command = [*_command(processes), str(folder), str(processes), *arguments]
    path = os.pathsep.join(part for part in (str(ROOT), os.environ.get("PYTHONPATH")) if part)
    environment = {**os.environ, "PYTHONPATH": path}
    try:
        limit = LONGEST if processes > 1 else None
        status = subprocess.run(command, cwd=ROOT, env=environment, timeout=limit).returncode
    except subprocess.TimeoutExpired:
        print(f"stuck on {processes} processes for {LONGEST:g} s", file=sys.stderr)
        status = 1
    merged: dict[str, str] = {}
    collected = 0
    order = ("skipped", "passed", "failed")
    for rank in range(processes):
        file = folder / f"{processes}-{rank}.json"
        if not file.exists():
            merged[f"process {rank} of {processes} never began"] = "failed"
            continue
        record = json.loads(file.read_text(encoding="utf-8"))
        collected = max(collected, record["collected"])
        for test, outcome in record["outcomes"].items():
            merged[test] = max(merged.get(test, "skipped"), outcome, key=order.index)
    _show_others(folder, processes, merged)
    if status not in (0, 5) and "failed" not in merged.values():
        merged[f"the run on {processes} processes ended with status {status}"] = "failed"
    return status, merged, collected


def _show_others(folder: Path, processes: int, merged: dict[str, str]) -> None:
    """Print the output of the other processes if something failed."""
    if "failed" not in merged.values():
        return
    for rank in range(1, processes):
        file = folder / f"{processes}-{rank}.txt"
        if file.exists():
            print(f"--- process {rank} of {processes}")
            print(file.read_text(encoding="utf-8", errors="replace"))


def _from_root(argument: str) -> str:
    """A path argument relative to the repository root, where pytest runs."""
    path, colons, test = argument.partition("::")
    if argument.startswith("-") or not path or not Path(path).exists():
        return argument
    return f"{Path(path).resolve()}{colons}{test}"


def _chosen(arguments: list[str]) -> tuple[list[str], tuple[int, ...]]:
    """pytest's arguments with the marks for --fast, --all or neither, and the process counts."""
    rest = [one for one in arguments if one not in ("--fast", "--all")]
    if "--fast" in arguments:
        return ["-m", "not slow and not long and not mpi", *rest], (1,)
    named = "-m" in rest or any(Path(one.partition("::")[0]).exists() for one in rest)
    return rest if named or "--all" in arguments else ["-m", "not long", *rest], (1, *PARALLEL)


def run_tests(arguments: list[str]) -> int:
    """Run the whole suite and print `N passed, N failed, N skipped` over all runs.

    Exit status 0 or 1; 2 for a usage error.
    """
    arguments, counts = _chosen(arguments)
    arguments = [_from_root(argument) for argument in arguments]
    if not sys.stdout.isatty():  # mpirun gives its processes a terminal of their own
        arguments.insert(0, "--color=no")
    totals = dict.fromkeys(("passed", "failed", "skipped"), 0)
    collected = 0
    with tempfile.TemporaryDirectory() as name:
        for processes in counts:
            print(f"--- on {processes} process{'es' if processes > 1 else ''}", flush=True)
            status, outcomes, found = _run(Path(name), processes, arguments)
            if status == int(pytest.ExitCode.USAGE_ERROR):
                return 2
            collected += found
            for outcome in outcomes.values():
                totals[outcome] += 1
            for test, outcome in outcomes.items():
                if outcome == "failed":
                    print(f"failed on {processes}: {test}")
            if not outcomes and not found or status == int(pytest.ExitCode.INTERRUPTED):
                break  # nothing to run, or collection failed: more processes would not change that
    if "--collect-only" in arguments or "--co" in arguments:
        print(f"{collected} collected")
        return 0 if collected and not totals["failed"] else 1
    if "not long" in arguments:
        print("without the long ones, which --all runs too")
    print(", ".join(f"{number} {outcome}" for outcome, number in totals.items()))
    ran = sum(int(number) for number in totals.values())
    return 0 if totals["failed"] == 0 and ran else 1


if __name__ == "__main__":
    sys.exit(worker(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]))
