"""An Abaqus deck as a stream of keyword lines and the data blocks between them.

Files are read in pieces, so unused parts take no memory. Included files are read in place and must
lie in the deck's folder or below it. Nothing in a deck is executed.
"""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tireroad.fem.errors import InputError

PIECE = 1 << 22  # bytes read at once, and the longest line
LARGEST = 1 << 30  # bytes of a deck with all included files
_KEYWORDS = 200_000
_INCLUDES = 1000
_COMMENT = re.compile(rb"^[ \t]*\*\*[^\n]*", re.MULTILINE)
_KEYWORD = re.compile(rb"^[ \t]*\*(?:[^\n]*,[ \t]*\n)*[^\n]*", re.MULTILINE)
_SPLIT = re.compile(r'(?:^|,)((?:[^,"]|"[^"]*"?)*)')

# Fortran writes 1.0D-3; commas and tabs are separators only.
_CLEAN = bytes.maketrans(b",\tDd", b"  ee")
_EMPTY_FIELD = re.compile(rb",[ \t]*(?=,)|,[ \t]*$", re.MULTILINE)
LABEL = 10**9  # the largest label of a node or element
LABELS = "whole numbers up to 1,000,000,000 are read, as Abaqus allows: renumber the mesh"
_TRIANGLE = ((0, 1), (1, 2), (2, 0))
_QUAD = ((0, 1), (1, 2), (2, 3), (3, 0))
_WEDGE = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_HEXAHEDRON = (
    (0, 1, 2, 3),
    (4, 7, 6, 5),
    (0, 4, 5, 1),
    (1, 5, 6, 2),
    (2, 6, 7, 3),
    (3, 7, 4, 0),
)

# H hybrid, R reduced, I incompatible modes, T coupled temperature, M modified: the program has its
# own integration rules and ignores these.
_FAMILIES = (
    (re.compile(r"(?:CGAX|CAX)([3468])[RHIMT]*"), "solid", 2),
    (re.compile(r"C3D(4|6|8|10|15|20|27)[RHIMST]*"), "solid", 3),
    (re.compile(r"(?:SFMGAX|SFMAX|MGAX|MAX)([12])[RHT]*"), "membrane", 2),
    (re.compile(r"(?:SFM3D|M3D)([34689])[R]*"), "membrane", 3),
    (re.compile(r"SAX([12])T?"), "shell", 2),
    (re.compile(r"S([34689])R?[5ST]?W?"), "shell", 3),
)
ALL_FACES = -1  # in a surface, of a solid element: its faces on the boundary
BOTH_SIDES = -2  # in a surface, of a membrane: where it lies
SCOPE = 10**10  # labels are offset by SCOPE * number of their part


@dataclass(frozen=True)
class Place:
    """A line of a file, for messages."""

    file: str
    line: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"

    def error(self, message: str) -> InputError:
        return InputError(f"{self}: {message}")


@dataclass(frozen=True)
class Card:
    """A keyword line: `keyword` in capitals with single spaces, options by name in capitals."""

    keyword: str
    options: dict[str, str]
    place: Place


@dataclass(frozen=True)
class Data:
    """Data lines as in the file; comments are replaced by blank lines."""

    text: bytes
    place: Place


@dataclass
class _Reading:
    """Counters of what has been read, to stop endless decks."""

    folder: Path
    size: int = 0
    keywords: int = 0
    files: int = 0
    open: list[Path] = field(default_factory=list)


def cards(path: Path) -> Iterator[Card | Data]:
    """The keywords and data of a deck in order, included files in place.

    Raises InputError with file and line for anything that is not a deck.
    """
    reading = _Reading(path.resolve().parent)
    yield from _file(path.resolve(), None, reading)


def _file(path: Path, asked: Place | None, reading: _Reading) -> Iterator[Card | Data]:
    """The contents of one file; `asked` is the place of its include."""
    if asked and path in reading.open:
        raise asked.error(
            f"{path.name} includes itself: {' > '.join(p.name for p in reading.open)}"
        )
    reading.files += 1
    if asked and reading.files > _INCLUDES:
        raise asked.error(f"more than {_INCLUDES} files are included")
    reading.open.append(path)
    try:
        with open(path, "rb") as file:
            yield from _stream(file, path, reading)
    except OSError as error:
        where = f"{asked}: " if asked else ""
        raise InputError(f"{where}{path} cannot be read: {error.strerror or error}") from None
    reading.open.pop()


