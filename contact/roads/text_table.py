"""Tables of numbers in text: encoding, lines, separator, decimal mark, and the numbers themselves.

The form of a table is the one by which most of its lines are rows of numbers of one width.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TextIO

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.missing import special
from tireroad.fem.errors import InputError

# What programs print instead of a number that they do not have; 1.#QNAN is of older Windows.
MISSING = re.compile(
    r"[+-]?(?:nan(?:\(\w*\))?|n/?a|<na>|null|none|missing|void|inf(?:inity)?|\d*[.,]?#(?:q?nan|snan|ind|inf)\w*"
    r"|#(?:n/?a|nv|(?:num|wert|value|ref|bezug|div/0|name|null|zahl)[!?])|\*+|-+|\?+)?",
    re.IGNORECASE,
)
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")

COMMENTS = ("#", "%", "//", "!")
HEAD_LINES, HEAD_CHARACTERS = 2000, 4_000_000
_SAMPLE = 400  # lines by which the form is found
_TYPED = {ord("\x1a"): None, ord("\ufeff"): None, ord("−"): "-", 0xA0: " ", 0x202F: " "}
MAX_LINE = 16_000_000  # characters of a line: about a million heights across the road
_COUNTED = 64  # lines of a block: where trailing zeros are dropped, one in ten has fewer decimals
_INTEGER_OR_FIXED = re.compile(r"[+-]?\d*(?:[.,](\d*))?$")


@dataclass(frozen=True)
class Form:
    """Separator of fields ("" for white space), and whether the decimal mark is a comma."""

    separator: str
    comma: bool

    def fields(self, line: str) -> list[str]:
        """The fields of a line; quotation marks around them are left out."""
        if not self.separator:
            return [part.strip('"') for part in line.split()]
        if '"' in line:
            parts = [part.strip() for part in quoted(line, self.separator)]
        else:
            parts = [part.strip() for part in line.split(self.separator)]
        while len(parts) > 1 and not parts[-1]:  # a separator at the end of the line
            parts.pop()
        return parts

    def number(self, text: str) -> float | None:
        """The number; nan for a word that means it is missing, None for another word."""
        plain = text
        if self.comma:
            if "." in text and not MISSING.fullmatch(text):
                return None
            plain = text.replace(",", ".")
        if NUMBER.fullmatch(plain):
            return float(plain.replace("d", "e").replace("D", "e"))
        return np.nan if MISSING.fullmatch(text) else None

    def numbers(self, line: str, n: int, source: str) -> list[float]:
        """The numbers of line n. InputError for a field that is none."""
        numbers = []
        for text in self.fields(line):
            value = self.number(text)
            if value is None:
                raise InputError(
                    f"{source}, line {n}: {text[:40]!r} is not a number: {line[:60]!r}"
                )
            numbers.append(value)
        return numbers

    def row(self, line: str) -> list[float] | None:
        """The numbers of a line, None where one field is none."""
        numbers = [self.number(text) for text in self.fields(line)]
        return None if None in numbers else numbers  # type: ignore[return-value]


_FORMS = (
    Form(";", False), Form(";", True), Form("\t", False), Form("\t", True), Form("|", False), Form("|", True),
    Form(",", False), Form(",", True), Form("", False), Form("", True),
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """A line of a file: its number, its text, and whether it is a comment (without its mark then)."""

    number: int
    text: str
    comment: bool


def opened(path: Path, source: str) -> TextIO:
    """A text file in the encoding that it is in: UTF-8, UTF-16, UTF-32, else western Windows. InputError for no text."""
    try:
        with path.open("rb") as file:
            head = file.read(4096)
            name = _encoding(head, source)
            file.seek(0)
            if name == "utf-8":
                name = _utf8(file, head, source)
        return path.open(
            encoding=name, errors="replace" if name == "cp1252" else "strict", newline=None
        )
    except OSError as error:
        raise InputError(f"{source}: {error.strerror}") from error


def _encoding(head: bytes, source: str) -> str:
    for mark, name in (
        (codecs.BOM_UTF32_LE, "utf-32"),
        (codecs.BOM_UTF32_BE, "utf-32"),
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
        (codecs.BOM_UTF8, "utf-8-sig"),
    ):
        if head.startswith(mark):
            return name
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        half = len(head) / 2
        if odd > 0.9 * half and not even:
            return "utf-16-le"
        if even > 0.9 * half and not odd:
            return "utf-16-be"
        raise InputError(f"{source}: is not a text file (byte {head.index(0)})")
    return "utf-8"


def _utf8(file: IO[bytes], head: bytes, source: str) -> str:
    """utf-8 if all of the file is, else the code page of western Windows."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    done = 0
    while piece := file.read(1 << 24):
        try:
            decoder.decode(piece)
        except UnicodeDecodeError as error:
            if sum(byte < 9 or 13 < byte < 26 or 26 < byte < 32 for byte in head) > 4:
                raise InputError(
                    f"{source}: is not a text file (byte {done + error.start})"
                ) from error
            return "cp1252"
        done += len(piece)
    return "utf-8"


