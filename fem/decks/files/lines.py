"""An Abaqus deck as a stream of keyword lines and the data blocks between them.

Files are read in pieces, so unused parts take no memory. Included files are read in place and must
lie in the deck's folder or below it. Nothing in a deck is executed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from tireroad.fem.errors import InputError

PIECE = 1 << 22  # bytes read at once, and the longest line
LARGEST = 1 << 30  # bytes of a deck with all included files
_KEYWORDS = 200_000
_INCLUDES = 1000
_COMMENT = re.compile(rb"^[ \t]*\*\*[^\n]*", re.MULTILINE)
_KEYWORD = re.compile(rb"^[ \t]*\*(?:[^\n]*,[ \t]*\n)*[^\n]*", re.MULTILINE)
_SPLIT = re.compile(r'(?:^|,)((?:[^,"]|"[^"]*"?)*)')


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
                "a zero byte: this is no text file"
            )
        text = left + new
        end = _whole_lines(text) if new else len(text)
        if not end and len(text) > PIECE:
            raise Place(path.name, number).error(f"a line longer than {PIECE >> 20} MB: no deck")
        piece = text[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
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
        raise place.error(f"more than {_KEYWORDS} keywords: this is no deck")
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
    path = (reading.folder / name.replace("\\", "/")).resolve()
    if not path.is_relative_to(reading.folder):
        raise place.error(f"{name} lies outside the deck's folder; only files in it are included")
    if not path.is_file():
        raise place.error(f"the included file {name} is not there ({path})")
    return path