def _stream(file: BinaryIO, path: Path, reading: _Reading) -> Iterator[Card | Data]:
    """Keywords and data of an open file."""
    for number, text in _pieces(file, path, reading):
        at, line = 0, number
        for match in _KEYWORD.finditer(text):
            yield from _data(text[at : match.start()], Place(path.name, line))
            line += text.count(b"\n", at, match.start())
            yield from _keyword(match.group(), Place(path.name, line), reading)
            line += match.group().count(b"\n")
            at = match.end()
        yield from _data(text[at:], Place(path.name, line))


def _pieces(file: BinaryIO, path: Path, reading: _Reading) -> Iterator[tuple[int, bytes]]:
    """(first line number, text) of pieces of whole lines that do not split a keyword line."""
    left, number = b"", 1
    while True:
        new = file.read(PIECE)
        reading.size += len(new)
        if reading.size > LARGEST:
            raise Place(path.name, number).error(
                f"the deck with its included files is larger than {LARGEST >> 20} MB"
            )
        if b"\0" in new:
            raise Place(path.name, number + (left + new[: new.index(b"\0")]).count(b"\n")).error(
                "a zero byte: this is not a text file"
            )
        text = left + new
        end = _whole_lines(text) if new else len(text)
        if not end and len(text) > PIECE:
            raise Place(path.name, number).error(f"a line longer than {PIECE >> 20} MB: no deck")
        # The last byte of a file of DOS is Ctrl-Z.
        piece = text[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\x1a", b"")
        if piece:
            yield number, _COMMENT.sub(b"", piece.removeprefix(b"\xef\xbb\xbf"))
        number += piece.count(b"\n")
        left = text[end:]
        if not new:
            return


def _whole_lines(text: bytes) -> int:
    """End of the whole lines in a piece, before a keyword that may continue on the next line."""
    end = text.rfind(b"\n") + 1
    star = text.rfind(b"\n*", 0, end) + 1
    last = text[star:end]
    if last.lstrip().startswith(b"*") and last.rstrip().endswith(b","):
        match = _KEYWORD.match(text, star)
        if match and match.end() >= len(text[:end].rstrip()):
            return star
    return end


def _data(text: bytes, place: Place) -> Iterator[Data]:
    if text.strip():
        skipped = len(text) - len(text.lstrip())
        yield Data(text, Place(place.file, place.line + text.count(b"\n", 0, skipped)))


def _keyword(raw: bytes, place: Place, reading: _Reading) -> Iterator[Card | Data]:
    """A keyword, followed by the contents of its INPUT file."""
    reading.keywords += 1
    if reading.keywords > _KEYWORDS:
        raise place.error(f"more than {_KEYWORDS} keywords: this is not a deck")
    first, *rest = _fields(" ".join(raw.decode("utf-8", "replace").split()))
    card = Card(" ".join(first.lstrip("* ").upper().split()), _options(rest), place)
    if card.keyword != "INCLUDE":
        yield card
    if "INPUT" in card.options:
        yield from _file(_beside(card.options["INPUT"], place, reading), place, reading)
    elif card.keyword == "INCLUDE":
        raise place.error("*INCLUDE needs INPUT=file")


def _fields(line: str) -> list[str]:
    """The parts between commas; a comma inside quotes belongs to a name."""
    return ["".join(part).strip() for part in _SPLIT.findall(line)]


def _options(parts: list[str]) -> dict[str, str]:
    options = {}
    for part in parts:
        name, _, value = part.partition("=")
        if name.strip():
            options[" ".join(name.upper().split())] = value.strip().strip("\"'")
    return options


def _beside(name: str, place: Place, reading: _Reading) -> Path:
    """The path of an included file. Raises InputError unless it is in the deck's folder."""
    if not name or "\0" in name or len(name) > 1000:
        raise place.error("INPUT= names no file")
    plain = name.replace("\\", "/")
    if re.match(r"[A-Za-z]:|//", plain):  # of another machine: the file beside the deck
        own = reading.folder / plain.rpartition("/")[2]
        if not own.is_file():
            raise place.error(
                f"{name} is a path of Windows, and there is no {own.name} beside the deck: put it there"
            )
        return own.resolve()
    path = (reading.folder / plain).resolve()
    if not path.is_file() and path.parent.is_dir():  # Windows does not tell capitals apart
        alike = [file for file in path.parent.iterdir() if file.name.lower() == path.name.lower()]
        path = alike[0] if len(alike) == 1 else path
    if not path.is_relative_to(reading.folder):
        raise place.error(f"{name} lies outside the deck's folder; only files in it are included")
    if not path.is_file():
        raise place.error(f"the included file {name} is not there ({path})")
    return path


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
    ragged = []
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
        ragged.append(values + [0.0] * (width - len(values)))
    return np.array(ragged).reshape(-1, width)


def _slow(part: Data, width: int, least: int) -> Iterator[list[float]]:
    for offset, line in enumerate(part.text.split(b"\n")):
        if not line.strip():
            continue
        place = Place(part.place.file, _first_line(part) + offset)
        values = [number(field, place) for field in fields(line)]
        if not least <= len(values) <= width:
            raise place.error(
                f"{len(values)} numbers; {least} to {width} belong here: {shown(line)}"
            )
        yield values + [0.0] * (width - len(values))


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
        raise place.error(f"{shown(text)} is not a number") from None
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
    records: list[list[int]] = []
    where = Place("", 0)  # of the first line of the current record
    for part in data:
        for offset, line in enumerate(part.text.split(b"\n")):
            if not line.strip():
                continue
            place = Place(part.place.file, _first_line(part) + offset)
            where = where if begun else place
            begun += [label(field, place) for field in fields(line)]
            if len(begun) > width:
                raise where.error(f"{len(begun)} numbers, but an element of this type has {width}")
            if len(begun) == width:
                records.append(begun)
                begun = []
    if begun:
        raise where.error(
            f"{len(begun)} numbers, but an element of this type has {width}: is the deck cut short?"
        )
    yield np.array(records, np.int64).reshape(-1, width)


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
        raise place.error(f"{shown(text)} is not a label of a node or element: {LABELS}")
    return int(value)


@dataclass(frozen=True)
class ElementShape:
    """An element shape: `role` solid, membrane or shell, dimension of the deck, nodes and faces.

    A face is given by its corner nodes, in the manual's order S1, S2, ...
    """

    role: str
    dimension: int
    nodes: int
    corners: int
    faces: tuple[tuple[int, ...], ...] = ()

    def reflected(self, asked: Place) -> list[int]:
        """Node order that gives the mirror image of an element a positive volume."""
        if self not in _REFLECTED:
            raise asked.error(f"*ELCOPY, REFLECT of elements of {self.nodes} nodes is not read")
        return _REFLECTED[self]


_SOLIDS = {
    (2, 3): ElementShape("solid", 2, 3, 3, _TRIANGLE),
    (2, 4): ElementShape("solid", 2, 4, 4, _QUAD),
    (2, 6): ElementShape("solid", 2, 6, 3, _TRIANGLE),
    (2, 8): ElementShape("solid", 2, 8, 4, _QUAD),
    (3, 4): ElementShape("solid", 3, 4, 4),
    (3, 10): ElementShape("solid", 3, 10, 4),
    (3, 6): ElementShape("solid", 3, 6, 6, _WEDGE),
    (3, 15): ElementShape("solid", 3, 15, 6, _WEDGE),
    (3, 8): ElementShape("solid", 3, 8, 8, _HEXAHEDRON),
    (3, 20): ElementShape("solid", 3, 20, 8, _HEXAHEDRON),
    (3, 27): ElementShape("solid", 3, 27, 8, _HEXAHEDRON),
}
_MEMBRANES = {
    (2, 1): ElementShape("membrane", 2, 2, 2),
    (2, 2): ElementShape("membrane", 2, 3, 2),
    (3, 3): ElementShape("membrane", 3, 3, 3),
    (3, 4): ElementShape("membrane", 3, 4, 4),
    (3, 6): ElementShape("membrane", 3, 6, 3),
    (3, 8): ElementShape("membrane", 3, 8, 4),
    (3, 9): ElementShape("membrane", 3, 9, 4),
}
_SHELLS = {key: replace(shape, role="shell") for key, shape in _MEMBRANES.items()}
_SHAPES = {"solid": _SOLIDS, "membrane": _MEMBRANES, "shell": _SHELLS}
# The first node stays, the others are traversed in reverse; in solids this holds for each end face.
_REFLECTED = {
    _SOLIDS[2, 3]: [0, 2, 1],
    _SOLIDS[2, 4]: [0, 3, 2, 1],
    _SOLIDS[2, 6]: [0, 2, 1, 5, 4, 3],
    _SOLIDS[2, 8]: [0, 3, 2, 1, 7, 6, 5, 4],
    _SOLIDS[3, 6]: [0, 2, 1, 3, 5, 4],
    _SOLIDS[3, 8]: [0, 3, 2, 1, 4, 7, 6, 5],
    _SOLIDS[3, 15]: [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13],
    _SOLIDS[3, 20]: [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17],
    _SHELLS[3, 3]: [0, 2, 1],
    _SHELLS[3, 4]: [0, 3, 2, 1],
    _SHELLS[3, 6]: [0, 2, 1, 5, 4, 3],
    _SHELLS[3, 8]: [0, 3, 2, 1, 7, 6, 5, 4],
}


def kind(name: str) -> ElementShape | None:
    """The shape of an Abaqus type in capitals; None for a type that is not used."""
    for pattern, role, dimension in _FAMILIES:
        match = pattern.fullmatch(name)
        if match:
            return _SHAPES[role].get((dimension, int(match[1])))
    return None


def used_kind(name: str) -> ElementShape:
    """The shape of a type known to be used."""
    kind_used = kind(name)
    assert kind_used is not None, f"{name} is not among the types that are used"
    return kind_used


@dataclass(frozen=True)
class CardBlock:
    """Elements of one type: labels (n,), nodes (n, k) by label, and the line where they begin."""

    type: str
    kind: ElementShape
    labels: np.ndarray
    nodes: np.ndarray
    place: Place

    def rows(self, rows: list[int] | np.ndarray) -> CardBlock:
        """The given rows of the block."""
        return CardBlock(self.type, self.kind, self.labels[rows], self.nodes[rows], self.place)


@dataclass
class Members:
    """One set as written: labels, ranges (first, last, step), names of other sets, and order."""

    labels: list[np.ndarray] = field(default_factory=list)
    ranges: list[tuple[int, int, int]] = field(default_factory=list)
    names: list[tuple[str, Place]] = field(default_factory=list)
    unsorted: bool = False


@dataclass(frozen=True)
class Sets:
    """Sets of one sort ("node set", "element set") by name, which is not case-sensitive.

    `known` (n,): all existing labels, ascending; a range selects among them.
    """

    sort: str
    members: Mapping[str, Members]
    known: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.members)

    def __contains__(self, name: str) -> bool:
        return name.upper() in self.members

    def labels(self, name: str, asked: Place | None = None) -> np.ndarray:
        """The labels of a set, ascending and unique. Raises InputError for an unknown set."""
        return self._resolved(name.upper(), asked, {})

    def ordered(self, name: str, asked: Place) -> np.ndarray:
        """The labels of a set in its own order: ascending unless it is UNSORTED."""
        labels = self.labels(name, asked)
        members = self.members[name.upper()]
        if not members.unsorted:
            return labels
        if members.names:
            raise asked.error(f"{self.sort} {name} is UNSORTED and made of other sets: not read")
        own = np.concatenate([*members.labels, *(self._range(*r) for r in members.ranges)])
        return own[np.sort(np.unique(own, return_index=True)[1])]

    def _resolved(self, name: str, asked: Place | None, done: dict) -> np.ndarray:
        if name in done:
            if done[name] is None:
                raise _error(asked, f"{self.sort} {name} is made of itself")
            return done[name]
        if name not in self.members:
            raise _error(asked, missing(self.sort, name, self.members))
        done[name] = None
        members = self.members[name]
        parts = [*members.labels, *(self._range(*given) for given in members.ranges)]
        parts += [self._resolved(inner, place, done) for inner, place in members.names]
        done[name] = np.unique(np.concatenate([np.empty(0, np.int64), *parts]))
        return done[name]

    def _range(self, first: int, last: int, step: int) -> np.ndarray:
        inside = self.known[np.searchsorted(self.known, first) :]
        inside = inside[: np.searchsorted(inside, last, side="right")]
        return inside[(inside - first) % step == 0]


