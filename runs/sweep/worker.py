"""A process that computes members of a sweep one after the other: Python and its libraries are loaded once.

It is told of a member by a line of its standard input, {"run": arguments, "log": file, "status": file}, writes what
the run says to the log, and its exit status to the other file when it has ended. Standard input ends it. Under
mpirun the root process hears and writes; a run is collective.
"""

from __future__ import annotations

import gc
import json
import os
import sys

from tireroad.runs.process import signals
from tireroad.runs.process.statuses import DONE, STOPPED, rank_before_mpi


def work() -> int:
    """Compute what standard input names; the worker's own exit status. Collective over all processes."""
    from mpi4py import MPI

    from tireroad.runs.cli import main
    from tireroad.runs.stages.base import kept

    kept.begin()
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
    """What is there between two members, libraries above all, the collector of garbage need not look through while the next
    one is computed, nine times and more."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def _told() -> dict | None:
    """The next member, of the root process; None where there is no more, and elsewhere."""
    if rank_before_mpi() != 0:
        return None
    line = sys.stdin.readline()
    return json.loads(line) if line else None


def _say_to(log: str) -> None:
    """What this process and its libraries print goes to the end of a file; the root process's alone."""
    if rank_before_mpi() != 0:
        return
    sys.stdout.flush()
    target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    for descriptor in (1, 2):
        os.dup2(target, descriptor)
    os.close(target)


def _write(path: str, status: int) -> None:
    """The status, whole or not at all."""
    sys.stdout.flush()
    with open(f"{path}.part", "w", encoding="ascii") as file:
        file.write(str(status))
    os.replace(f"{path}.part", path)
