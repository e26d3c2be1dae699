"""Failures of stages: entered in the summary, and remembered for the other members of a sweep.

Members of a sweep that share a stage do not repeat its failure: the environment variable
TIREROAD_FAILURES names a folder with a file for each stage that has failed, by its name and the hash
of its inputs. A sweep on this machine gives its workers an empty one. Without it nothing is
remembered: a run by itself may be tried again.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import Summary
from tireroad.runs.process.signals import Stopped

FAILURES = "TIREROAD_FAILURES"


@contextmanager
def failure_recorded(stage: str, summary: Summary, comm: MPI.Comm) -> Iterator[None]:
    """Within the context, an error or a stop is entered in the summary by the root process."""
    try:
        yield
    except BaseException as error:
        if comm.rank == 0:
            stopped = isinstance(error, Stopped)
            told = f"stopped by {error}: resume continues" if stopped else str(error) or repr(error)
            with suppress(Exception):  # of the first error, whatever else goes wrong
                summary.end(stage, told)
        raise


@contextmanager
def remembered(stage: str, key: str, run: str, comm: MPI.Comm) -> Iterator[None]:
    """A failure of the `stage` of a `run` within the context is remembered for the other members of a sweep."""
    try:
        yield
    except ConvergenceError as error:
        if comm.rank == 0:  # not on_root: other processes need not have failed
            record_failure(stage, key, run, error)
        raise


def record_failure(stage: str, key: str, run: str, error: ConvergenceError) -> None:
    """Keep why the stage of a `run` failed, if failures are kept. Root process only."""
    if (file := _file(stage, key)) and not file.exists():
        with suppress(OSError):
            write_text(file, f"{error} (as in {run}, which failed first and has the same inputs)")


def check_failures(stage: str, key: str) -> None:
    """Raise ConvergenceError if the stage has failed on these inputs. Root process only."""
    file = _file(stage, key)
    if file and file.exists():
        raise ConvergenceError(file.read_text(encoding="utf-8"))


def _file(stage: str, key: str) -> Path | None:
    folder = os.environ.get(FAILURES)
    return Path(folder) / f"{stage}-{key}.txt" if folder else None
