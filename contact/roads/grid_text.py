"""Grids of heights in text: a list of points under headings, or a matrix with y above and x beside it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import ArrayRows, Coding, Rows, Spool, check_count
from tireroad.contact.roads.meaning import (
    Column,
    Layout,
    Scale,
    Stated,
    check_flags,
    check_late,
    column_of,
    downwards_note,
    layout_of,
    role_of,
    scale_of,
    unit_of,
)
from tireroad.contact.roads.text_table import (
    Decimals,
    Form,
    Line,
    head_of,
    lines_of,
    numbers_of,
    opened,
)
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
Scales = tuple[Scale | None, Scale | None, Scale | None]

BLOCK = 4096  # most lines per block
BLOCK_CHARACTERS = 32_000_000  # most characters per block

_LAYOUT = "a list of points begins with the line x,y,z, a matrix with a corner that is not read, then the y of its columns"
_ORDER = re.compile(
    r"\b(?P<what>(?:first|top|left|1st|erste|header)?[ _-]*(?:rows?|lines?|columns?|cols?|zeilen?|spalten?))\b[^a-z0-9]*"
    r"(?:(?:are|is|has|holds?|contains?|gives?|along|=|of|the|positions?|values?|coordinates?)[^a-z0-9]*)*\b(?P<axis>[xy])\b"
    r"|\b(?P<of>[xy])\b[^a-z]*(?P<where>across|down|along (?:the )?(?:rows?|columns?)|in (?:the )?(?:first )?(?:rows?|columns?))\b",
    re.IGNORECASE,
)
_PLAIN = re.compile(
    r"grid|data|matrix|table|road|corner|nan|na|rows?|columns?|and|by|over|down", re.I
)
_ACROSS = re.compile(r"\bx\b[^a-z]*(?:[-=]+>|→|across|columns?\b)", re.I)
_BRACKETS = re.compile(r"[\[({<][^\])}>]*[\])}>]")
_SAME = 1e-3  # of a usual step: positions that close are one


@dataclass(frozen=True)
class Keys:
    """Keys of a scene that describe a file: units of lengths and heights, and values that mean "no height" (None: to be looked for)."""

    length_unit: str | None = None
    height_unit: str | None = None
    missing: tuple[float, ...] | None = None

    def scales(self, columns: Sequence[Column], stated: Stated, source: str) -> Scales:
        """The units of x, y and z by file or key; None where neither says."""
        lengths, heights = ("length_unit", self.length_unit), ("height_unit", self.height_unit)
        x, y, z = columns
        return (
            scale_of("x", x, stated, lengths, source),
            scale_of("y", y, stated, lengths, source),
            scale_of("z", z, stated, heights, source),
        )


class Found(NamedTuple):
    """x (nx,), y (ny,) and rows of z (nx, ny) in the file's numbers; a unit each (None: not said), and how z is coded.

    `places`: where x, y and z stand; `notes` for the user; `mask`: rows that are not 0 where there is no height; `text`:
    whether the file is one; `odd`: special numbers that are written otherwise than the heights.
    """

    x: Array
    y: Array
    rows: Rows
    scales: Scales
    coding: Coding
    places: tuple[str, str, str]
    notes: tuple[str, ...] = ()
    mask: Rows | None = None
    odd: tuple[float, ...] = ()
    text: bool = False


def read_csv(file: Path, keys: Keys) -> Found:
    """The grid in a text file, in the layouts given in `grid_file.read_grid`. InputError names the line of an error."""
    source = f"road.file {file}"
    with opened(file, source) as stream:
        lines = lines_of(stream, source)
        head = head_of(lines)
        if not head:
            raise InputError(f"{source}: is empty")
        layout = layout_of(head, source, 2)
        if layout is None:
            raise _too_few([line for line in head if not line.comment], source)
        if layout.headed and len(layout.of("x", "y", "z")) > 1:
            return _list(file, head, lines, layout, keys)
        if layout.width == 3 and not layout.headed and _repeats(head, layout):
            return _list(file, head, lines, layout, keys)
        if layout.width == 4 and not layout.headed and _repeats(head, layout, 1):
            raise InputError(
                f"{source}: four columns without headings, the first of which counts the lines: name them: no,x,y,z"
            )
        if layout.width == 1:
            raise InputError(
                f'{source}: {layout.width} column(s) are a profile along a line, kind = "laser", and no grid; {_LAYOUT}'
            )
        return _matrix(file, head, lines, layout, keys)


def _too_few(rows: list[Line], source: str) -> InputError:
    """The error for a text without two rows of numbers: the first line that is none, or their number."""
    marks = [mark for mark in (";", ",", "\t") if any(mark in line.text for line in rows)]
    form = Form(
        marks[0] if marks else "", marks[:1] == [";"] and not any("." in line.text for line in rows)
    )
    try:
        for line in rows[1:]:
            form.numbers(line.text, line.number, source)
            if len(form.fields(line.text)) != len(form.fields(rows[0].text)):
                here, first = len(form.fields(line.text)), len(form.fields(rows[0].text))
                return InputError(f"{source}, line {line.number}: {here} fields, {first} expected")
    except InputError as error:
        return InputError(f"{error}; {_LAYOUT}")
    return InputError(f"{source}: {len(rows)} lines of data, at least 3 are needed; {_LAYOUT}")


def _data(head: list[Line], lines: Iterator[Line], first: int, source: str) -> Iterator[list[Line]]:
    """Lines of numbers from line `first` on in blocks of bounded size."""
    data = check_late(chain((line for line in head if line.number >= first), lines), source)
    while begin := next(data, None):
        count = max(min(BLOCK, BLOCK_CHARACTERS // (len(begin.text) + 1)), 1)
        yield [begin, *islice(data, count - 1)]


def _repeats(head: list[Line], layout: Layout, counts: int = 0) -> bool:
    """Whether columns are a list of points: one of x and y does not ascend all along.

    `counts`: columns before x; 1: one that counts the lines, and x and y that recur.
    """
    rows = [
        layout.form.row(line.text)
        for line in head
        if line.number >= layout.first and not line.comment
    ]
    table = np.array([row for row in rows if row is not None and len(row) == 3 + counts])
    if len(table) < 4:
        return False
    if counts:
        recur = [len(np.unique(table[:, k])) <= len(table) / 2 for k in (1, 2)]
        return bool((np.diff(table[:, 0]) == 1.0).all() and any(recur))
    return any(bool((np.diff(table[1:, k]) <= 0).any()) for k in (0, 1))


def _list(file: Path, head: list[Line], lines: Iterator[Line], layout: Layout, keys: Keys) -> Found:
    """The grid of a list of points."""
    source = f"road.file {file}"
    at = _headed(layout, source) if layout.headed else [0, 1, 2]
    blocks, count, decimals = [], 0, Decimals()
    for block in _data(head, lines, layout.first, source):
        table = numbers_of(block, layout.form, layout.width, source)
        decimals.count(block, layout.form, table, [at[2]])
        for k in layout.of("other"):
            check_flags(layout.columns[k], table[:, k], source)
        blocks.append(table[:, at])
        count += len(block)
        check_count(file, count)
    decimals.check(source)
    x, y, z = _points(file, np.concatenate(blocks))
    columns = [layout.columns[k] for k in at]
    scales = keys.scales(columns, layout.stated, source)
    x_at, y_at, z_at = (f'column {k + 1} "{layout.columns[k].title}"' for k in at)
    notes = (
        tuple(downwards_note(columns[2].title))
        if layout.headed
        else ("three columns without headings: x, y, height assumed",)
    )
    others = [
        f'column {k + 1} "{column.title}"' for k, column in enumerate(layout.columns) if k not in at
    ]
    if others:
        notes = (*notes, f"not used of the file: {', '.join(others)}")
    return Found(
        x,
        y,
        ArrayRows(z),
        scales,
        Coding(missing=layout.stated.missing),
        (x_at, y_at, z_at),
        _forms(layout, notes),
        odd=tuple(decimals.codes()),
        text=True,
    )


def _headed(layout: Layout, source: str) -> list[int]:
    """The columns of x, y and z by their headings; one of them may be named by what is left over."""
    by_role = {role: layout.of(role) for role in "xyz"}
    for role, columns in by_role.items():
        if not columns and len(layout.of("")) == 1:
            by_role[role] = layout.of("")
    if (
        any(len(columns) != 1 for columns in by_role.values())
        or len({k for column in by_role.values() for k in column}) < 3
    ):
        titles = ", ".join(repr(column.title) for column in layout.columns)
        raise InputError(
            f"{source}: the headings {titles} do not name one column each for x, y and the height: call them x, y, z; x and heights "
            'alone are a profile, kind = "laser"'
        )
    return [by_role[role][0] for role in "xyz"]


def _forms(layout: Layout, notes: tuple[str, ...]) -> tuple[str, ...]:
    return (*notes, "decimal commas") if layout.form.comma else notes


def _matrix(
    file: Path, head: list[Line], lines: Iterator[Line], layout: Layout, keys: Keys
) -> Found:
    """The grid of a matrix: the first line holds y, the first column x."""
    source = f"road.file {file}"
    if odd := next(
        (column for column in layout.columns[1:] if column.unit or column.unclear), None
    ):
        raise InputError(
            f"{source}: {odd.said} states a unit above the columns of a matrix: say road.length_unit and road.height_unit, and take "
            "the line out"
        )
    _check_order(layout, source)
    corner, axis, first, left, places = _across(head, layout, source)
    positions, spool, count, decimals = [], Spool(source), 0, Decimals()
    for block in _data(head, lines, first, source):
        table = numbers_of(block, layout.form, layout.width, source)
        count += len(table)
        check_count(file, count)
        decimals.count(block, layout.form, table, range(left + 1, min(layout.width, left + 65)))
        positions.append(table[:, left])
        if axis.size:
            spool.add(table[:, left + 1 :])
    if count < 2:
        raise InputError(f"{source}: {count + 1} lines of data, at least 3 are needed")
    decimals.check(source)
    x = np.concatenate(positions)
    titles = _corner(corner, keys, layout.stated, source)
    scales = keys.scales(titles, layout.stated, source)
    return Found(
        x,
        axis,
        spool.rows(),
        scales,
        Coding(missing=layout.stated.missing),
        places,
        _forms(layout, ()),
        odd=tuple(decimals.codes()),
        text=True,
    )


def _check_order(layout: Layout, source: str) -> None:
    """InputError for a line above a matrix by which its rows are along y: `first column y`, `columns: x`, `x across`."""
    for line in layout.before:
        if len(layout.form.fields(line.text)) == layout.width:
            continue  # the corner and the y
        for match in _ORDER.finditer(line.text):
            what = (match["what"] or match["where"]).lower()
            several = (
                bool(re.search(r"(?:rows|lines|columns|cols|zeilen|spalten)$", what))
                and "first" not in what
            )
            column = bool(re.search(r"col|spalte|down", what))
            # The first column holds x; columns, one for each y.
            if ((match["axis"] or match["of"]).lower() == "x") != (column != several):
                raise InputError(
                    f"{source}, line {line.number}: by {line.text[:60]!r} the first column is y: it must hold x, the first line y; "
                    "transpose the matrix"
                )


def _across(
    head: list[Line], layout: Layout, source: str
) -> tuple[str, Array, int, int, tuple[str, str, str]]:
    """Corner and y of a matrix's first line, the first line below, and the column of x: 1 behind an index, else 0."""
    form, width = layout.form, layout.width
    above = [line for line in layout.before if len(form.fields(line.text)) == width]
    # Of the lines above the numbers the last that has y in it; else the first of the numbers.
    for line in (
        *reversed(above),
        *(column for column in head if column.number >= layout.first and not column.comment),
    ):
        fields = form.fields(line.text)
        values = [form.number(text) for text in fields]
        for left in (0, 1):
            if width < left + 2 or (left and (values[0] is not None and fields[0] != "")):
                continue
            if None in values[left + 1 :]:
                continue
            if (
                left
                and role_of(column_of(fields[1]).title) != "x"
                and column_of(fields[1]).role != "x"
            ):
                continue
            axis = np.array(values[left + 1 :], float)
            if not np.all(np.diff(axis) > 0) or not np.isfinite(axis).all():
                raise InputError(
                    f"{source}, line {line.number}: the first line must hold a corner that is not read, then the ascending y of "
                    "the columns; each further line one x, then its heights. Is this a plain matrix of heights? Then add the "
                    "x and the y"
                )
            first = layout.first if line.number < layout.first else line.number + 1
            corner = fields[left] if values[left] is None else ""
            places = f"column {left + 1}", f"line {line.number}", "the rest"
            return corner, axis, first, left, places
        if line.number >= layout.first:
            break
    bad = next((text for text in fields[1:] if form.number(text) is None), fields[0])
    raise InputError(f"{source}, line {line.number}: {bad[:40]!r} is not a number; {_LAYOUT}")