def _error(asked: Place | None, message: str) -> InputError:
    return asked.error(message) if asked else InputError(message)


def missing(sort: str, name: str, names: Iterable[str]) -> str:
    """Message that a set does not exist, with the nearest name and the existing ones."""
    every = list(names)
    # An instance's own, INSTANCE.NAME, is there for every NAME of a part.
    known = [label for label in every if label.partition(".")[2] not in every or "." in name]
    near = difflib.get_close_matches(name.upper(), [k.upper() for k in known], 1, 0.6)
    hint = f"did you mean {near[0]}? " if near else ""
    shown = ", ".join(known[:30]) + (", …" if len(known) > 30 else "")
    return f"there is no {sort} {name}; {hint}there are: {shown or 'none'}"


@dataclass(frozen=True)
class Solid:
    """A *SOLID SECTION: the elements of a set consist of a material."""

    elements: str
    material: str
    place: Place


@dataclass(frozen=True, kw_only=True)
class CordLayer:
    """A layer of cords in the elements of a set, as in the deck (in its units).

    `angle` in degrees: from the meridian in axisymmetric elements, otherwise from the local first
    direction; `geometry` CONSTANT, ANGULAR (spacing in degrees), LIFT EQUATION (`extension`,
    `radius`) or EDGE: parallel to edge `edge` (1 to 4) of three-dimensional elements. `mass`: that
    of the membrane itself per area, and `covering`, its material and thickness; both of the first
    layer of a section alone. Of shells: `position` along the normal from their middle. Of solids:
    `cut`, the two places where the cords' plane enters and leaves them, in coordinates from 0 to 1.
    `line`: a set of which the elements are a part, and which is one line of cords ("": themselves).
    """

    name: str
    elements: str
    area: float
    spacing: float
    material: str
    angle: float
    geometry: str = "CONSTANT"
    extension: float = 0.0
    radius: float = 0.0
    orientation: str = ""
    mass: float = 0.0
    covering: tuple[str, float] | None = None
    position: float = 0.0
    edge: int = 0
    cut: tuple[tuple[float, float], tuple[float, float]] | None = None
    line: str = ""
    place: Place