def lines_of(stream: TextIO, source: str) -> Iterator[Line]:
    """Lines that are not empty. InputError for one longer than MAX_LINE, and for what is no text."""
    number = 0
    try:
        while line := stream.readline(MAX_LINE + 1):
            number += 1
            if len(line) > MAX_LINE:
                raise InputError(
                    f"{source}, line {number}: longer than {MAX_LINE:,} characters; write a line "
                    "for each x, or a list of points with the first line x,y,z"
                )
            text = line.translate(_TYPED).strip(" \r\n\f\v")
            mark = next((mark for mark in COMMENTS if text.lstrip().startswith(mark)), None)
            # "#" alone over a column is a heading: #;x;z; #N/A is no height.
            if mark == "#" and (
                re.match(r"#\s*[;\t,]", text) or MISSING.fullmatch(re.split(r"[;,\t ]", text)[0])
            ):
                mark = None
            if mark:
                yield Line(number, text.lstrip().lstrip("#%/!").strip(), True)
            elif text.strip():
                yield Line(number, _bare(text), False)
    except UnicodeError as error:
        start = getattr(error, "start", 0)
        raise InputError(f"{source}: is not a text file (byte {start})") from error


def _bare(line: str) -> str:
    """Numbers without a comment at their end; in a heading (Sample #, z) `#` is part of it."""
    if "#" not in line and "//" not in line:
        return line
    return re.sub(r"^([^A-Za-z]*(?:\d|nan)[^#/]*?)\s+(?:#|//).*$", r"\1", line, flags=re.IGNORECASE)


def quoted(text: str, separator: str) -> list[str]:
    return next(csv.reader([text], delimiter=separator, skipinitialspace=True), [])


def head_of(lines: Iterator[Line]) -> list[Line]:
    """The first lines, by which the layout is found."""
    head: list[Line] = []
    size = 0
    for line in lines:
        head.append(line)
        size += len(line.text)
        if len(head) >= HEAD_LINES or (size > HEAD_CHARACTERS and len(head) > 8):
            break
    return head


