"""Profiles along a line as profilometers, spreadsheets and other programs write them.

One height a line, x and a height, or columns of which the headings name x and the height; in any
encoding and form that `contact.roads.meaning` reads. What is not one of these is refused with the
line of the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import check_count
from tireroad.contact.roads.meaning import (
    Column,
    Layout,
    ReadAs,
    Scale,
    check_flags,
    check_late,
    downwards_note,
    layout_of,
    scale_of,
)
from tireroad.contact.roads.missing import codes, refused
from tireroad.contact.roads.text_table import (
    MISSING,
    NUMBER,
    Decimals,
    Line,
    head_of,
    lines_of,
    numbers_of,
    opened,
)
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

_FEWEST = 3  # heights
_BLOCK = 65536  # lines read at a time
_MOST_COLUMNS = 8
_SAME = 0.02  # of a distance between heights that is stated twice
_SAMPLE = 400  # lines that tell how x is rounded
HEIGHTS, LENGTHS = "mm", "mm"  # assumed where neither file nor scene says

# m: standard deviation of the relief of roads within a short piece; less than FLAT is an even plate.
FLAT, SMOOTHEST, ROUGHEST = 1e-8, 3e-6, 0.02
_WITHIN = 64  # pieces of a profile that are looked at


@dataclass(frozen=True)
class Profile:
    """Heights (n,) m, nan where missing; x (n,) m, None if the file has none.

    `rounding` m: half of the last digit of x; `pitch` m: the distance between heights that the file states; `lines` (n,):
    their numbers in the file; `notes`: what was found out; `readings`: which column was read as what; `assumed`,
    `x_assumed`: whether the unit of heights, of x was.
    """

    heights: Array
    x: Array | None
    rounding: float
    pitch: float | None
    lines: NDArray[np.intp]
    notes: tuple[str, ...]
    readings: tuple[ReadAs, ...]
    assumed: bool
    x_assumed: bool


@dataclass(frozen=True)
class ProfileKeys:
    """Keys of a scene that describe the file: units, values that mean "no height" (None: to be looked for), distance of heights m."""

    length_unit: str | None = None
    height_unit: str | None = None
    missing: Sequence[float] | None = None
    pitch: float | None = None


def read_profile(path: Path, source: str, keys: ProfileKeys = ProfileKeys()) -> Profile:
    """The profile in a text file. InputError where it is none, and where its meaning is not certain."""
    with opened(path, source) as stream:
        lines = lines_of(stream, source)
        head = head_of(lines)
        rows = [line for line in head if not line.comment]
        layout = layout_of(head, source, _FEWEST)
        if layout is None:
            last = re.split(r"[;,\t ]", rows[-1].text)[-1] if rows else "-"
            if len(rows) >= _FEWEST and MISSING.fullmatch(last):
                count = len(rows) + sum(1 for _ in lines)
                raise InputError(f"{source}: none of the {count} heights is a number")
            raise InputError(f"{source}: {_no_rows(rows)}")
        data = check_late(
            chain((line for line in head if line.number >= layout.first), lines),
            source,
            alone=layout.width == 1,
        )
        table, numbers, decimals = _table(path, data, layout, source)
    if len(table) < _FEWEST:
        raise InputError(f"{source}: only {len(table)} heights: too few for a road")
    return _profile(table, numbers, decimals, layout, rows, keys, source)


def _no_rows(rows: Sequence[Line]) -> str:
    """Why a text has no rows of numbers: its last line with a word that is none."""
    few = f"no {_FEWEST} rows of numbers: too few heights for a road"
    if len(rows) < _FEWEST:
        return few
    line = rows[-1]
    odd = next(
        (text for text in re.split(r"[;,\t|]", line.text) if not NUMBER.fullmatch(text.strip())),
        line.text,
    )
    return (
        f"{few}; line {line.number} is {line.text[:40]!r}, where {odd.strip()[:20]!r} is no number"
    )


def _table(
    path: Path, data: Iterator[Line], layout: Layout, source: str
) -> tuple[Array, NDArray[np.intp], list[Decimals]]:
    """All rows, their lines, and of each column how its numbers are written."""
    blocks: list[Array] = []
    decimals = [Decimals() for _ in range(layout.width)]
    numbers: list[int] = []
    while some := list(islice(data, _BLOCK)):
        blocks.append(numbers_of(some, layout.form, layout.width, source))
        for k, count in enumerate(decimals[:_MOST_COLUMNS]):
            count.count(some, layout.form, blocks[-1], [k])
        numbers += [line.number for line in some]
        check_count(path, len(numbers))
    if not blocks:
        return np.empty((0, layout.width)), np.empty(0, dtype=int), []
    return np.concatenate(blocks), np.array(numbers), decimals


def _profile(
    table: Array,
    numbers: NDArray[np.intp],
    decimals: list[Decimals],
    layout: Layout,
    rows: list[Line],
    keys: ProfileKeys,
    source: str,
) -> Profile:
    """Columns, units and missing heights of a table."""
    at, z, notes = _columns(table, layout, keys, source)
    for k in layout.of("other"):
        check_flags(layout.columns[k], table[:, k], source)
    decimals[z].check(source)
    notes += downwards_note(layout.columns[z].title)
    stated = layout.stated
    height = scale_of("z", layout.columns[z], stated, ("height_unit", keys.height_unit), source)
    length = None
    if at is not None:
        length = scale_of(
            "x", layout.columns[at], stated, ("length_unit", keys.length_unit), source
        )
        height, length = _together(height, length, source)
    up = height or Scale(1e-3, f"{HEIGHTS}: assumed", assumed=True)
    heights = table[:, z].copy()
    declared = (*(keys.missing or ()), *stated.missing)
    gone = np.zeros(len(heights), dtype=bool)
    for code in declared:
        gone |= np.isclose(heights, code, rtol=1e-9, atol=1e-12)
    heights[gone] = np.nan
    if keys.missing is None or len(keys.missing):
        missing_codes = codes(heights[None, :], up.metres)
        missing_codes += [
            code
            for code in decimals[z].codes()
            if code not in missing_codes and (heights == code).any()
        ]
        if missing_codes:
            same = np.isin(heights, missing_codes)
            where = f"in line {numbers[np.flatnonzero(same)[0]]}"
            raise refused(missing_codes, int(same.sum()), where, source)
    named = f"{int(np.isnan(heights).sum())} missing" + (
        f", of these {int(gone.sum())} as {', '.join(f'{code:g}' for code in declared)}"
        if declared
        else ""
    )
    readings = [ReadAs("height", _place(layout, z), up.text, named)]
    x, rounding, unsaid_x = None, 0.0, False
    if at is not None:
        along = length or Scale(1e-3, f"{LENGTHS}: assumed", assumed=True)
        unsaid_x = along.assumed
        written = [layout.form.fields(line.text) for line in rows if line.number >= layout.first]
        rounding = _rounding([row[at] for row in written[:_SAMPLE] if at < len(row)])
        place, heights, numbers, more = _ascending(table[:, at], heights, numbers)
        notes += more
        x, rounding = along.metres * place, along.metres * rounding
        step = (place[-1] - place[0]) / max(len(place) - 1, 1)
        if keys.pitch and abs(along.metres * step / keys.pitch - 1) > _SAME:
            raise InputError(
                f"{source}: heights are every {1e3 * along.metres * step:.4g} mm by {_place(layout, at)}, in {along.text}, and "
                f"road.pitch = {keys.pitch:g} m: take the key out, or say road.length_unit"
            )
        readings.append(
            ReadAs("x", _place(layout, at), along.text, f"every {step:.4g} of the file")
        )
        if along.assumed or up.assumed:
            unsaid = [f"x every {1e3 * along.metres * step:.4g} mm"] if along.assumed else []
            unsaid += [f"heights in {HEIGHTS}"] if up.assumed else []
            notes.append(f"{', '.join(unsaid)}: assumed")
    elif up.assumed:
        notes.append(f"heights in {HEIGHTS}: assumed")
    if others := [_place(layout, k) for k in range(layout.width) if k not in (at, z)]:
        notes.append(f"not used of the file: {', '.join(others)}")
    pitch = _stated_pitch(layout, keys, at, source)
    if layout.form.comma:
        notes.append("decimal commas")
    return Profile(
        up.metres * heights,
        x,
        rounding,
        pitch,
        numbers,
        tuple(notes),
        tuple(readings),
        up.assumed,
        unsaid_x,
    )


def _together(
    height: Scale | None, length: Scale | None, source: str
) -> tuple[Scale | None, Scale | None]:
    """Both scales. InputError where the file states that of one alone: a default beside it would be a guess."""
    for mine, other, name, key in (
        (height, length, "the heights", "height_unit"),
        (length, height, "x", "length_unit"),
    ):
        if mine is None and other is not None and other.stated:
            raise InputError(
                f"{source}: a unit stands beside one column, {other.text}, and not beside {name}: say road.{key}"
            )
    return height, length


def _place(layout: Layout, k: int) -> str:
    title = layout.columns[k].title
    return f'column {k + 1} "{title}"' if title else f"column {k + 1}"


def _stated_pitch(layout: Layout, keys: ProfileKeys, x: int | None, source: str) -> float | None:
    """The distance of heights (m) that the file states, where it has no x. InputError where the scene says another."""
    stated = layout.stated
    if x is not None or keys.pitch is not None and stated.pitch is None:
        return None
    if stated.pitch is not None:
        pitch, where = stated.pitch
        if keys.pitch is not None and abs(keys.pitch / pitch - 1) > 1e-6:
            raise InputError(
                f"{source}: heights are every {1e3 * pitch:.6g} mm by {where}, and road.pitch = {keys.pitch:g} m: take the "
                "key out, or correct the file"
            )
        return pitch
    if stated.unclear_pitch:
        raise InputError(
            f"{source}, {stated.unclear_pitch} may state the distance between heights, without a unit that is known: say "
            "road.pitch (m)"
        )
    return None


def _is_count(values: Array) -> bool:
    """Whether a column counts its lines: 0, 1, 2, … or 1, 2, 3, …"""
    return _consecutive(values) and values[0] in (0.0, 1.0)


def _consecutive(values: Array) -> bool:
    """Whether a column has consecutive whole numbers."""
    return bool(
        len(values) > 1
        and values[0] == round(values[0])
        and np.array_equal(np.diff(values), np.ones(len(values) - 1))
    )


def _columns(
    table: Array, layout: Layout, keys: ProfileKeys, source: str
) -> tuple[int | None, int, list[str]]:
    """The columns of x (None where there is none) and of the heights."""
    width, columns = layout.width, layout.columns
    if layout.headed:
        return _by_headings(table, layout, keys, source)
    if width == 1:
        return None, 0, []
    if width == 3 and _is_count(table[:, 0]):
        return _ordered(table, columns, (1, 2), ["the first column counts the lines"])
    unsaid = not keys.length_unit and not layout.stated.units
    if width == 2 and keys.pitch and unsaid and _consecutive(table[:, 0]):
        return None, 1, ["the first column counts the heights"]
    if width == 2:
        return _ordered(table, columns, (0, 1), [])
    raise _many(table, "", source)


def _ordered(
    table: Array, columns: Sequence[Column], pair: tuple[int, int], notes: list[str]
) -> tuple[int, int, list[str]]:
    """x and height of two columns without headings: x is the one that goes on in even steps."""
    a, b = pair
    if not _even(table[:, a]) and _even(table[:, b]):
        return b, a, [*notes, f"x is taken to be column {b + 1}, which goes on in even steps"]
    return a, b, notes


def _even(values: Array) -> bool:
    steps = np.diff(values)
    return bool(
        np.isfinite(steps).all()
        and steps.size
        and (steps > 0).all()
        and np.ptp(steps) < 0.5 * abs(steps.mean())
    )


def _many(table: Array, titles: str, source: str) -> InputError:
    return InputError(
        f"{source}: {table.shape[0]} lines of {table.shape[1]} numbers{titles}; a measured line has one height a line, or x and "
        "a height, or headings that name one column each for the distance and the height"
    )


def _by_headings(
    table: Array, layout: Layout, keys: ProfileKeys, source: str
) -> tuple[int | None, int, list[str]]:
    """x and heights by the headings; one of two columns may be named by what is left over."""
    width, columns = layout.width, layout.columns
    titles = ", ".join(repr(column.title) for column in columns)
    x, z, y = layout.of("x"), layout.of("z"), layout.of("y")
    if not z and len(y) == 1:
        z, y = y, []  # a plot of y over x
    counts = [k for k in layout.of("count") if _consecutive(table[:, k])]
    unknown = [k for k in range(width) if columns[k].role == ""]
    if z and not x and width == 2:  # whatever it is called, it counts
        counts += [k for k in unknown if _consecutive(table[:, k]) and columns[k].unit is None]
        unknown = [k for k in unknown if k not in counts]
    if width == 1:
        if columns[0].role in ("x", "time", "other"):
            raise InputError(f"{source}: the only column is {titles}: no heights")
        return None, 0, []
    if len(x) == 1 and not z and len(unknown) == 1:
        z = unknown
    elif len(z) == 1 and not x and len(unknown) == 1 and not counts and not layout.of("time"):
        x = unknown
    if len(x) == 1 and len(z) == 1:
        return (
            x[0],
            z[0],
            [f"x is the column {columns[x[0]].title!r}, the height {columns[z[0]].title!r}"],
        )
    times = layout.of("time")
    if not x and times:
        raise InputError(
            f"{source}: {columns[times[0]].title!r} is a time, and no column holds the distance: a road has heights over x; "
            "multiply the time by the speed"
        )
    if not x and len(z or unknown) == 1 and counts and width == 2:
        one = (z or unknown)[0]
        if keys.pitch is None and layout.stated.pitch is None:
            raise InputError(
                f"{source}: {columns[counts[0]].title!r} counts the heights, and nothing says how far apart they are: say "
                "road.pitch (m)"
            )
        return None, one, [f"{columns[counts[0]].title!r} counts the heights"]
    raise _many(table, f" under {titles}", source)


def _rounding(fields: list[str]) -> float:
    """Half of the last digit that x is written with."""
    digits = [
        len(re.split(r"[.,]", field)[1]) if re.search(r"[.,]", field) else 0
        for field in fields
        if "e" not in field.lower()
    ]
    return 0.5 * 10.0 ** -max(digits) if digits else 0.0


def _ascending(
    x: Array, z: Array, lines: NDArray[np.intp]
) -> tuple[Array, Array, NDArray[np.intp], list[str]]:
    """The profile from its lower end on; lines written twice are taken once."""
    notes = []
    if len(x) > 1 and x[-1] < x[0]:
        x, z, lines = x[::-1], z[::-1], lines[::-1]
        notes.append("x descends in the file: read from its end")
    same = (np.diff(x) == 0) & ((np.diff(z) == 0) | np.isnan(z[1:]) & np.isnan(z[:-1]))
    evenly = np.median(np.diff(x)) if len(x) > 1 else 1.0
    # Where x is rounded, places repeat that are none of the same line.
    if same.any() and evenly > 0 and same.sum() == (np.diff(x) == 0).sum():
        keep = np.concatenate([[True], ~same])
        x, z, lines = x[keep], z[keep], lines[keep]
        notes.append(f"{int(same.sum())} lines are there twice: taken once")
    return x, z, lines, notes


def check_relief(profile: Array, unit: str, source: str) -> None:
    """InputError where heights (n,) m, read in a `unit` that nobody gave, cannot be a road's."""
    pieces = np.array_split(profile, min(_WITHIN, max(len(profile) // 16, 1)))
    place = [np.arange(len(piece)) for piece in pieces]
    relief = []
    for x, z in zip(place, pieces, strict=True):
        known = np.isfinite(z)
        if known.sum() > 4:
            relief.append(
                float(np.std(z[known] - np.polyval(np.polyfit(x[known], z[known], 1), x[known])))
            )
    typical = float(np.median(relief)) if relief else 0.0
    if not FLAT < typical < SMOOTHEST and typical < ROUGHEST:
        return
    other = '"m"' if typical < SMOOTHEST else '"um"'
    raise InputError(
        f"{source}: heights were read as {unit}, and vary by {typical:.2g} m within short pieces, which no road does: "
        f'say in [road] what they are in, height_unit = {other}; if they really are in {unit} say height_unit = "{unit}"'
    )
