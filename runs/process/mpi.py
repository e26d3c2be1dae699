"""Ends a run on several processes consistently: one message and one exit status."""

import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from tireroad.fem import parallel
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.parallel import FailedOnRoot
from tireroad.runs.files.disk import Refused, Removed, explained
from tireroad.runs.process.packages import missing
from tireroad.runs.process.signals import (
    BUG,
    DONE,
    GAVE_UP,
    INPUT,
    STOP_SIGNALS,
    STOPPED,
    Stopped,
    raised,
)

T = TypeVar("T")

TOGETHER = 3.0
"""Seconds that a failing process waits for the others to fail as well before it ends them all."""

_ENDED = 7  # tag of the root's notice

KEPT = "completed stages are kept; run the same command or `resume` to continue"


def start_petsc(options: list[str]) -> None:
    """Initialise PETSc with the user's options; must be the first use of PETSc.

    PETSc's own signal handlers are disabled: they would end this process without notifying the
    others. Collective over all processes.
    """
    import petsc4py

    petsc4py.init(["tireroad", "-no_signal_handler", *options])


def on_root(comm: Any, function: Callable[[], T]) -> T:
    """Like fem.parallel.on_root; a removed result folder is raised on all processes. Collective."""
    return parallel.on_root(comm, function, (InputError, ConvergenceError, Removed))


def on_root_beside(
    comm: Any, function: Callable[[], T], meanwhile: Callable[[Callable[[], bool]], None]
) -> T:
    """Like on_root, while every other process calls `meanwhile(ended)`, by itself.

    `ended()` tells whether the root has finished: what was not begun by then can be left to all. Collective.
    """
    notices: list[Any] = []

    def announced() -> T:
        try:
            return function()
        finally:
            notices.extend(comm.isend(None, rank, _ENDED) for rank in range(1, comm.size))

    if comm.rank:
        meanwhile(lambda: comm.iprobe(source=0, tag=_ENDED))
    try:
        return on_root(comm, announced)
    finally:
        if comm.rank:
            comm.recv(source=0, tag=_ENDED)
        for notice in notices:
            notice.wait()


@dataclass
class Ending:
    """How a piece of work ended: its exit status, and the message for the user."""

    status: int = DONE
    message: str = ""


@contextmanager
def ending(kept: str = KEPT) -> Iterator[Ending]:
    """Turn what the block raises into an exit status and a message.

    `kept`: what the user is told after a stop that does not say so itself. What fails because of a
    stop that came meanwhile is that stop.
    """
    end = Ending()
    status, message = DONE, ""
    try:
        yield end
    except (ConvergenceError, Removed, Refused) as error:
        status, message = GAVE_UP, f"error: {error}"
    except InputError as error:
        status, message = INPUT, f"error: {error}"
    except Stopped as stop:
        status, message = STOPPED, f"stopped by {stop}: {stop.kept or kept}"
    except MemoryError as error:
        message = f"error: out of memory ({error}): use a coarser mesh, fewer modes or points"
        status = GAVE_UP
    except FailedOnRoot:
        status = BUG
    except ModuleNotFoundError as error:
        message = missing(error)
        status, message = (INPUT, message) if message else (BUG, traceback.format_exc())
    except Exception as error:
        clear = explained(error, getattr(error, "filename", None) or "the result folder")
        status, message = (GAVE_UP, f"error: {clear}") if clear else (BUG, traceback.format_exc())
    if status == BUG and raised():
        status, message = STOPPED, f"stopped by {raised()}: {kept}"
    end.status, end.message = status, message


@contextmanager
def common_ending(comm: Any) -> Iterator[Ending]:
    """As `ending`, for a block that every process of `comm` runs: the same status on all of them.

    If all processes end, in whatever way, each distinct message is shown once and the worst status
    counts. If one fails and the others do not follow within three seconds, they are stuck in a
    collective call: the failing process prints its message and aborts them all. Collective: called
    at the same place on every process.
    """
    agreement = comm.Dup()
    with ending() as end:
        yield end
    status, message = end.status, end.message
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    higher = range(comm.rank + 1, comm.size) if status else ()
    notices = [agreement.isend(None, rank) for rank in higher]
    if not all_here(agreement, TOGETHER if status else None):
        if agreement.iprobe():  # a lower rank failed too: it prints its message and aborts all
            time.sleep(TOGETHER)
        else:
            print(message, file=sys.stderr, flush=True)
        agreement.Abort(status)
    endings = agreement.allgather((status, message))
    for rank in range(comm.rank):
        if endings[rank][0]:
            agreement.recv(source=rank)
    for notice in notices:
        notice.wait()
    if comm.rank == 0:
        for one in dict.fromkeys(text for _, text in endings if text):
            print(one, file=sys.stderr, flush=True)
    if comm.size > 1:
        # mpirun sends SIGTERM to the others once the first has exited; if ignored, it costs two
        # seconds
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_DFL)
    failed = [code for code, _ in endings if code != DONE]
    end.status = BUG if BUG in failed else max(failed, default=DONE)


def all_here(comm: Any, patience: float | None) -> bool:
    """Whether all processes arrive within `patience` seconds (None: wait forever)."""
    if comm.size == 1:
        return True
    request = comm.Ibarrier()
    began = time.monotonic()
    pause = 1e-4
    while not request.Test():
        if patience is not None and time.monotonic() - began > patience:
            return False
        time.sleep(pause)
        pause = min(2 * pause, 0.02)
    return True
