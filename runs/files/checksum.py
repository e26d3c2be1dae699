"""A checksum in every result file, looked at before its content is.

HDF5 files may begin with a block of the user's. Ours holds the SHA-256 of all bytes after it, so that
data, shapes, attributes and HDF5's own structures are covered, the file stays whole when it is
copied elsewhere, and a damaged one never reaches the HDF5 library, which may crash on it.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

BLOCK = 512  # bytes, the least that HDF5 allows
_TITLE = b"tireroad result (HDF5). SHA-256 of all bytes from 512 on:\n"
_HDF5 = b"\x89HDF\r\n\x1a\n"

_SIGNATURE = "# SHA-256 of the lines above: "
_ENTRY = "checksum"

_known: dict[str, tuple[int, ...]] = {}
"""Files of this process that were found whole, with what would change if they were written to."""


class NoChecksum(Exception):
    """An HDF5 file that another program wrote, or this one before it kept checksums."""


def seal(path: Path) -> None:
    """Put the checksum into a closed file that was made with a user block of `BLOCK` bytes."""
    with path.open("r+b") as file:
        block = _block(file)
        file.seek(0)
        file.write(block)


def is_whole(path: Path) -> bool:
    """Whether the file is byte for byte what `seal` saw.

    Reads all of it once a process, 1 to 2 GB/s. Raises NoChecksum for an HDF5 file without one,
    OSError where it cannot be read.
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
    """A text of comments in #, with a last line that tells whether the lines above have changed."""
    return f"{text}{_SIGNATURE}{_text_digest(text)}\n"


def is_as_signed(text: str) -> bool:
    """Whether a text is what `signed` made: one cut before its last line is not."""
    lines, found, digest = text.rpartition(_SIGNATURE)
    return bool(found) and digest.strip() == _text_digest(lines)


def signed_table(table: Mapping[str, Any]) -> dict[str, Any]:
    """A JSON object with its own checksum as last entry."""
    return {**table, _ENTRY: _table_digest(table)}


def is_table_as_signed(table: Mapping[str, Any]) -> bool:
    """Whether an object read from JSON is what `signed_table` made; so is one it never saw."""
    return _ENTRY not in table or table[_ENTRY] == _table_digest(table)


def _text_digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _table_digest(table: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in table.items() if key != _ENTRY}
    return _text_digest(json.dumps(rest, sort_keys=True))


def _block(file) -> bytes:
    file.seek(BLOCK)
    digest = hashlib.file_digest(file, "sha256").hexdigest()
    return (_TITLE + digest.encode() + b"\n").ljust(BLOCK, b"\0")


def _state(path: Path) -> tuple[int, ...]:
    status = os.stat(path)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
