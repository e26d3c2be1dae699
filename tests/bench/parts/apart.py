"""Runs a task in a separate process, which releases its memory and isolates its failures."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.process import console, mpi, signals
from tireroad.runs.process.signals import BUG, DONE


def apart(task: Callable[..., Any], *given: Any) -> Any:
    """task(*given) in another process; its result is pickled. On one process.

    Raises ConvergenceError with the reason if it fails in any way.
    """
    with tempfile.TemporaryDirectory() as folder:
        asked, answer = Path(folder) / "asked", Path(folder) / "answer"
        asked.write_bytes(pickle.dumps((task, given)))
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__, str(asked), str(answer)],
            env=dict(os.environ),  # without MPI's settings of this process
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        if done.returncode == DONE:
            return pickle.loads(answer.read_bytes())
    if done.returncode == BUG:
        console.say(done.stderr.rstrip())
    raise ConvergenceError(_reason(done.returncode, done.stderr))


def _reason(status: int, said: str) -> str:
    """Why a process ended with a status other than 0."""
    if status < 0:
        name = signal.Signals(-status).name
        return f"ended by {name}" + (", as for want of memory" if name == "SIGKILL" else "")
    last = said.strip().splitlines()[-1:]
    return f"exit status {status}: {''.join(last).removeprefix('error: ')}"


def _answered(asked: Path, answer: Path) -> None:
    """Do the task, in the other process."""
    mpi.start_petsc([])
    task, given = pickle.loads(asked.read_bytes())
    answer.write_bytes(pickle.dumps(task(*given)))


if __name__ == "__main__":
    signals.stop_on_signals()
    with mpi.ending() as end:
        _answered(*map(Path, sys.argv[1:]))
    if end.message:
        print(end.message, file=sys.stderr)
    sys.exit(end.status)
