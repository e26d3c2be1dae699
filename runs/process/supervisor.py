"""The supervisor process of a run, which ensures that the computing process ends properly.

Python handles a signal only between two of its own instructions, so a process inside a library's
eigensolver or factorisation does not react for minutes, and one that is killed cannot report it.
The supervisor holds no data: it forwards signals, kills a worker that does not react in time,
reports why a worker died, and returns the exit status.
"""

import ctypes
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from tireroad.runs.process import signals
from tireroad.runs.process.statuses import (
    BUG,
    GAVE_UP,
    STOPPED,
    handed_over,
    in_parallel,
    rank_before_mpi,
)

PATIENCE = 8.0
"""Seconds from a stop request to killing the worker. A loop that has noted the request writes its
checkpoint first, however long that takes; elsewhere files are complete or absent, so nothing is
lost."""

_AGAIN = "what was finished is kept, the same command or resume goes on"
_PR_SET_PDEATHSIG = 1


def supervise() -> None:
    """Fork. Returns in the worker; this process stays as supervisor and exits with the worker."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {*signals.STOP_SIGNALS, signal.SIGCHLD})
    hears, tells = os.pipe()
    supervisor = os.getpid()
    worker = os.fork()
    if worker == 0:
        os.close(hears)
        signals.tell_when_deferred(tells)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGCHLD})
        _end_with(supervisor)
        return
    os.close(tells)
    status = _watch(worker, hears)
    with suppress(OSError):
        sys.stdout.flush()
    os._exit(status)


def _end_with(supervisor: int) -> None:
    """Have the kernel stop this process when its supervisor is killed.

    A single process stops in order and can be resumed; one of several has lost the others and
    exits.
    """
    number = signal.SIGKILL if in_parallel() else signal.SIGTERM
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(number))
    if os.getppid() != supervisor:
        os._exit(STOPPED)


def _watch(worker: int, hears: int) -> int:
    """Forward signals until the worker has ended; returns the exit status."""
    asked, deadline = "", float("inf")
    while True:
        left = min(deadline - time.monotonic(), 3600.0)
        caught = signal.sigtimedwait({*signals.STOP_SIGNALS, signal.SIGCHLD}, max(left, 0.0))
        ended, state = os.waitpid(worker, os.WNOHANG)
        if ended:
            return _verdict(worker, state, asked)
        if caught is not None and caught.si_signo in signals.STOP_SIGNALS:
            asked = asked or signal.Signals(caught.si_signo).name
            deadline = min(deadline, time.monotonic() + PATIENCE)
            os.kill(worker, caught.si_signo)
        if time.monotonic() >= deadline:
            if _deferred(hears):
                deadline = float("inf")
            else:
                return _killed(worker, asked)


def _deferred(descriptor: int) -> bool:
    """Whether the worker's latest message says that its loop will stop by itself."""
    os.set_blocking(descriptor, False)
    try:
        return os.read(descriptor, 4096).endswith(signals.DEFERRED)
    except BlockingIOError:
        return False


def _killed(worker: int, asked: str) -> int:
    """Kill a worker that is inside a library, and remove the file it was writing."""
    parts = _parts(worker)
    os.kill(worker, signal.SIGKILL)
    os.waitpid(worker, 0)
    for part in parts:
        part.unlink(missing_ok=True)
    _end_compilers(worker)
    if rank_before_mpi() == 0:
        _say(f"stopped by {asked} in the middle of a library's work: {_AGAIN}")
    return handed_over(STOPPED, for_all=False)


def _parts(worker: int) -> list[Path]:
    """Temporary result files that the worker has open."""
    found = []
    with suppress(OSError):
        for entry in os.scandir(f"/proc/{worker}/fd"):
            with suppress(OSError):
                target = Path(os.readlink(entry.path))
                if target.name.startswith(".") and target.name.endswith(f".{worker}.part"):
                    found.append(target)
    return found


def _verdict(worker: int, state: int, asked: str) -> int:
    """The exit status of a worker that has ended; prints the reason if the worker could not."""
    if os.WIFEXITED(state):
        return os.WEXITSTATUS(state)
    _end_compilers(worker)
    number = signal.Signals(os.WTERMSIG(state))
    if number in signals.STOP_SIGNALS:
        if not in_parallel():
            _say(f"stopped by {asked or number.name}: {_AGAIN}")
        return handed_over(STOPPED, for_all=False)
    if number == signal.SIGKILL:
        _say(
            "error: the program was killed (SIGKILL), most likely because the machine ran out of"
            f" memory: {_AGAIN}; use a coarser mesh, fewer modes or points, or fewer processes"
        )
        return handed_over(GAVE_UP, for_all=False)
    _say(f"error: a library crashed ({number.name}): this is a bug; {_AGAIN}")
    return handed_over(BUG, for_all=False)


def _end_compilers(worker: int) -> None:
    from tireroad.fem import form_cache

    form_cache.end_compilers(form_cache.folder_prefix(worker))


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
