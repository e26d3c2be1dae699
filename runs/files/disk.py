"""Atomic file writes, and messages for a disk that is full or read-only."""

import errno
import os
import shutil
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tireroad.fem.errors import InputError

_SLACK = 1.0  # s: tolerance between file and process clocks
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG}


class Refused(InputError):
    """The disk takes no more data during a run: exit status 3; finished stages are kept."""


def explained(error: BaseException, path: Path | str) -> Refused | None:
    """A full disk or a refused write as one message; None for any other error.

    HDF5 reports the operating system's error within its own text, hence the search.
    """
    number = getattr(error, "errno", None)
    text = str(error)
    if number in FULL or any(f"errno = {code}," in text for code in FULL):
        reason = "the disk is full (or the file too large for it): free some space and run again"
    elif number in REFUSED or any(f"errno = {code}," in text for code in REFUSED):
        reason = "the folder is not writable: make it so, or run with another --out"
    else:
        return None
    return Refused(f"{path}: cannot be written, {reason}; what was there before is kept")


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


class Removed(FileNotFoundError):
    """The result folder, or a file being written in it, was removed: exit status 3."""


def part_of(path: Path) -> Path:
    """The temporary name that this process uses beside `path`."""
    return path.with_name(f".{path.name}.{socket.gethostname()}.{os.getpid()}.part")


FACTORS = ".factors"  # subfolder of a result folder for factors that do not fit into memory


def remove_factors(directory: Path) -> None:
    """Remove the factors of a run that has ended or was killed."""
    shutil.rmtree(directory / FACTORS, ignore_errors=True)


def remove_leftovers(directory: Path) -> None:
    """Remove factors, and temporary files of killed processes of this machine."""
    remove_factors(directory)
    for part in directory.glob(".*.part"):
        rest, _, process = part.name.removesuffix(".part").rpartition(".")
        here = rest.endswith(f".{socket.gethostname()}")
        with suppress(OSError):
            if here and process.isdigit() and not _lives(int(process), part.stat().st_mtime):
                part.unlink()


def _lives(process: int, written: float) -> bool:
    """Whether another process that wrote at this time (s since the epoch) is still running.

    Neither a zombie counts, nor a later process with the same number.
    """
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        pass
    if process == os.getpid():
        return False
    try:
        state, *rest = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return True
    age = time.clock_gettime(time.CLOCK_BOOTTIME) - int(rest[18]) / os.sysconf("SC_CLK_TCK")
    return state not in "ZX" and time.time() - age <= written + _SLACK


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path`, renamed to it at the end, removed on failure."""
    part = part_of(path)
    try:
        yield part
        _sync(part)
        os.replace(part, path)
        _sync(path.parent)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        if isinstance(error, FileNotFoundError):
            raise Removed(
                f"{path.parent}: the result folder, or what was being written in it, was removed"
                " during the run: run it again"
            ) from error
        clear = explained(error, path) if isinstance(error, OSError | RuntimeError) else None
        if clear is not None:
            raise clear from error
        raise


def write_text(path: Path, text: str) -> None:
    """Write a small text file atomically."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