def form_of(rows: Sequence[Line], head: Sequence[Line], source: str) -> Form:
    """The form by which most of the later lines are rows of numbers of one width."""
    sample = [line.text for line in rows[len(rows) // 2 :][:_SAMPLE]]
    sample = [line for line in sample if re.search(r"\d", line)] or sample
    forms: list[tuple[float, int, Form]] = []
    for form in _FORMS:
        if form.separator and not any(form.separator in line for line in sample):
            continue
        if form == Form(",", True) and not any('"' in line for line in sample):
            continue
        read = [row for line in sample if (row := form.row(line)) is not None]
        if not read:
            continue
        widths = [len(row) for row in read]
        usual = max(set(widths), key=widths.count)
        forms.append((widths.count(usual) / len(sample), usual, form))
    if not forms:
        return Form("," if any("," in line for line in sample) else "", False)
    best = max(share for share, *_ in forms)
    good = [(width, form) for share, width, form in forms if share > 0.95 * best]
    width, form = good[0]
    alone = next((form for count, form in good if form == Form("", True) and count == 1), None)
    if form == Form(",", False) and width == 2 and alone is not None:
        return _one_or_two(sample, head, form, alone, source)
    return form


def _one_or_two(sample: list[str], head: Sequence[Line], two: Form, one: Form, source: str) -> Form:
    """Whether 3,015 is one number with a decimal comma or two numbers. InputError where nothing tells."""
    pairs = [line.split(",") for line in sample]
    tails = [pair[1].strip() if len(pair) > 1 else "" for pair in pairs]
    if any(not tail.isdigit() for tail in tails if tail):
        return two
    for line in head:  # headings decide
        if re.search(r"[a-z]", line.text, re.I) and not line.comment:
            return two if len(two.fields(line.text)) == 2 else one
    if any(len(tail) > 1 and tail.startswith("0") for tail in tails):
        return one
    raise InputError(
        f"{source}: {sample[0][:40]!r} can be one number with a decimal comma or two: separate columns by semicolons, "
        "or name them in a first line (z, or x,z)"
    )


def first_row(rows: Sequence[Line], form: Form, fewest: int) -> int | None:
    """Index of the first of `fewest` rows of numbers, all of one width."""
    for k in range(len(rows) - fewest + 1):
        values = [form.row(line.text) for line in rows[k : k + fewest]]
        if (
            all(row is not None for row in values)
            and len({len(row) for row in values if row is not None}) == 1
            and any(value == value for row in values if row is not None for value in row)
            and any(value == value for value in values[0] or ())
        ):
            return k
    return None


def numbers_of(lines: Sequence[Line], form: Form, width: int, source: str) -> NDArray[np.float64]:
    """(lines, width) numbers of rows, nan where a word says that one is missing.

    A last field may be absent where the separator stands before it. InputError names the line of a field that is no
    number, and of a row with another number of fields.
    """
    texts = [line.text for line in lines]
    plain = form.separator and not form.comma and not any('"' in text for text in texts)
    if plain and all(text.count(form.separator) == width - 1 for text in texts):
        try:
            table = np.loadtxt(texts, delimiter=form.separator, comments=None, ndmin=2, dtype=float)
        except ValueError:
            pass  # again, slowly, for words that mean nan and the place of an error
        else:
            if table.shape == (len(lines), width) and not np.isinf(table).any():
                return table
    table = np.full((len(lines), width), np.nan)
    for k, line in enumerate(lines):
        row = form.numbers(line.text, line.number, source)
        short = len(row) == width - 1 and form.separator and line.text.endswith(form.separator)
        if len(row) != width and not short:
            raise InputError(
                f"{source}, line {line.number}: {len(row)} values where the lines before have {width}: {line.text[:60]!r}"
            )
        table[k, : len(row)] = row
    return table


@dataclass
class Decimals:
    """How many decimals the heights of a text have, and special numbers that are written with another number of them.

    Programs write heights with a fixed number of decimals; a code put in afterwards has its own: 0 among 0.0125.
    """

    usual: dict[int, int] = field(default_factory=dict)
    sizes: dict[int, list[float]] = field(default_factory=dict)  # smallest and largest magnitude
    odd: dict[float, dict[int, int]] = field(default_factory=dict)

    def count(
        self, lines: Sequence[Line], form: Form, table: NDArray[np.float64], columns: Sequence[int]
    ) -> None:
        """Count in a block of rows `table` (lines, width), of its columns that hold heights."""
        few = range(0, len(lines), -(-len(lines) // _COUNTED))
        z = table[:, list(columns)]
        marked = special(z)
        rows = np.flatnonzero(marked.any(axis=1))
        for row in {*few, *(int(row) for row in rows[:400])}:
            fields = form.fields(lines[row].text)
            for k in columns:
                match = _INTEGER_OR_FIXED.match(fields[k].strip()) if k < len(fields) else None
                value = float(table[row, k])
                if match is None or value != value:
                    continue
                digits = len(match[1] or "")
                if special(table[row, k]):
                    of = self.odd.setdefault(value, {})
                    of[digits] = of.get(digits, 0) + 1
                elif row in few:
                    self.usual[digits] = self.usual.get(digits, 0) + 1
                    least, most = self.sizes.get(digits, (np.inf, 0.0))
                    self.sizes[digits] = [min(least, abs(value)), max(most, abs(value))]

    def check(self, source: str) -> None:
        """InputError where heights are whole numbers below 1000 or have three decimals: 5.003 may mean 5003."""
        if set(self.usual) == {0, 3} and min(self.usual.values()) > 2:
            whole, parted = self.sizes[0], self.sizes[3]
            if 100 <= whole[1] < 1000 and 1 <= parted[0] <= parted[1] < 0.2 * whole[1]:
                raise InputError(
                    f"{source}: heights are whole numbers up to {whole[1]:g} and numbers with three decimals from {parted[0]:.3f} "
                    "on: do points or commas part thousands? Write the numbers without them"
                )

    def codes(self) -> list[float]:
        """Special numbers that are written with other decimals than the heights, which have all the same."""
        if len(self.usual) != 1 or sum(self.usual.values()) < 12:
            return []
        (digits,) = self.usual
        return sorted(
            value + 0.0
            for value, of in self.odd.items()
            if sum(of.values()) - of.get(digits, 0) > 1
        )
