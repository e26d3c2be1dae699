"""The sequential data of an OpenCRG file: rows of numbers in 80-byte records, text or binary."""

from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.rows import FileRows, Packed, Rows, Spool
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

RECORD = 80
BLOCK = 4096  # rows of text read at a time


class Payload(NamedTuple):
    """Position and size of a file's numbers.

    Format code, byte and line where they begin, numbers per row, and the number of rows that the
    header announces (None if it does not).
    """

    file: Path
    code: str
    start: int
    line: int
    channels: int
    rows: int | None


def read_payload(payload: Payload) -> Rows:
    """Rows of numbers, NaN where missing. InputError names the place of damage.

    Binary data stay in the file; text is converted once (contact.roads.rows.Spool).
    """
    if payload.code in ("KRBI", "KDBI"):
        return _read_binary(payload)
    return _read_text(payload)


def _read_binary(payload: Payload) -> Rows:
    """Big-endian numbers, packed across record boundaries; the last record is padded with NaN."""
    kind = np.dtype(">f4" if payload.code == "KRBI" else ">f8")
    size = payload.file.stat().st_size - payload.start
    whole = size - size % RECORD
    rows, row = payload.rows, payload.channels * kind.itemsize
    if rows is None:
        rows = whole // row
    needed = -(-rows * row // RECORD) * RECORD
    # A line end may follow the last record.
    if size < rows * row or size - whole > 2 or (payload.rows is not None and whole > needed):
        raise InputError(
            f"{payload.file}: {size:,} bytes of data from byte {payload.start:,} on, "
            f"{needed:,} expected for {rows} rows of {payload.channels} channels ({payload.code}): "
            f"the file is {'longer than its header says' if whole > needed else 'truncated'}"
        )
    if payload.rows is None:
        rows = _without_padding(payload, kind, rows, whole)
    return FileRows(payload.file, Packed(payload.start, kind, (rows, payload.channels)))


def _without_padding(payload: Payload, kind: np.dtype, rows: int, whole: int) -> int:
    """Number of rows without the NaN rows that pad the last record.

    A cross section has at least one valid height.
    """
    row = payload.channels * kind.itemsize
    most = min(RECORD // row, rows)
    with payload.file.open("rb") as stream:
        stream.seek(payload.start + (rows - most) * row)
        last = np.frombuffer(stream.read(whole - (rows - most) * row), kind)
    if not np.isnan(last[most * payload.channels :]).all():
        raise InputError(
            f"{payload.file}: {whole:,} bytes of data from byte {payload.start:,} on end within a "
            f"row of {payload.channels} channels ({payload.code}): the file is truncated"
        )
    empty = np.isnan(last[: most * payload.channels].reshape(most, payload.channels)).all(axis=1)
    while most > 0 and empty[most - 1]:
        rows, most = rows - 1, most - 1
    return rows


def _read_text(payload: Payload) -> Rows:
    """Fields of 10 (LRFI) or 20 (LDFI) characters; each row begins a new record (line)."""
    width = 10 if payload.code == "LRFI" else 20
    per_row = -(-payload.channels // (RECORD // width))
    count = _lines(payload)
    rows = count // per_row
    if count % per_row or (payload.rows is not None and rows != payload.rows):
        wanted = f"{payload.rows} rows" if payload.rows is not None else "whole rows"
        raise InputError(
            f"{payload.file}: {count} records of data from line {payload.line} on, "
            f"{wanted} of {per_row} records expected: the file is truncated or damaged"
        )
    spool = Spool()
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        left, part = count, payload
        while left:
            lines = [line.rstrip(b"\r\n") for line in islice(stream, min(left, BLOCK * per_row))]
            spool.add(_table(part, lines, width, per_row))
            left -= len(lines)
            part = part._replace(line=part.line + len(lines))
    return spool.rows()


def _lines(payload: Payload) -> int:
    """Number of lines of data, without empty ones at the end."""
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        last = 0
        for number, line in enumerate(stream, 1):
            if line.strip():
                last = number
    return last


def _table(payload: Payload, lines: list[bytes], width: int, per_row: int) -> Array:
    """Numbers (rows, channels) of some lines, the first of which is the payload's."""
    a_record = RECORD // width
    table = np.empty((len(lines) // per_row, payload.channels))
    for k in range(per_row):
        first = k * a_record
        count = min(a_record, payload.channels - first)
        chosen = lines[k::per_row]
        table[:, first : first + count] = _fields(payload, chosen, width, count, k, per_row)
    return table


def _fields(
    payload: Payload, lines: list[bytes], width: int, count: int, offset: int, step: int
) -> Array:
    """(lines, count) numbers of fixed width; a field that starts with * is missing."""
    size = width * count
    for i, line in enumerate(lines):
        # A last field may lack its trailing blanks, but not be absent.
        if len(line.rstrip()) > size or len(line.rstrip()) <= size - width:
            number = payload.line + offset + i * step
            raise InputError(
                f"{payload.file}, line {number}: {len(line.rstrip())} characters, {count} numbers "
                f"of {width} characters expected ({payload.code})"
            )
    joined = b"".join(line.rstrip().ljust(size) for line in lines)
    fields = np.char.strip(np.frombuffer(joined, dtype=f"S{width}"))
    fields = np.where(np.char.startswith(fields, b"*"), b"nan", fields)
    try:
        return fields.astype(float).reshape(len(lines), count)
    except ValueError:
        bad = next(i for i, field in enumerate(fields) if not _is_number(field))
        number = payload.line + offset + bad // count * step
        text = fields[bad].decode("latin-1")
        raise InputError(
            f"{payload.file}, line {number}, column {bad % count * width + 1}: {text!r} is no "
            "number"
        ) from None


def _is_number(field: bytes) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
