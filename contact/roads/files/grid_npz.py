"""Road heights in NumPy archives (.npz), read as data; sizes are checked before allocation."""

import struct
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.files.archive import read_header, read_numbers
from tireroad.contact.roads.rows import (
    MAX_POINTS,
    PIECE,
    ArrayRows,
    FileRows,
    Packed,
    Rows,
    Spool,
    check_count,
)
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]


def read_npz(file: Path) -> tuple[Array, Array, Rows]:
    """The arrays x (nx,), y (ny,) and z (nx, ny) of an archive; z stays in the file if possible.

    InputError for missing arrays, arrays without numbers, and headers that announce other sizes
    than the archive holds.
    """
    with zipfile.ZipFile(file) as archive:
        members = {member.filename for member in archive.infolist()}
        missing = [name for name in "xyz" if f"{name}.npy" not in members]
        if missing:
            names = ", ".join(missing)
            raise InputError(f"road.file {file}: no array {names}; x, y and z are needed")
        try:
            x, y = (read_numbers(archive, name, MAX_POINTS) for name in "xy")
            return x, y, _rows(file, archive)
        except (ValueError, TypeError) as error:
            raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error


def _rows(file: Path, archive: zipfile.ZipFile) -> Rows:
    """z, left in the archive if it is not compressed; all of it is read once, as a check."""
    info = archive.getinfo("z.npy")
    with archive.open(info) as stream:
        header = read_header(stream, info, "z")
        if len(header.shape) != 2:
            raise ValueError(f"z has the shape {header.shape}")
        if header.by_columns:
            check_count(file, header.shape[0] * header.shape[1])
            numbers = np.frombuffer(stream.read(), header.kind)
            return ArrayRows(numbers.reshape(header.shape, order="F").astype(float))
        rows, width = header.shape
        packed = Packed(header.start, header.kind, (rows, width))
        stored = info.compress_type == zipfile.ZIP_STORED
        spool = Spool(f"road.file {file}", 0 if stored else rows * width)
        for block in _blocks(stream, packed):
            if not stored:
                spool.add(block)
    return _stored(file, info, packed) if stored else spool.rows()


def _blocks(stream: IO[bytes], packed: Packed) -> Iterator[Array]:
    """Blocks of rows in their order; reading past the last lets the archive verify its checksum."""
    (count, width), size = packed.shape, packed.kind.itemsize
    most = max(PIECE // width, 1)
    for first in range(0, count, most):
        wanted = min(most, count - first) * width * size
        data = stream.read(wanted)
        if len(data) < wanted:
            raise EOFError("z ends too early")
        yield np.frombuffer(data, packed.kind).reshape(-1, width).astype(float)
    stream.read(1)


def _stored(file: Path, info: zipfile.ZipInfo, packed: Packed) -> FileRows:
    """Rows of an uncompressed member of an archive.

    Its local header has the lengths of two variable fields at byte 26.
    """
    with file.open("rb") as stream:
        stream.seek(info.header_offset + 26)
        name, extra = struct.unpack("<HH", stream.read(4))
    start = info.header_offset + 30 + name + extra + packed.start
    return FileRows(file, packed._replace(start=start))