def _corner(text: str, keys: Keys, stated: Stated, source: str) -> tuple[Column, Column, Column]:
    """x, y and z by the corner of a matrix: x [mm], x/y [m], ... InputError for a unit of which it does not say whose it is."""
    corner = column_of(text)
    units = [unit for word in re.split(r"[\s/\\,;|()\[\]{}]+", text) if (unit := unit_of(word))]
    if len({unit.metres for unit in units}) > 1 or (corner.unit and corner.unclear):
        raise InputError(
            f'{source}: the corner "{text}" has more than one unit: say road.length_unit and road.height_unit, and leave it empty'
        )
    named = [
        role
        for word in re.findall(r"[^\W\d_]+", text)
        if (role := role_of(word)) in ("x", "y", "time")
    ]
    if named[:1] == ["y"] or _ACROSS.search(text):
        raise InputError(
            f'{source}: by the corner "{text}" the first column is y: it must hold x, the first line y; transpose the matrix, or '
            "write x/y"
        )
    if corner.role == "time" or named[:1] == ["time"]:
        raise InputError(
            f'{source}: by the corner "{text}" the first column is a time: it must hold x'
        )
    bracketed = bool(_BRACKETS.search(text))
    words = re.findall(r"[^\W\d_]+", text)
    odd = [
        word
        for word in words
        if not role_of(word) and not unit_of(word) and not _PLAIN.fullmatch(word)
    ]
    if odd and not bracketed and (keys.length_unit is None or keys.height_unit is None):
        raise InputError(
            f'{source}: the corner "{text}" may hold a unit, and "{odd[0]}" is not known: say road.length_unit and '
            "road.height_unit, or leave the corner empty"
        )
    if (
        corner.unit is None
        and not (bracketed and corner.unclear)
        and not unit_of(text.strip("[](){} "))
    ):
        return Column(), Column(), Column()
    said = f'corner "{text}"'
    unit = corner.unit or unit_of(text.strip("[](){} "))
    heights = Column(unit=unit, unclear=corner.unclear, said=said)
    letters = set(re.findall(r"(?<![a-z])[xyz](?![a-z])", _BRACKETS.sub(" ", text.lower())))
    role = corner.role if corner.role in ("x", "y", "z") else ""
    letters |= {role} if role else set()
    if not letters and (keys.length_unit is None or keys.height_unit is None):
        raise InputError(
            f"{source}: the {said} has a unit, and does not say whose: say road.length_unit and road.height_unit"
        )
    x = heights if "x" in letters else Column()
    y = heights if letters & {"x", "y"} else Column()
    return x, y, heights if "z" in letters else Column()


