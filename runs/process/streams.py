"""Standard streams that may be closed, or get closed, while the program runs."""

import io
import os
import sys


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
