"""Profiles along a line as profilometers, spreadsheets and other programs write them.

One height a line, x and a height, or columns of which the headings name x and the height. Commas,
semicolons, tabs or spaces between them; decimal points or commas; lines of headings and units
before the numbers; UTF-8, UTF-16 or the code page of western Windows; the words of many programs
for a missing value. What is not one of these is refused with the line of the file.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import check_count
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# What programs print instead of a number that they do not have; 1.#QNAN is of older Windows.
MISSING = re.compile(
    r"[+-]?(?:nan(?:\(\w*\))?|n/?a|null|none|missing|void|inf(?:inity)?|\d*[.,]?#(?:q?nan|snan|ind|inf)\w*|\*+|-+|\?+)?",
    re.IGNORECASE,
)
_X = re.compile(
    r"^\W*(x\b|x_|dist|pos|abstand|weg|station|chain|str(?:ecke|eck)|length|longitudinal|absci)",
    re.I,
)
_Z = re.compile(
    r"^\W*(z\b|z_|height|h(?:ö|o|oe|�)he|depth|prof|elev|alt|tief|ordinate|value|wert|y\b)", re.I
)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_FEWEST = 3  # heights
_RUNS, _AT_LEAST = 3, 4  # runs and values of equal heights that make a code for missing ones
_JUMP = 20.0  # usual differences of neighbours: a code lies that far from what is beside it
_SAMPLE = 400  # lines by which separator and decimal mark are found


@dataclass(frozen=True)
class Profile:
    """Heights (n,) in the file's unit, nan where missing; x (n,) in its own, None if it has none.

    `rounding`: half of the last digit of x; `lines` (n,): their numbers in the file; `notes`: what
    was found out.
    """

    heights: Array
    x: Array | None
    rounding: float
    lines: NDArray[np.intp]
    notes: tuple[str, ...]


def read_profile(path: Path, source: str, missing: Sequence[float] = ()) -> Profile:
    """The profile in a text file; values equal to one of `missing` are. InputError where it is none."""
    text = _text(path, source)
    rows = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1)]
    rows = [(n, _bare(line)) for n, line in rows if line and not line.startswith(("#", "%", "//"))]
    form = _form(rows, source)
    begin = _begin(rows, form)
    if begin is None and len(rows) >= _FEWEST and MISSING.fullmatch(form.fields(rows[-1][1])[-1]):
        raise InputError(f"{source}: none of the {len(rows)} heights is a number")
    if begin is None or len(rows) - begin < _FEWEST:
        raise InputError(f"{source}: only {len(rows) - (begin or 0)} heights: too few for a road")
    check_count(path, len(rows))
    numbers = [form.numbers(line, n, source) for n, line in rows[begin:]]
    width = len(numbers[0])
    for (n, line), row in zip(rows[begin:], numbers, strict=True):
        if len(row) == width - 1 and form.separator and line.endswith(form.separator):
            row.append(np.nan)  # nothing behind the separator
        if len(row) != width:
            raise InputError(
                f"{source}, line {n}: {len(row)} values where the lines before have {width}: {line[:60]!r}"
            )
    table = np.array(numbers, float)
    headings = _headings(rows[:begin], form, width)
    x, z, notes = _columns(table, headings, source)
    heights = table[:, z].copy()
    for code in missing:
        heights[np.isclose(heights, code, rtol=1e-9, atol=1e-12)] = np.nan
    lines = np.array([n for n, _ in rows[begin:]])
    codes = _codes(heights)
    if codes:
        shown = ", ".join(f"{code:g}" for code in codes)
        where = int(lines[np.flatnonzero(heights == codes[0])[0]])
        raise InputError(
            f"{source}: heights of exactly {shown} come in runs apart from the heights beside them (first in line {where}): "
            f"if they mean that there is none, say road.missing = [{shown}]; if they are heights, cut them out"
        )
    place, rounding = None, 0.0
    if x is not None:
        rounding = _rounding([form.fields(line)[x] for _, line in rows[begin : begin + _SAMPLE]])
        place, heights, lines, more = _ascending(table[:, x], heights, lines)
        notes += more
    if form.comma:
        notes.append("decimal commas")
    return Profile(heights, place, rounding, lines, tuple(notes))


def _text(path: Path, source: str) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{source}: {error.strerror}") from error
    for mark, name in (
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
        (b"\xef\xbb\xbf", "utf-8-sig"),
    ):
        if data.startswith(mark):
            try:
                return data.decode(name)
            except UnicodeDecodeError as error:
                raise InputError(f"{source}: is not a text file (byte {error.start})") from error
    if b"\0" in data[:4096]:
        raise InputError(f"{source}: is not a text file (byte {data.index(0)})")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        odd = sum(byte < 9 or 13 < byte < 32 for byte in data[:4096])
        if odd > 4:
            raise InputError(f"{source}: is not a text file (byte {error.start})") from error
        return data.decode("cp1252", errors="replace")


def _bare(line: str) -> str:
    """Without a comment at its end; `#` within a word is part of that."""
    return re.sub(r"\s+(?:#|//).*$", "", line)


@dataclass(frozen=True)
class _Form:
    """Separator ("" for white space) and whether the decimal mark is a comma."""

    separator: str
    comma: bool

    def fields(self, line: str) -> list[str]:
        if not self.separator:
            return line.split()
        parts = [part.strip().strip('"') for part in line.split(self.separator)]
        while len(parts) > 1 and not parts[-1]:  # a separator at the end of the line
            parts.pop()
        return parts

    def number(self, field: str) -> float | None:
        """The number; nan for a word that means it is missing, None for another word."""
        plain = field.replace(",", ".") if self.comma else field
        if _NUMBER.fullmatch(plain):
            return float(plain.replace("d", "e").replace("D", "e"))
        return np.nan if MISSING.fullmatch(field) else None

    def numbers(self, line: str, n: int, source: str) -> list[float]:
        found = []
        for field in self.fields(line):
            value = self.number(field)
            if value is None:
                raise InputError(
                    f"{source}, line {n}: {field[:40]!r} is not a number: {line[:60]!r}"
                )
            found.append(value)
        return found


def _form(rows: list[tuple[int, str]], source: str) -> _Form:
    """The form by which most of the later lines are rows of numbers."""
    sample = [line for _, line in rows[len(rows) // 2 : len(rows) // 2 + _SAMPLE]] or [
        line for _, line in rows
    ]
    sample = [
        line for line in sample if re.search(r"\d", line) and not MISSING.fullmatch(line)
    ] or sample
    commas = [line.count(",") for line in sample]
    for separator in (";", "\t"):
        if sum(separator in line for line in sample) > len(sample) / 2:
            return _Form(separator, max(commas) > 0 and not any("." in line for line in sample))
    if max(commas, default=0) == 0:
        return _Form("", False)
    if any(
        " " in line.strip() and "," in line and "," not in re.sub(r"\d,\d", "", line)
        for line in sample
    ) and not any("." in line for line in sample):
        return _Form("", True)  # numbers with decimal commas between spaces
    if set(commas) == {1} and not any("." in line for line in sample):
        tails = [line.split(",")[1].strip() for line in sample]
        if (
            all(tail.isdigit() for tail in tails)
            and len({len(tail) for tail in tails}) == 1
            and len(tails[0]) > 1
        ):
            if any(tail.startswith("0") for tail in tails):
                return _Form("", True)  # one column: 3,015 and 3,004
            raise InputError(
                f"{source}: {sample[0][:40]!r} can be one number with a decimal comma or two: separate columns by semicolons"
            )
    return _Form(",", False)


def _begin(rows: list[tuple[int, str]], form: _Form) -> int | None:
    """Index of the first of the rows of numbers that the file ends with, or of its first such row."""
    for k in range(len(rows)):
        ahead = rows[k : k + _FEWEST]
        values = [[form.number(field) for field in form.fields(line)] for _, line in ahead]
        if (
            all(None not in row for row in values)
            and len({len(row) for row in values}) == 1
            and any(value == value for value in values[0])
        ):
            return k
    return None


def _headings(rows: list[tuple[int, str]], form: _Form, width: int) -> list[str]:
    """The words over the columns: the last line before the numbers with one for each that names x or z."""
    for _, line in reversed(rows):
        fields = form.fields(line)
        if len(fields) == width and any(_X.match(f) or _Z.match(f) for f in fields):
            return fields
    return []


def _columns(table: Array, headings: list[str], source: str) -> tuple[int | None, int, list[str]]:
    """The columns of x and of the heights."""
    width = table.shape[1]
    if width == 1:
        return None, 0, []
    if width == 2:
        return 0, 1, []
    x = [k for k, name in enumerate(headings) if _X.match(name)]
    z = [k for k, name in enumerate(headings) if _Z.match(name) and k not in x]
    if len(x) == 1 and len(z) == 1:
        return x[0], z[0], [f"x is the column {headings[x[0]]!r}, the height {headings[z[0]]!r}"]
    if (
        width == 3
        and not headings
        and np.array_equal(np.diff(table[:, 0]), np.ones(len(table) - 1))
    ):
        return 1, 2, ["the first column counts the lines"]
    raise InputError(
        f"{source}: {table.shape[0]} lines of {width} numbers; a measured line has one height a line, or x and a "
        "height, or headings that name one column each for the distance and the height"
    )


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


def _codes(heights: Array) -> list[float]:
    """Values that come in runs far from the heights beside them: no heights."""
    known = np.isfinite(heights)
    z = heights[known]
    if len(z) < 20:
        return []
    usual = float(np.median(np.abs(np.diff(z)))) or float(np.std(z)) * 1e-3
    # Heights of a profile in steps repeat all along: only those that are left by a jump are looked at.
    jumps = np.flatnonzero(np.abs(np.diff(z)) > _JUMP * usual)
    found = []
    for one in np.unique(np.concatenate([z[jumps], z[jumps + 1]])):
        at = np.concatenate([[False], z == one, [False]])
        if at.sum() < _AT_LEAST:
            continue
        change = np.diff(at.astype(int))
        begin, end = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
        long = end - begin > 1
        beside = np.concatenate([z[begin[begin > 0] - 1], z[end[end < len(z)]]])
        apart = float(np.median(np.abs(beside - one))) if len(beside) else 0.0
        alone = abs(one) >= 99 and apart > 1e3 * usual
        if apart > _JUMP * usual and (long.sum() >= _RUNS or alone):
            found.append(float(one))
    return found


# m: standard deviation of the relief of roads within a short piece; less than FLAT is an even plate.
FLAT, SMOOTHEST, ROUGHEST = 1e-8, 3e-6, 0.02
_WITHIN = 64  # pieces of a profile that are looked at


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