def _steps(values: Array) -> tuple[Array, NDArray[np.intp]]:
    """Ascending positions, those that differ by rounding alone taken as one, and the index of each value."""
    places, index = np.unique(values, return_inverse=True)
    gaps = np.diff(places)
    if not gaps.size:
        return places, index
    usual = float(np.median(gaps[gaps > 1e-6 * gaps.max()]))
    begins = np.concatenate([[True], gaps > _SAME * usual])
    return places[begins], (np.cumsum(begins) - 1)[index]


def _points(file: Path, table: Array) -> tuple[Array, Array, Array]:
    """The grid of a list of points, which must hold each combination of x and y exactly once."""
    if not np.all(np.isfinite(table[:, :2])):
        raise InputError(f"road.file {file}: x and y must be finite numbers")
    x, i = _steps(table[:, 0])
    y, j = _steps(table[:, 1])
    full = len(x) * len(y) == len(table)
    count = np.zeros((len(x), len(y)) if full else (0, 0), dtype=int)
    if full:
        np.add.at(count, (i, j), 1)
    if not full or not np.all(count == 1):
        raise InputError(
            f"road.file {file}: {len(table)} points do not fill the grid of their {len(x)} x and "
            f"{len(y)} y once each; list every point, nan where the height is missing"
        )
    z = np.empty(count.shape)
    z[i, j] = table[:, 2]
    return x, y, z
