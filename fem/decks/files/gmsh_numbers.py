"""The parts of a Gmsh file and their numbers, text or binary, never read past their end."""

from __future__ import annotations

import re
import warnings
from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.files.lines import Place
from tireroad.fem.errors import InputError

LARGEST = 1 << 29  # bytes
_BEGIN = re.compile(rb"^\$([A-Za-z]+)[ \t\r]*\n", re.MULTILINE)


@dataclass(frozen=True)
class Part:
    """The content between $Name and $EndName, and where it begins."""

    text: bytes
    place: Place

    def line(self, offset: int) -> Place:
        return Place(self.place.file, self.place.line + offset)


def parts(data: bytes, name: str) -> dict[str, Part]:
    """The parts of a file by name, the first of each. InputError for a part without end."""
    found: dict[str, Part] = {}
    at, line = 0, 1
    while match := _BEGIN.search(data, at):
        line += data.count(b"\n", at, match.end())
        title = match[1].decode()
        end = data.find(b"$End" + match[1], match.end())
        if end < 0:
            raise Place(name, line).error(f"${title} has no $End{title}: is the file cut short?")
        found.setdefault(title, Part(data[match.end() : end], Place(name, line)))
        line += data.count(b"\n", match.end(), end)
        at = end + 1
    return found


class _Numbers:
    """Sequential reader of a part's numbers. Raises InputError if there are too few."""

    binary: bool

    def __init__(self, part: Part) -> None:
        self.part = part

    def error(self, message: str) -> InputError:
        return self.part.place.error(message)

    def fits(self, count: int, size: int) -> int:
        """The count, if the part can hold that many items of `size` bytes (or characters)."""
        if not count >= 0 or count * (size if self.binary else 2) > len(self.part.text) + 64:
            raise self.error(f"{count} entries are announced and not there: is the file cut short?")
        return int(count)


class TextNumbers(_Numbers):
    """Numbers written as text."""

    binary = False

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self._at = 0
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                self._all = np.fromstring(part.text.replace(b"\n", b" "), sep=" ")
            except (DeprecationWarning, ValueError):
                raise self.error("something in this part is no number") from None

    def reals(self, count: int) -> np.ndarray:
        if self._at + count > len(self._all):
            raise self.error("numbers are missing: is the file cut short?")
        self._at += count
        return self._all[self._at - count : self._at]

    def ints(self, count: int) -> np.ndarray:
        values = self.reals(count)
        with np.errstate(invalid="ignore"):
            if not ((values == np.floor(values)) & (np.abs(values) < 2**53)).all():
                raise self.error("a whole number was expected")
        return values.astype(np.int64)

    sizes = ints

    def labelled_points(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Labels (n,) and points (n, 3), stored node by node."""
        table = self.reals(4 * count).reshape(count, 4)
        if not (table[:, 0] == np.floor(table[:, 0])).all():
            raise self.error("a node's label is no whole number")
        return table[:, 0].astype(np.int64), table[:, 1:].copy()


class BinaryNumbers(_Numbers):
    """Numbers in Gmsh's binary format: int32, uint64, float64."""

    binary = True

    def __init__(self, part: Part) -> None:
        super().__init__(part)
        self._at = 0

    def _take(self, kind: str, count: int) -> np.ndarray:
        size = int(count) * np.dtype(kind).itemsize
        # Format 2.2 writes the first count of a part as text.
        if self._at + size > len(self.part.text):
            raise self.error("data are missing: is the file cut short?")
        self._at += size
        return np.frombuffer(self.part.text, kind, int(count), self._at - size)

    def reals(self, count: int) -> np.ndarray:
        return self._take("<f8", count)

    def ints(self, count: int) -> np.ndarray:
        if self._at == 0 and self.part.text[:1].isdigit() and b"\n" in self.part.text[:20]:
            first, _, _ = self.part.text.partition(b"\n")
            if first.strip().isdigit():
                self._at = len(first) + 1
                return np.array([int(first)])
        return self._take("<i4", count).astype(np.int64)

    def sizes(self, count: int) -> np.ndarray:
        values = self._take("<u8", count)
        if (values > 2**53).any():
            raise self.error("a count or label is out of range")
        return values.astype(np.int64)

    def labelled_points(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Labels (n,) and points (n, 3), one record per node."""
        table = self._take("<u1", 28 * count).reshape(count, 28)
        labels = np.ascontiguousarray(table[:, :4]).view("<i4")[:, 0].astype(np.int64)
        return labels, np.ascontiguousarray(table[:, 4:]).view("<f8").copy()
