"""Checks of a run's environment, made before MPI and HDF5 would fail without a message."""

import os
import resource
import tempfile
from pathlib import Path

from tireroad.fem.errors import InputError

LEAST_ADDRESSES = 2e9  # bytes; the libraries reserve 1 GB, and OpenBLAS waits forever for more
LEAST_FILE = 64e6  # bytes of a file: MPI's shared memory, results
LEAST_TEMPORARY = 16e6  # bytes free for MPI's session and shared memory


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
        if given := os.environ.get(name):
            if not (os.path.isdir(given) and os.access(given, os.W_OK | os.X_OK)):
                raise InputError(
                    f"{name} = {given} is no folder that can be written, and MPI keeps its files there: set it to "
                    "another, or unset it"
                )
            break
    try:
        folder = Path(tempfile.gettempdir())
    except FileNotFoundError:
        raise InputError("no folder for temporary files can be written: set TMPDIR") from None
    found = os.statvfs(folder)
    free = found.f_bavail * found.f_frsize
    if free < LEAST_TEMPORARY:
        raise InputError(
            f"{folder} has {1e-6 * free:.3g} MB free, and MPI needs about"
            f" {1e-6 * LEAST_TEMPORARY:.3g} MB there: set TMPDIR to another folder, or free some room"
        )
