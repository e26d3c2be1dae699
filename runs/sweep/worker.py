"""A worker that computes members of a sweep one after the other, loading the libraries once.

A line on standard input describes a member: {"run": arguments, "log": file, "status": file}. The
run's output goes to the log, its exit status to the other file when it has ended. The worker ends
with its standard input. Under mpirun the root process reads and writes; a run is collective.
"""

from __future__ import annotations

import gc
import json
import os
import sys

from tireroad.runs.process import signals
from tireroad.runs.process.signals import DONE, STOPPED, rank_before_mpi


def work() -> int:
    """Compute the members from standard input; returns the exit status. Collective."""
    from mpi4py import MPI

    from tireroad.runs.cli import main
    from tireroad.runs.stages.matrices import keep_matrices

    keep_matrices()
    status = DONE
    while status != STOPPED and (told := MPI.COMM_WORLD.bcast(_told())) is not None:
        signals.stop_on_signals()
        _set_aside()
        _say_to(told["log"])
        status = main(told["run"])
        if MPI.COMM_WORLD.rank == 0:
            _write(told["status"], status)
    return STOPPED if status == STOPPED else DONE


def _set_aside() -> None:
    """Exempt the objects that persist between members, mainly libraries, from garbage collection.

    Otherwise the collector would scan them during the next member, nine times and more.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def _told() -> dict | None:
    """The next member, on the root process; None if there is none, and on other processes."""
    if rank_before_mpi() != 0:
        return None
    line = sys.stdin.readline()
    return json.loads(line) if line else None


def _say_to(log: str) -> None:
    """Append the output of this process and its libraries to a file; on the root process only."""
    if rank_before_mpi() != 0:
        return
    sys.stdout.flush()
    target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    for descriptor in (1, 2):
        os.dup2(target, descriptor)
    os.close(target)


def _write(path: str, status: int) -> None:
    """Write the status atomically."""
    sys.stdout.flush()
    with open(f"{path}.part", "w", encoding="ascii") as file:
        file.write(str(status))
    os.replace(f"{path}.part", path)
