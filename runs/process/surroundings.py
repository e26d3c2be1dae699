"""Checks of a run's environment and memory, made before MPI and HDF5 would fail without a message."""

import math
import os
import resource
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tireroad.fem.errors import InputError

# Option prefixes of the PETSc objects that factorise: modes and responses, static state, full
# states of a rotating tire.
_PREFIXES = "", "static_", "rotating_st_"
LEAST_ADDRESSES = 2e9  # bytes; the libraries reserve 1 GB, and OpenBLAS waits forever for more
LEAST_FILE = 64e6  # bytes of a file: MPI's shared memory, results
LEAST_TEMPORARY = 16e6  # bytes free for MPI's session and shared memory


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


def check_surroundings() -> None:
    """Raise InputError if the program could not even start. Not collective."""
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError("the working folder was removed: change to one that exists") from None
    for limit, least, name in (
        (resource.RLIMIT_AS, LEAST_ADDRESSES, "ulimit -v"),
        (resource.RLIMIT_FSIZE, LEAST_FILE, "ulimit -f"),
    ):
        allowed = resource.getrlimit(limit)[0]
        if allowed != resource.RLIM_INFINITY and allowed < least:
            raise InputError(
                f"{name} allows {1e-6 * allowed:.4g} MB, and at least {1e-6 * least:.4g} MB are"
                " needed: raise the limit"
            )
    _check_temporary()


def crowded(processes: int) -> list[str]:
    """A warning if this machine has less than half a core for each process.

    Twice as many as cores are nothing unusual: hyperthreads, and the tests.
    """
    cores = os.cpu_count() or 1
    if processes <= 2 * cores:
        return []
    return [
        f"{processes} processes on the {cores} core(s) of this machine: they wait for one another, and a run takes "
        f"longer than with -n {cores}"
    ]


def _check_temporary() -> None:
    for name in ("TMPDIR", "TEMP", "TMP"):  # in MPI's order, which takes the first that is set
        if folder_name := os.environ.get(name):
            if not (os.path.isdir(folder_name) and os.access(folder_name, os.W_OK | os.X_OK)):
                raise InputError(
                    f"{name} = {folder_name} is not writable, and MPI keeps its session files there: set it to "
                    "another, or unset it"
                )
            break
    try:
        folder = Path(tempfile.gettempdir())
    except FileNotFoundError:
        raise InputError("no folder for temporary files can be written: set TMPDIR") from None
    room = os.statvfs(folder)
    free = room.f_bavail * room.f_frsize
    if free < LEAST_TEMPORARY:
        raise InputError(
            f"{folder} has {1e-6 * free:.3g} MB free, and MPI needs about"
            f" {1e-6 * LEAST_TEMPORARY:.3g} MB there: set TMPDIR to another folder, or free some room"
        )
