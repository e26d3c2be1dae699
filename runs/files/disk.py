"""Files written whole or not at all, with a checksum; messages for a disk that is full or read-only.

HDF5 files may begin with a user block. Ours holds the SHA-256 of all bytes after it, so that data,
shapes, attributes and HDF5's own structures are covered, the checksum moves with a copied file, and
a damaged file never reaches the HDF5 library, which may crash on it.
"""

import errno
import hashlib
import json
import os
import shutil
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError

_SLACK = 1.0  # s: tolerance between file and process clocks
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG}
FACTORS = ".factors"  # subfolder of a result folder for factors that do not fit into memory
BLOCK = 512  # bytes, the minimum in HDF5
_TITLE = b"tireroad result (HDF5). SHA-256 of all bytes from 512 on:\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"
_SIGNATURE = "# SHA-256 of the lines above: "
_ENTRY = "checksum"
_known: dict[str, tuple[int, ...]] = {}
"""Files that this process found intact, with file attributes that change on writing."""


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


class NoChecksum(Exception):
    """An HDF5 file from another program, or from a version before checksums."""


def seal(path: Path) -> None:
    """Write the checksum into a closed file that has a user block of `BLOCK` bytes."""
    with path.open("r+b") as file:
        block = _block(file)
        file.seek(0)
        file.write(block)


def is_whole(path: Path) -> bool:
    """Whether the file is unchanged since `seal`.

    Reads all of it once per process, at 1 to 2 GB/s. Raises NoChecksum for an HDF5 file without
    one, OSError if it cannot be read.
    """
    state = _state(path)
    if _known.get(str(path)) == state:
        return True
    with path.open("rb") as file:
        block = file.read(BLOCK)
        if block.startswith(_HDF5):
            raise NoChecksum(f"{path} carries no checksum")
        whole = len(block) == BLOCK and block == _block(file)
    if whole:
        _known[str(path)] = state
    return whole


def signed(text: str) -> str:
    """A text with # comments, plus a last line with the checksum of the lines above."""
    return f"{text}{_SIGNATURE}{text_digest(text)}\n"


def is_as_signed(text: str) -> bool:
    """Whether a text is unchanged since `signed`; a truncated text is not."""
    lines, separator, digest = text.rpartition(_SIGNATURE)
    return bool(separator) and digest.strip() == text_digest(lines)


def signed_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """A JSON object with its own checksum as last entry."""
    return {**table, _ENTRY: _table_digest(table)}


def is_table_as_signed(table: Mapping[str, Any]) -> bool:
    """Whether an object read from JSON is unchanged since `signed_table`, or was never signed."""
    return _ENTRY not in table or table[_ENTRY] == _table_digest(table)


def text_digest(text: str) -> str:
    """SHA-256 of a text."""
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _table_digest(table: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in table.items() if key != _ENTRY}
    return text_digest(json.dumps(rest, sort_keys=True))


def _block(file) -> bytes:
    file.seek(BLOCK)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    return (_TITLE + digest.encode() + b"\n").ljust(BLOCK, b"\0")


def _state(path: Path) -> tuple[int, ...]:
    status = os.stat(path)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
