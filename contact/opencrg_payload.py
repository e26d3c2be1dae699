"""The sequential data of an OpenCRG file: rows of numbers in 80-byte records, text or binary."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.errors import InputError

Array = NDArray[np.float64]

RECORD = 80


class Payload(NamedTuple):
    """Where a file's numbers are and how many.

    Format code, byte and line where they begin, numbers a row, and the rows the header announces
    (None if it does not).
    """

    file: Path
    code: str
    start: int
    line: int
    channels: int
    rows: int | None


def read_payload(payload: Payload) -> Array:
    """(rows, channels) numbers, NaN where missing. InputError names the place of damage."""
    if payload.code in ("KRBI", "KDBI"):
        return _read_binary(payload)
    return _read_text(payload)


def _read_binary(payload: Payload) -> Array:
    """Big-endian numbers, packed without regard to rows; the last record is filled with NaN."""
    kind = np.dtype(">f4" if payload.code == "KRBI" else ">f8")
    size = payload.file.stat().st_size - payload.start
    whole = size - size % RECORD
    rows = payload.rows
    if rows is None:
        rows = whole // (kind.itemsize * payload.channels)
    data = rows * payload.channels * kind.itemsize
    needed = -(-data // RECORD) * RECORD
    # A line's end may follow the last record.
    if size < data or size - whole > 2 or (payload.rows is not None and whole > needed):
        raise InputError(
            f"{payload.file}: {size:,} bytes of data from byte {payload.start:,} on, "
            f"{needed:,} expected for {rows} rows of {payload.channels} channels ({payload.code}): "
            f"the file is {'longer than its header says' if whole > needed else 'truncated'}"
        )
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        numbers = np.fromfile(stream, dtype=kind, count=whole // kind.itemsize)
    # A signalling NaN would raise an invalid-operation flag when widened to double.
    with np.errstate(invalid="ignore"):
        numbers = numbers.astype(float)
    used = rows * payload.channels
    if payload.rows is None and not np.isnan(numbers[used:]).all():
        raise InputError(
            f"{payload.file}: {whole:,} bytes of data from byte {payload.start:,} on end within a "
            f"row of {payload.channels} channels ({payload.code}): the file is truncated"
        )
    table = numbers[:used].reshape(rows, payload.channels)
    return _without_padding(table, kind.itemsize) if payload.rows is None else table


def _without_padding(table: Array, itemsize: int) -> Array:
    """Without the rows of NaN that fill the last record: a cross section has one valid height."""
    most = RECORD // itemsize // table.shape[1]
    while most > 0 and len(table) > 0 and np.isnan(table[-1]).all():
        table, most = table[:-1], most - 1
    return table


def _read_text(payload: Payload) -> Array:
    """Fields of 10 (LRFI) or 20 (LDFI) characters; a row begins a new record (line)."""
    width = 10 if payload.code == "LRFI" else 20
    a_record = RECORD // width
    with payload.file.open("rb") as stream:
        stream.seek(payload.start)
        lines = stream.read().splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    per_row = -(-payload.channels // a_record)
    rows = len(lines) // per_row
    if len(lines) % per_row or (payload.rows is not None and rows != payload.rows):
        wanted = f"{payload.rows} rows" if payload.rows is not None else "whole rows"
        raise InputError(
            f"{payload.file}: {len(lines)} records of data from line {payload.line} on, "
            f"{wanted} of {per_row} records expected: the file is truncated or damaged"
        )
    table = np.empty((rows, payload.channels))
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
        # A last field may lose its trailing blanks, never all of itself.
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
