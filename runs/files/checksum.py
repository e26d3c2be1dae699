"""Checksums in result files, verified before their content is read.

HDF5 files may begin with a user block. Ours holds the SHA-256 of all bytes after it, so that data,
shapes, attributes and HDF5's own structures are covered, the checksum moves with a copied file, and
a damaged file never reaches the HDF5 library, which may crash on it.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

BLOCK = 512  # bytes, the minimum in HDF5
_TITLE = b"tireroad result (HDF5). SHA-256 of all bytes from 512 on:\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"

_SIGNATURE = "# SHA-256 of the lines above: "
_ENTRY = "checksum"

_known: dict[str, tuple[int, ...]] = {}
"""Files that this process found intact, with file attributes that change on writing."""


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
        found = file.read(BLOCK)
        if found.startswith(_HDF5):
            raise NoChecksum(f"{path} carries no checksum")
        whole = len(found) == BLOCK and found == _block(file)
    if whole:
        _known[str(path)] = state
    return whole


def signed(text: str) -> str:
    """A text with # comments, plus a last line with the checksum of the lines above."""
    return f"{text}{_SIGNATURE}{text_digest(text)}\n"


def is_as_signed(text: str) -> bool:
    """Whether a text is unchanged since `signed`; a truncated text is not."""
    lines, found, digest = text.rpartition(_SIGNATURE)
    return bool(found) and digest.strip() == text_digest(lines)


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
