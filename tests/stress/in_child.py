"""The program in a forked copy of this process, which has all of it imported: no start-up for each case."""

import os
import re
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

BEGUN = 0.35e9  # bytes of a process with everything imported, which estimates leave out in part
MAY_EXCEED = 1.5  # a run's memory over its estimate


def warm() -> None:
    """Import what a run imports, and start MPI and PETSc. One thread: others would not survive a fork.

    Without the user's cache, whose stages other kernels of BLAS may have computed, to other last bits.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["TIREROAD_CACHE"] = "off"
    from threadpoolctl import threadpool_limits

    from tireroad.runs.process import mpi

    threadpool_limits(1)  # whatever this process began with
    mpi.start_petsc([])
    import tireroad.runs.cli
    import tireroad.runs.stages.contact  # noqa: F401


def forked(function: Callable[[], int], output: Path, limit: float) -> tuple[int | None, str, int]:
    """Run `function` in a child: (exit status, what it printed, its peak memory in bytes as if this process had BEGUN).

    None for one that had to be stopped after `limit` s; minus the signal for one that crashed.
    """
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    had = pages * os.sysconf("SC_PAGESIZE")
    child = os.fork()
    if child == 0:
        target = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for descriptor in (1, 2):
            os.dup2(target, descriptor)
        # Under pytest the streams are its own files, not the descriptors.
        sys.stdout, sys.stderr = (os.fdopen(one, "w", closefd=False) for one in (1, 2))
        status = 1
        try:
            status = function()
        except SystemExit as end:
            status = int(end.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    status, usage = _ended(child, limit)
    return status, output.read_text(errors="replace"), usage - max(had - int(BEGUN), 0)


def _ended(child: int, limit: float) -> tuple[int | None, int]:
    deadline, stopped = time.monotonic() + limit, False
    while True:
        ended, state, usage = os.wait4(child, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(state)
            return (None if stopped else code), usage.ru_maxrss * 1024
        if time.monotonic() > deadline:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL if stopped else signal.SIGTERM)
            stopped, deadline = True, time.monotonic() + 30.0
        time.sleep(0.01)


def judged(status: int | None, said: str, memory: int, out: Path) -> str:
    """What is wrong with how a run of the program ended, "" for nothing."""
    if status is None:
        return ""
    if status not in (0, 2, 3, 4) or "Traceback" in said:
        return f"crash {status}: {said[-2000:]}"
    if status in (2, 3) and "error: " not in said:
        return f"status {status} without a message: {said[-500:]}"
    told = re.search(r"estimated: ([0-9.]+) GB a process", said)
    if told and memory > MAY_EXCEED * float(told[1]) * 1e9 + BEGUN:
        return f"{memory / 1e9:.2f} GB taken: {told[0]}"
    return "" if status else _not_finite(out)


def _not_finite(out: Path) -> str:
    """Results that are no numbers; branches of a Campbell diagram end where they cannot be followed, and an error
    that is not known is none."""
    bad: list[str] = []
    known_gap = re.compile("campbell|level_error$")

    def look(name: str, item: object) -> None:
        numbers = isinstance(item, h5py.Dataset) and item.dtype.kind in "fc"
        if numbers and not known_gap.search(name) and not np.isfinite(item[()]).all():
            bad.append(name)

    for path in set(out.glob("*.h5")) - {out / "accuracy.h5"}:
        with h5py.File(path) as file:
            file.visititems(look)
    return f"not finite: {bad}" if bad else ""
