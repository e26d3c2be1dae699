"""Memory used by this process and available on this machine."""

import math
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def forget_peak() -> None:
    """Reset the maximum of `peak_memory`, if the kernel supports it (/proc/self/clear_refs)."""
    with suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def peak_memory() -> float:
    """Largest resident memory (bytes) of this process since it began, or since `forget_peak`.

    Read from /proc, because on Linux the maximum of getrusage includes that of the parent process.
    """
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (own,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
    return 1024.0 * float(own)


# Option prefixes of the PETSc objects that factorise: modes and responses, static state, full
# states of a rotating tire.
_PREFIXES = "", "static_", "rotating_st_"


@contextmanager
def factors_on_disk(folder: Path) -> Iterator[None]:
    """Within the context, MUMPS keeps factors in files of the folder, removed with each factor.

    The user's own PETSc options take precedence.
    """
    from petsc4py import PETSc

    os.environ["MUMPS_OOC_TMPDIR"] = str(folder.resolve())
    options = PETSc.Options()
    names = [f"{prefix}mat_mumps_icntl_22" for prefix in _PREFIXES]
    ours = [name for name in names if not options.hasName(name)]
    for name in ours:
        options[name] = 1
        options.getInt(name)  # read once, or PETSc reports it as unused
    try:
        yield
    finally:
        for name in ours:
            options.delValue(name)


def available_memory() -> float:
    """Memory (bytes) still available: the kernel's estimate, within the control group's limit.

    Infinite if neither can be read.
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
