"""Output to the user: lines, progress with rate and remaining time, and the log.

Only the root process prints; on other processes the same functions have no effect, so callers need
no rank tests. Nothing here is collective.
"""

import logging
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TextIO

PATIENCE = 2.0
"""Seconds before a progress display appears; shorter operations are not worth showing."""
PLAIN_EVERY = 10.0
"""Seconds between progress lines if the output is not a terminal."""


class _State:
    """Output state of this process."""

    root: bool = True
    log: TextIO | None = None
    only_log: bool = False
    bar: "ProgressBar | None" = None


def set_root(root: bool) -> None:
    """Set whether this process prints; called once at the start."""
    _State.root = root


@contextmanager
def log_to(path: Path) -> Iterator[None]:
    """Within the context, all output is also appended to `path`, on the root process."""
    if not _State.root:
        yield
        return
    with _own_file(path) as _State.log:
        print(time.strftime("--- %Y-%m-%d %H:%M:%S %z"), file=_State.log)
        try:
            yield
        finally:
            _State.log = None


def _own_file(path: Path) -> TextIO:
    """The log file, opened for appending; a symbolic link in its place is not followed."""
    if path.is_symlink():
        path.unlink()
    flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW
    return open(os.open(path, flags, 0o666), "a", encoding="utf-8", errors="replace")


@contextmanager
def quiet() -> Iterator[None]:
    """Within the context, nothing is shown."""
    root, _State.root = _State.root, False
    try:
        yield
    finally:
        _State.root = root


@contextmanager
def only_log() -> Iterator[None]:
    """Within the context, lines and warnings go to the log alone; progress is still shown."""
    before, _State.only_log = _State.only_log, True
    try:
        yield
    finally:
        _State.only_log = before


def log(text: str) -> None:
    """Write a line to the log only, e.g. the settings of a solver."""
    if _State.root and _State.log is not None:
        print(text, file=_State.log, flush=True)


def _show(text: str, stream: TextIO) -> None:
    log(text)
    if _State.only_log:
        return
    if _State.bar is not None:
        _State.bar.hide()
    print(text, file=stream, flush=True)


def say(text: str = "") -> None:
    """Print one line for the user, and log it."""
    if _State.root:
        _show(text, sys.stdout)


def warn(text: str) -> None:
    """Print a warning to stderr, and log it."""
    if _State.root:
        _show(f"warning: {text}", sys.stderr)


class _Said(logging.Handler):
    """Past `sys.stdout`, which the form compiler replaces while it works."""

    def emit(self, record: logging.LogRecord) -> None:
        with suppress(OSError, ValueError):  # a closed stream
            if _State.root:
                _show(record.getMessage(), sys.__stdout__ or sys.stdout)


@cache
def show_log(name: str) -> None:
    """Print what is logged under a name by `say`, and nowhere else."""
    logger = logging.getLogger(name)
    logger.addHandler(_Said())
    logger.propagate = False


def is_terminal() -> bool:
    """Whether stderr is a terminal; the launcher sets TIREROAD_TERMINAL if mpirun is in between."""
    return sys.stderr.isatty() or os.environ.get("TIREROAD_TERMINAL") == "1"


def seconds(value: float) -> str:
    """A duration in words: 12 s, 3 min 05 s, 2 h 10 min."""
    whole = int(round(value))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class ProgressBar:
    """Progress of a long operation: `with Progress("contact", 4000, "steps") as bar`.

    Appears after two seconds, with rate and remaining time: on a terminal as a bar (rich), else as
    a line every ten seconds. `advance` costs about 0.1 µs to 0.2 µs until there is something to
    show. `total` None: only the count and the elapsed time are shown. `begun`: count done in an
    earlier run, included in the progress but not in the rate.
    """

    def __init__(
        self, title: str, total: int | None = None, unit: str = "steps", begun: int = 0
    ) -> None:
        self.title, self.total, self.unit = title, total, unit
        self.done = self.begun = begun
        self.text = ""
        self._rich: Any = None
        self._began = time.perf_counter()
        self._next = self._began + PATIENCE
        self._shown = False

    def __enter__(self) -> "ProgressBar":
        if _State.root and _State.bar is None:
            _State.bar = self
        return self

    def __exit__(self, *_: object) -> None:
        if _State.bar is self:
            self.hide()
            _State.bar = None

    def advance(self, steps: int = 1) -> None:
        """Add `steps` to the count."""
        self.done += steps
        if time.perf_counter() >= self._next:
            self._refresh()

    def update(self, done: int) -> None:
        """Set the count."""
        self.done = done
        if time.perf_counter() >= self._next:
            self._refresh()

    def note(self, text: str) -> None:
        """Show a live figure beside the bar, e.g. a residual."""
        self.text = text
        if time.perf_counter() >= self._next:
            self._refresh()

    def hide(self) -> None:
        """Remove the bar from the terminal; the next refresh shows it again."""
        if self._rich is not None:
            self._rich.stop()
            self._rich = None

    def line(self) -> str:
        """The progress in words: done of total, rate, remaining time."""
        spent = time.perf_counter() - self._began
        rate = (self.done - self.begun) / spent if spent > 0 else 0.0
        words = [f"{self.title}: {self.done}"]
        if self.total is not None:
            words[0] += f" of {self.total}"
        words[0] += f" {self.unit}"
        if rate > 0:
            words.append(f"{rate:.3g} {self.unit}/s")
        if self.total is not None and rate > 0:
            words.append(f"{seconds(max(self.total - self.done, 0) / rate)} left")
        else:
            words.append(f"{seconds(spent)} so far")
        return ", ".join(words + ([self.text] if self.text else []))

    def _refresh(self) -> None:
        now = time.perf_counter()
        if _State.bar is not self:
            self._next = float("inf")
            return
        if not is_terminal():
            self._next = now + PLAIN_EVERY
            print(self.line(), file=sys.stderr, flush=True)
            return
        self._next = now + 0.2
        self._draw()

    def _draw(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn
        from rich.progress import Progress as Bar

        if self._rich is None:
            console = Console(file=sys.stderr, force_terminal=True)
            columns = (BarColumn(bar_width=24), TextColumn("{task.description}"))
            self._rich = Bar(
                *columns,
                console=console,
                transient=True,
                auto_refresh=False,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._rich.start()
            self._rich.add_task(self.line(), total=self.total)
        task = self._rich.task_ids[0]
        self._rich.update(task, completed=self.done, description=self.line(), refresh=True)
