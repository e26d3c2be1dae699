"""What a signal to stop does to this process."""

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from typing import Any

_UNDER_NOHUP = signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1) + (
    () if _UNDER_NOHUP else (signal.SIGHUP,)
)
"""SIGUSR1 is what mpirun hands on to every process; the launcher uses it. Under nohup a hangup is none."""

TOGETHER = 1.0
"""Seconds within which signals are one request: a terminal, a batch system or `timeout` may send it to
a process, its group and its parent, who hands it on."""


class Stopped(BaseException):
    """The user or the batch system asked to stop: exit status 4.

    Not an Exception, so that no solver callback takes it for its own failure.
    """


class Deferred:
    """While one is entered, the first stop signal is only noted: `asked` is its name, or "".

    A loop that can be gone on with looks at it after each step, stops where its state is whole, and
    raises `Stopped` itself. A second request stops at once.
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
    """The last request of this process, and who wants to know that it was heard."""

    raised = ""

    at: float = -1e9
    supervisor: int | None = None


DEFERRED = b"d"
"""What the supervisor hears of a request that the loop has noted, and ends of by itself."""


def tell_when_deferred(descriptor: int) -> None:
    """Write DEFERRED there when a stop signal has been noted, and b"!" when it has been raised instead."""
    _Heard.supervisor = descriptor


def stop_on_signals() -> None:
    """Turn the stop signals into `Stopped`, or into a note where they are deferred."""
    for number in STOP_SIGNALS:
        signal.signal(number, _stop)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    sys.unraisablehook = _not_lost


def raised() -> str:
    """The name of the signal for which `Stopped` was raised, "" for none. Raised while a library loads its
    compiled part, it comes out as that library's own error.
    """
    return _Heard.raised


def _stop(number: int, _frame: Any) -> None:
    now, before = time.monotonic(), _Heard.at
    if now - before < TOGETHER:
        return
    _Heard.at = now
    name, current = signal.Signals(number).name, Deferred._current
    defers = current is not None and not current.asked
    if _Heard.supervisor is not None:
        with suppress(OSError):  # the supervisor may be what has ended
            os.write(_Heard.supervisor, DEFERRED if defers else b"!")
    if not defers:
        _Heard.raised = name
        raise Stopped(name)
    current.asked = name


def _not_lost(unraisable: Any) -> None:
    """A request that met Python where nothing can be raised (a finaliser) is made again."""
    if isinstance(unraisable.exc_value, Stopped):
        _Heard.at = -1e9
        number = signal.Signals[str(unraisable.exc_value)]
        again = threading.Timer(0.1, os.kill, (os.getpid(), number))
        again.daemon = True
        again.start()
    else:
        sys.__unraisablehook__(unraisable)
