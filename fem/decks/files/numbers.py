"""Numbers of a deck's data lines: regular lines are read fast, others line by line."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator

import numpy as np

from tireroad.fem.decks.files.lines import Data, Place

# Fortran writes 1.0D-3; commas and tabs are separators only.
_CLEAN = bytes.maketrans(b",\tDd", b"  ee")
_EMPTY_FIELD = re.compile(rb",[ \t]*(?=,)|,[ \t]*$", re.MULTILINE)
LABEL = 10**9  # the largest label of a node or element


def rows(data: list[Data], width: int, least: int = 1) -> np.ndarray:
    """Numbers (lines, width), one row per line; blank or missing fields are 0.

    Raises InputError with file and line for text, infinite numbers, fewer than `least` or too many
    fields.
    """
    return np.concatenate(
        [np.empty((0, width)), *(_rows_of(part, width, least) for part in data)], axis=0
    )


def _rows_of(part: Data, width: int, least: int) -> np.ndarray:
    lines = part.text.splitlines()
    table = _regular(part.text, lines, width, least)
    if table is None:
        table = _ragged(lines, width, least)
    if table is None or not np.isfinite(table).all():
        table = np.array(list(_slow(part, width, least))).reshape(-1, width)
    return table


def fast(text: bytes) -> np.ndarray | None:
    """All numbers of a text in order; None if it contains anything else."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text.translate(_CLEAN), sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _regular(text: bytes, lines: list[bytes], width: int, least: int) -> np.ndarray | None:
    """The table of lines with equal numbers of commas; None for other lines and for text."""
    counts = {line.count(b",") for line in lines if line.strip()}
    if len(counts) != 1:
        return None
    fields = counts.pop() + 1
    flat = fast(_EMPTY_FIELD.sub(b",0", text))
    rows = sum(1 for line in lines if line.strip())
    # A trailing comma begins a blank field, or none if the line is full.
    if flat is None or len(flat) != fields * rows or not least <= fields <= width + 1:
        return None
    table = np.zeros((rows, max(width, fields)))
    table[:, :fields] = flat.reshape(rows, fields)
    return table[:, :width] if not table[:, width:].any() else None


def _ragged(lines: list[bytes], width: int, least: int) -> np.ndarray | None:
    """The table of lines of unequal length; None if one has more than plain numbers and blanks."""
    found = []
    for line in lines:
        if not line.strip():
            continue
        parts = [part if part.strip() else b"0" for part in line.split(b",")]
        if b"_" in line or not least <= len(parts) <= width + (not parts[-1].strip(b" 0")):
            return None
        try:
            values = [float(part) for part in parts[:width]]
        except ValueError:
            return None
        found.append(values + [0.0] * (width - len(values)))
    return np.array(found).reshape(-1, width)


def _slow(part: Data, width: int, least: int) -> Iterator[list[float]]:
    for offset, line in enumerate(part.text.split(b"\n")):
        if not line.strip():
            continue
        place = Place(part.place.file, _first_line(part) + offset)
        found = [number(field, place) for field in fields(line)]
        if not least <= len(found) <= width:
            raise place.error(
                f"{len(found)} numbers; {least} to {width} belong here: {shown(line)}"
            )
        yield found + [0.0] * (width - len(found))


def _first_line(part: Data) -> int:
    """The line of the text's first character; `place` is that of its first number."""
    skipped = len(part.text) - len(part.text.lstrip())
    return part.place.line - part.text.count(b"\n", 0, skipped)


def fields(line: bytes | str) -> list[str]:
    """The fields of a data line; a trailing comma begins no further one."""
    text = line.decode("utf-8", "replace") if isinstance(line, bytes) else line
    parts = [part.strip() for part in text.strip().split(",")]
    return parts[:-1] if len(parts) > 1 and not parts[-1] else parts


def number(text: str, place: Place) -> float:
    """A finite number; a blank field is 0. Raises InputError otherwise."""
    if not text:
        return 0.0
    try:
        value = float(text.replace("D", "e").replace("d", "e").replace("_", "?"))
    except ValueError:
        raise place.error(f"{shown(text)} is no number") from None
    if not np.isfinite(value):
        raise place.error(f"{shown(text)} is not a finite number")
    return value


def shown(text: bytes | str) -> str:
    """A piece of a deck for a message: short and printable."""
    plain = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
    plain = "".join(c if c.isprintable() else "?" for c in plain.strip())
    return f'"{plain[:60]}"'


def records(data: list[Data], width: int) -> np.ndarray:
    """Whole numbers (records, width); a record may span several lines but starts a new one.

    Raises InputError with file and line for other text and for incomplete records.
    """
    return np.concatenate([np.empty((0, width), np.int64), *_joined_records(data, width)], axis=0)


def _joined_records(data: list[Data], width: int) -> Iterator[np.ndarray]:
    text = b"".join(part.text if part.text.endswith(b"\n") else part.text + b"\n" for part in data)
    flat = fast(text) if data else np.empty(0)
    if flat is not None and len(flat) % width == 0 and _whole(flat):
        lines = sum(1 for line in text.splitlines() if line.strip())
        if flat.size and lines % (len(flat) // width) == 0:
            yield flat.reshape(-1, width).astype(np.int64)
            return
    yield from _slow_records(data, width)


def _whole(flat: np.ndarray) -> bool:
    return bool((np.isfinite(flat) & (flat == np.floor(flat)) & (np.abs(flat) <= LABEL)).all())


def _slow_records(data: list[Data], width: int) -> Iterator[np.ndarray]:
    begun: list[int] = []
    found: list[list[int]] = []
    where = Place("", 0)  # of the first line of the current record
    for part in data:
        for offset, line in enumerate(part.text.split(b"\n")):
            if not line.strip():
                continue
            place = Place(part.place.file, _first_line(part) + offset)
            where = where if begun else place
            begun += [label(field, place) for field in fields(line)]
            if len(begun) > width:
                raise where.error(
                    f"{len(begun)} numbers, {width} belong to an element of this type"
                )
            if len(begun) == width:
                found.append(begun)
                begun = []
    if begun:
        raise where.error(
            f"{len(begun)} numbers, {width} belong to an element of this type: is the deck cut short?"
        )
    yield np.array(found, np.int64).reshape(-1, width)


def labels(part: Data) -> np.ndarray | None:
    """All labels in the lines of a set; None if they contain anything else."""
    flat = fast(part.text)
    if flat is None or not _whole(flat) or (flat < 0).any():
        return None
    return flat.astype(np.int64)


def label(text: str, place: Place) -> int:
    """Label of a node or element, an integer from 0 to 10^9. Raises InputError otherwise."""
    value = number(text, place)
    if value != int(value) or not 0 <= value <= LABEL:
        raise place.error(f"{shown(text)} is no label of a node or element")
    return int(value)
