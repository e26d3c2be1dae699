"""How much memory this process has taken, and how much there is."""

import math
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def forget_peak() -> None:
    """Let `peak_memory` begin anew, where the kernel can (/proc/self/clear_refs)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_memory() -> float:
    """Largest resident memory of this process since it began, or since `forget_peak`, bytes.

    Linux carries the maximum of getrusage over from the process that started this one: there it is
    read from /proc.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (own,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
    return 1024.0 * float(own)


# Of the options of PETSc's objects that factorise: modes and responses, static state, full states of a turning tire.
_PREFIXES = "", "static_", "rotating_st_"


@contextmanager
def factors_on_disk(folder: Path) -> Iterator[None]:
    """While inside, MUMPS keeps factors in files of the folder, and removes each with its factor. What the user's
    PETSc options say stays."""
    from petsc4py import PETSc

    os.environ["MUMPS_OOC_TMPDIR"] = str(folder.resolve())
    options = PETSc.Options()
    names = [f"{prefix}mat_mumps_icntl_22" for prefix in _PREFIXES]
    ours = [name for name in names if not options.hasName(name)]
    for name in ours:
        options[name] = 1
        options.getInt(name)  # read once: else PETSc calls it unused
    try:
        yield
    finally:
        for name in ours:
            options.delValue(name)


def available_memory() -> float:
    """Memory that this machine can still give, bytes: what the kernel reckons, within the limit of
    the control group; infinite where neither can be read.
    """
    free = math.inf
    with suppress(OSError, ValueError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(1024.0 * float(line.split()[1]) for line in lines if "MemAvailable" in line)
    with suppress(OSError, ValueError):
        limit = float(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii"))
        used = float(Path("/sys/fs/cgroup/memory.current").read_text(encoding="ascii"))
        free = min(free, limit - used)
    return free
