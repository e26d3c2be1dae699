"""Numbers of a deck's data lines: fast where the lines are regular, line by line where they are not."""

from __future__ import annotations

import re
import warnings

import numpy as np

from tireroad.fem.decks.lines import Data, Place

# Fortran writes 1.0D-3; commas and tabs only separate.
_CLEAN = bytes.maketrans(b",\tDd", b"  ee")
_EMPTY_FIELD = re.compile(rb",[ \t]*,|^[ \t]*,", re.MULTILINE)
LABEL = 10**9  # the largest label of a node or element


def rows(data: list[Data], width: int, least: int = 1) -> np.ndarray:
    """(lines, width) numbers, one row a line; fields left blank or out are 0.

    Raises InputError with file and line for text, infinite numbers, fewer than `least` or more fields.
    """
    return np.concatenate(
        [np.empty((0, width)), *(_rows_of(part, width, least) for part in data)], axis=0
    )


def _rows_of(part: Data, width: int, least: int) -> np.ndarray:
    flat = _fast(part.text)
    if flat is not None:
        lines = sum(1 for line in part.text.splitlines() if line.strip())
        fields, odd = divmod(len(flat), lines)
        if not odd and least <= fields <= width and _regular(part.text, fields, lines):
            table = np.zeros((lines, width))
            table[:, :fields] = flat.reshape(lines, fields)
            if np.isfinite(table).all():
                return table
    return np.array(list(_slow(part, width, least))).reshape(-1, width)


def _fast(text: bytes) -> np.ndarray | None:
    """All numbers of a text in their order, or None where it holds anything else or a blank field."""
    if _EMPTY_FIELD.search(text):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text.translate(_CLEAN), sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _regular(text: bytes, fields: int, lines: int) -> bool:
    """Whether every line has as many fields: by its commas, one after the last field allowed."""
    counts = {line.count(b",") for line in text.splitlines() if line.strip()}
    return len(counts) == 1 and counts <= {fields - 1, fields}


def _slow(part: Data, width: int, least: int):
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
    """The fields of a data line; a comma at its end begins no further one."""
    text = line.decode("utf-8", "replace") if isinstance(line, bytes) else line
    parts = [part.strip() for part in text.strip().split(",")]
    return parts[:-1] if len(parts) > 1 and not parts[-1] else parts


def number(text: str, place: Place) -> float:
    """A finite number; a blank field is 0."""
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
    """(records, width) whole numbers; a record may go on over several lines but begins a line.

    Raises InputError with file and line for other text and for records that are cut short.
    """
    return np.concatenate([np.empty((0, width), np.int64), *_joined_records(data, width)], axis=0)


def _joined_records(data: list[Data], width: int):
    text = b"".join(part.text if part.text.endswith(b"\n") else part.text + b"\n" for part in data)
    flat = _fast(text) if data else np.empty(0)
    if flat is not None and len(flat) % width == 0 and _whole(flat):
        lines = sum(1 for line in text.splitlines() if line.strip())
        if flat.size and lines % (len(flat) // width) == 0:
            yield flat.reshape(-1, width).astype(np.int64)
            return
    yield from _slow_records(data, width)


def _whole(flat: np.ndarray) -> bool:
    return bool((np.isfinite(flat) & (flat == np.floor(flat)) & (np.abs(flat) <= LABEL)).all())


def _slow_records(data: list[Data], width: int):
    begun, where, found = [], None, []
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


def label(text: str, place: Place) -> int:
    """A label of a node or an element, a whole number from 0 to 10^9."""
    value = number(text, place)
    if value != int(value) or not 0 <= value <= LABEL:
        raise place.error(f"{shown(text)} is no label of a node or element")
    return int(value)