@dataclass(frozen=True)
class Orientation:
    """An *ORIENTATION: its system in capitals, the six coordinates of two points, the axis of the
    normal (1 to 3) and the additional rotation about it in degrees.
    """

    system: str
    points: tuple[float, ...]
    axis: int
    turn: float
    place: Place


@dataclass(frozen=True)
class Embedded:
    """Sets of membranes embedded in the solids of a host set (None: of any)."""

    elements: tuple[str, ...]
    host: str | None
    place: Place


@dataclass(frozen=True)
class DeckCompound:
    """A *MATERIAL as written: (keyword, options, rows of numbers, place) of each suboption."""

    name: str
    parts: tuple[tuple[str, Mapping[str, str], tuple[tuple[float, ...], ...], Place], ...]
    place: Place


@dataclass(frozen=True, kw_only=True)
class Deck:
    """A mesh from a file, in the file's own units and labels.

    labels (n,) ascending and points (n, 3) of the nodes; surfaces: name -> (k, 2) of (element
    label, face), faces counted from 0, or ALL_FACES or BOTH_SIDES; `held`: node sets fixed to the
    rim; `pressed`: surfaces under pressure in a step; `lines`: surfaces that may be cord lines
    inside the body. `used` and `unused` are lines for the user; `same` (n,): the row that stands for
    each node, where nodes were merged.
    """

    file: str
    labels: np.ndarray
    points: np.ndarray
    blocks: tuple[CardBlock, ...]
    node_sets: Sets
    element_sets: Sets
    surfaces: Mapping[str, np.ndarray]
    solids: tuple[Solid, ...] = ()
    layers: tuple[CordLayer, ...] = ()
    embedded: tuple[Embedded, ...] = ()
    held: tuple[tuple[str, Place], ...] = ()
    pressed: tuple[str, ...] = ()
    materials: Mapping[str, DeckCompound] = field(default_factory=dict)
    orientations: Mapping[str, Orientation] = field(default_factory=dict)
    lines: tuple[str, ...] = ()
    used: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()
    same: np.ndarray | None = None

    @property
    def dimension(self) -> int:
        """2 for a section, 3 for a body, from its solid elements."""
        return max((b.kind.dimension for b in self.blocks if b.kind.role == "solid"), default=2)

    @property
    def face_names(self) -> tuple[str, ...]:
        """Names by which a face can be requested."""
        return (*self.surfaces, *self.node_sets.names)

    def rows(self, labels: np.ndarray, place: Place | None = None) -> np.ndarray:
        """Rows of `points` for node labels of any shape. InputError for an undefined node."""
        at = np.searchsorted(self.labels, labels)
        at[at == len(self.labels)] = 0
        if len(self.labels) == 0 or (self.labels[at] != labels).any():
            wrong = (
                labels.ravel()[0] if not len(self.labels) else labels[self.labels[at] != labels][0]
            )
            raise _error(place, f"node {wrong % SCOPE} is used by an element and not defined")
        return at if self.same is None else self.same[at]

    def _near(self, nodes: list[np.ndarray], tolerance: float) -> np.ndarray:
        """Pairs (k, 2) of rows that are nearer to each other than `tolerance`, among `nodes`."""
        from scipy.spatial import cKDTree

        used = np.unique(np.concatenate([np.empty(0, np.int64), *(node.ravel() for node in nodes)]))
        tree = cKDTree(self.points[used])
        return used[tree.query_pairs(tolerance, p=np.inf, output_type="ndarray")].reshape(-1, 2)

    def merged(self, tolerance: float) -> tuple[Deck, int]:
        """The deck with nodes of its solids nearer to each other than `tolerance` as one, and their number.

        In the file's unit of length. Nodes of one element stay apart. Membranes of two instances
        that meet are one line.
        """
        solids = [block for block in self.blocks if block.kind.role == "solid"]
        if not solids or tolerance <= 0:
            return self, 0
        nodes = [self.rows(block.nodes, block.place) for block in solids]
        lines = [b for b in self.blocks if b.kind.role == "membrane"]
        pairs = self._near(nodes, tolerance)
        laid = self._near([self.rows(b.nodes, b.place) for b in lines], tolerance)
        scope = self.labels[laid] // SCOPE
        pairs = np.concatenate([pairs, laid[scope[:, 0] != scope[:, 1]]])
        if not len(pairs):
            return self, 0
        n = len(self.labels)
        same = first_of(pairs, n)
        for block, rows in zip(solids, nodes, strict=True):
            ordered = np.sort(same[rows], axis=1)
            folded = np.flatnonzero((np.diff(ordered, axis=1) == 0).any(axis=1))
            if len(folded):
                raise block.place.error(
                    f"element {block.labels[folded[0]] % SCOPE} has nodes nearer to each other than tire.merge: take a "
                    "smaller one, or 0"
                )
        return replace(self, same=same), int((same != np.arange(n)).sum())


def first_of(pairs: np.ndarray, count: int) -> np.ndarray:
    """For each of `count` things the first one that pairs (k, 2) link it to."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    links = coo_matrix((np.ones(len(pairs)), pairs.T), (count, count))
    _, group = connected_components(links, directed=False)
    _, first = np.unique(group, return_index=True)
    return first[group]
