"""How a run on several processes ends: all together, with one message and one exit status."""

import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.parallel import ToldByRoot, on_root
from tireroad.runs.files.disk import explained

__all__ = ["ToldByRoot", "on_root"]  # at home in fem.parallel

DONE, BUG, INPUT, GAVE_UP, STOPPED = 0, 1, 2, 3, 4
TOGETHER = 3.0
"""Seconds a failing process waits for the others to fail likewise before it ends them all."""

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""SIGUSR1 is what mpirun hands on to every process; the launcher uses it."""


class Stopped(BaseException):
    """The user (SIGINT) or the batch system (SIGTERM, SIGUSR1) asked to stop: exit status 4.

    Not an Exception, so that no solver callback takes it for its own failure.
    """


class Deferred:
    """While one is entered, the first stop signal is only noted: `asked` is its name, or "".

    A loop that can be gone on with looks at it after each step, stops where its state is whole, and
    raises `Stopped` itself. A second signal stops at once.
    """

    _current: "Deferred | None" = None

    def __init__(self) -> None:
        self.asked = ""

    def __enter__(self) -> "Deferred":
        Deferred._current = self
        return self

    def __exit__(self, *_: object) -> None:
        Deferred._current = None


def stop_on_signals() -> None:
    """Turn the stop signals into `Stopped`, or into a note where they are deferred."""

    def stop(number: int, _frame: Any) -> None:
        name, current = signal.Signals(number).name, Deferred._current
        if current is None or current.asked:
            raise Stopped(name)
        current.asked = name

    for number in STOP_SIGNALS:
        signal.signal(number, stop)


def start_petsc(options: list[str]) -> None:
    """Initialise PETSc with the user's options, before anything else does.

    PETSc's own signal handlers would end the process without a word to the others.
    Collective over all processes.
    """
    import petsc4py

    petsc4py.init(["tireroad", "-no_signal_handler", *options])


def rank_before_mpi() -> int:
    """The rank as the process manager tells it, for commands that never start MPI."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 0


def handed_over(status: int) -> int:
    """Leave the status where the launcher asked for it (TIREROAD_STATUS), and 0 to mpirun.

    Without a launcher on this machine, the status itself. Not collective.
    """
    file = os.environ.get("TIREROAD_STATUS", "")
    if not os.path.exists(file):
        return status
    if rank_before_mpi() == 0:
        with open(file, "w", encoding="ascii") as stream:
            stream.write(str(status))
    return DONE


def judged(function: Callable[[], None]) -> tuple[int, str]:
    """Run `function`; the exit status it earns and the message for the user."""
    try:
        function()
    except InputError as error:
        return INPUT, f"error: {error}"
    except ConvergenceError as error:
        return GAVE_UP, f"error: {error}"
    except Stopped as stop:
        return (
            STOPPED,
            f"stopped by {stop}: what was finished is kept, the same command or resume goes on",
        )
    except MemoryError as error:
        return GAVE_UP, f"error: out of memory ({error}): use a coarser mesh, fewer modes or points"
    except ToldByRoot:
        return BUG, ""
    except Exception as error:
        clear = explained(error, getattr(error, "filename", None) or "the result folder")
        return (INPUT, f"error: {clear}") if clear else (BUG, traceback.format_exc())
    return DONE, ""


def guarded(comm: Any, function: Callable[[], None]) -> int:
    """Run `function` on every process of `comm`; the exit status, the same on all of them.

    Where all processes end, in whatever way, each message is shown once and the worst status is
    returned. Where one fails and the others do not come along within three seconds, they are inside
    a call that will never end: the failing one says why and ends them all.
    Collective: called at the same place on every process.
    """
    agreement = comm.Dup()
    status, message = judged(function)
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    higher = range(comm.rank + 1, comm.size) if status else ()
    notices = [agreement.isend(None, rank) for rank in higher]
    if not all_here(agreement, TOGETHER if status else None):
        if agreement.iprobe():  # a lower rank failed too: it speaks and ends us
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
        # mpirun ends the others by SIGTERM when the first has exited; ignored, it costs two seconds
        for number in STOP_SIGNALS:
            signal.signal(number, signal.SIG_DFL)
    failed = [code for code, _ in endings if code != DONE]
    return BUG if BUG in failed else max(failed, default=DONE)


def all_here(comm: Any, patience: float | None) -> bool:
    """Whether all processes came here within `patience` seconds (None: wait for ever)."""
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
