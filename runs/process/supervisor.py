"""The supervisor process of a run ensures that the computing process ends properly.

Python handles a signal only between two of its own instructions, so a process inside a library's
eigensolver or factorisation does not react for minutes, and one that is killed cannot report it.
The supervisor holds no data: it forwards signals, kills a worker that does not react in time,
reports why a worker died, and returns the exit status.
"""

import ctypes
import io
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path

from tireroad.runs.process import signals
from tireroad.runs.process.signals import (
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

_AGAIN = "completed stages are kept; run the same command or `resume` to continue"
_PR_SET_PDEATHSIG = 1


class _Sink(io.RawIOBase):
    """A file descriptor for output. Once it fails, output is dropped and `error` holds the reason.

    A run of hours must not end because the terminal or the reader of a pipe is gone.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.error: OSError | None = None

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._descriptor

    def isatty(self) -> bool:
        return os.isatty(self._descriptor)

    def write(self, data) -> int:
        view = memoryview(data).cast("B")
        written = 0
        while self.error is None and written < len(view):
            try:
                written += os.write(self._descriptor, view[written:])
            except OSError as error:
                self.error = error
                _point_nowhere(self._descriptor)  # libraries write there too
        return len(view)


def _point_nowhere(descriptor: int) -> None:
    nowhere = os.open(os.devnull, os.O_RDWR)
    if nowhere != descriptor:
        os.dup2(nowhere, descriptor)
        os.close(nowhere)


def mend() -> None:
    """Replace the standard streams by ones that never raise; called first in the process.

    A closed one is opened on the null device: otherwise the first file opened, a result file, would
    get its number, and the output of libraries would end up in it.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            _point_nowhere(descriptor)
    sys.stdout, sys.stderr = _stream(1), _stream(2)


def _stream(descriptor: int) -> io.TextIOWrapper:
    old = sys.stdout if descriptor == 1 else sys.stderr
    encoding = getattr(old, "encoding", None) or "utf-8"
    sink = _Sink(descriptor)
    return io.TextIOWrapper(
        io.BufferedWriter(sink),
        encoding=encoding,
        errors="replace",
        line_buffering=descriptor == 2 or sink.isatty(),
        write_through=descriptor == 2,
    )


def refused() -> OSError | None:
    """Why standard output could not be written; None also if its reader closed the pipe."""
    sys.stdout.flush()
    sink = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    error = sink.error if isinstance(sink, _Sink) else None
    return None if isinstance(error, BrokenPipeError) else error


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
    parts = []
    with suppress(OSError):
        for entry in os.scandir(f"/proc/{worker}/fd"):
            with suppress(OSError):
                target = Path(os.readlink(entry.path))
                if target.name.startswith(".") and target.name.endswith(f".{worker}.part"):
                    parts.append(target)
    return parts


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
