"""Stop signals of this process, and exit statuses as they reach the shell through mpirun."""

import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from importlib.machinery import ExtensionFileLoader
from types import FrameType
from typing import Any

DONE, BUG, INPUT, GAVE_UP, STOPPED = 0, 1, 2, 3, 4

# Variables of what starts a process with MPI: Open MPI's mpirun, and PMI or PMIx of any launcher.
_OF_MPI = "OMPI_COMM_WORLD_SIZE", "PMIX_NAMESPACE", "PMIX_RANK", "PMI_RANK", "PMI_FD", "PMI_PORT"
_UNDER_NOHUP = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1) + (
    () if _UNDER_NOHUP else (signal.SIGHUP,)
)
"""mpirun forwards SIGUSR1 to every process; the launcher uses it. Under nohup SIGHUP is ignored."""

TOGETHER = 1.0
"""Seconds within which signals count as one request: a terminal, a batch system or `timeout` may
send one to a process, its group and its parent, which forwards it."""

DEFERRED = b"d"
"""Message to the supervisor: the loop has noted the request and will end by itself."""


def _number(default: int, *names: str) -> int:
    """The first of the environment's variables that is a number, else `default`."""
    for name in names:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return default


def rank_before_mpi() -> int:
    """The rank according to the process manager, for commands that never start MPI."""
    return _number(0, "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")


def without_mpi(variables: Mapping[str, str]) -> int:
    """Number of tasks that Slurm has started this process among, if none of them is told of MPI; 0 elsewhere.

    A shell of salloc or of `srun --pty`, a batch script and a Jupyter kernel in a job are one such task. Open MPI takes
    SLURM_NODELIST for a start by srun with MPI, and gives up where it was built without PMI.
    """
    if "SLURM_NODELIST" not in variables or any(name in variables for name in _OF_MPI):
        return 0
    tasks = variables.get("SLURM_STEP_NUM_TASKS", "1")
    return int(tasks) if tasks.isdigit() else 1


def processes_here() -> int:
    """Number of processes according to the process manager if all are on this machine, else 1."""
    here = _number(1, "OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS")
    whole = _number(1, "OMPI_COMM_WORLD_SIZE", "PMI_SIZE")
    return whole if here == whole else 1


def in_parallel() -> bool:
    """Whether the process manager has started more than one process."""
    unknown = 2 if "PMIX_RANK" in os.environ else 1
    return _number(unknown, "OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS") > 1


def handed_over(status: int, for_all: bool = True) -> int:
    """Write the status to the launcher's file (TIREROAD_STATUS) and return 0 for mpirun.

    The root process writes a status common to all; with `for_all` False, each process writes its
    own. The first entry is kept. Without a launcher on this machine, returns the status itself. Not
    collective.
    """
    file = os.environ.get("TIREROAD_STATUS", "")
    if not os.path.exists(file):
        return status
    if (rank_before_mpi() == 0 or not for_all) and not os.path.getsize(file):
        with open(file, "w", encoding="ascii") as stream:
            stream.write(str(status))
    return DONE


class Stopped(BaseException):
    """The user or the batch system requested a stop: exit status 4.

    Not an Exception, so that no solver callback mistakes it for its own failure. `kept`: what the
    user is told of the work so far, if not the usual.
    """

    kept = ""


class Deferred:
    """While entered, the first stop signal is only noted: `asked` is its name, or "".

    A resumable loop checks it after each step, stops where its state is consistent, and raises
    `Stopped` itself. A second request stops at once.
    """

    _current: "Deferred | None" = None

    def __init__(self) -> None:
        self.asked = ""

    def __enter__(self) -> "Deferred":
        Deferred._current = self
        return self

    def __exit__(self, *_: object) -> None:
        Deferred._current = None


class _Heard:
    """The last request to this process, and the supervisor to notify."""

    raised = ""

    at: float = -1e9
    supervisor: int | None = None


def tell_when_deferred(descriptor: int) -> None:
    """Descriptor for messages: DEFERRED for a stop signal noted, b"!" for one raised."""
    _Heard.supervisor = descriptor


def stop_on_signals() -> None:
    """Turn stop signals into `Stopped`, or into a note while deferred."""
    for number in STOP_SIGNALS:
        signal.signal(number, _stop)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    sys.unraisablehook = _not_lost


def raised() -> str:
    """The name of the signal for which `Stopped` was raised, or "".

    Needed because an exception raised while a library is imported may appear as that library's own
    error.
    """
    return _Heard.raised


def _stop(number: int, frame: FrameType | None) -> None:
    if _in_compiled_import(frame):
        _repeat(number)
        return
    now, before = time.monotonic(), _Heard.at
    if now - before < TOGETHER:
        return
    _Heard.at = now
    name, current = signal.Signals(number).name, Deferred._current
    defers = current is not None and not current.asked
    if _Heard.supervisor is not None:
        with suppress(OSError):  # the supervisor itself may have ended
            os.write(_Heard.supervisor, DEFERRED if defers else b"!")
    if not defers:
        _Heard.raised = name
        raise Stopped(name)
    current.asked = name


def _in_compiled_import(frame: FrameType | None) -> bool:
    """Whether the compiled part of a library is being loaded: an exception from Python code that
    it calls meanwhile would pass through C++ and abort the process (nanobind)."""
    while frame is not None:
        if isinstance(frame.f_locals.get("self"), ExtensionFileLoader):
            return True
        frame = frame.f_back
    return False


def _repeat(number: int) -> None:
    """Send the signal to this process again in a moment."""
    again = threading.Timer(0.1, os.kill, (os.getpid(), number))
    again.daemon = True
    again.start()


def _not_lost(unraisable: Any) -> None:
    """Repeat a request that arrived where nothing can be raised (in a finaliser).

    After a request, the finalisers of objects that it left half made fail: that is no news to the user.
    """
    if isinstance(unraisable.exc_value, Stopped):
        _Heard.at = -1e9
        _repeat(signal.Signals[str(unraisable.exc_value)])
    elif not _Heard.raised:
        sys.__unraisablehook__(unraisable)
