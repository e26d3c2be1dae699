"""Heights of a road in rows across it, in memory or left in their file until they are asked for."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Numbers read at a time, 32 MB of them: what a road of any length takes.
PIECE = 4_000_000
# Lists of points are sorted in memory, and positions along x are held there.
MAX_POINTS = 10_000_000
# Heights that may be unpacked into a temporary file: 16 GB.
MAX_UNPACKED = 2_000_000_000


def check_count(file: Path, count: int) -> None:
    """InputError for more positions than are held in memory."""
    if count > MAX_POINTS:
        raise InputError(
            f"road.file {file}: {count:,} positions to be held in memory, more than the "
            f"{MAX_POINTS:,} that may be; cut the road first, or write its heights as a matrix by rows"
        )


class Rows(Protocol):
    """`shape` (rows, numbers a row); `read` gives rows i0 to i1, (i1 - i0, width).

    Rows go to other processes of the machine by pickling: arrays as buffers, what lies in a file by being opened there.
    """

    shape: tuple[int, int]

    def read(self, i0: int, i1: int) -> Array: ...


class ArrayRows:
    """Rows in memory."""

    def __init__(self, values: Array) -> None:
        self._values, self.shape = values, (len(values), values.shape[1])

    def read(self, i0: int, i1: int) -> Array:
        """A view."""
        return self._values[i0:i1]


class Columns:
    """Some columns of rows, in another order."""

    def __init__(self, rows: Rows, columns: list[int]) -> None:
        self._rows, self._columns = rows, columns
        self.shape = rows.shape[0], len(columns)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return self._rows.read(i0, i1)[:, self._columns]


class Scaled:
    """Rows in another unit: times a factor."""

    def __init__(self, rows: Rows, factor: float) -> None:
        self._rows, self._factor = rows, factor
        self.shape = rows.shape

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return self._factor * self._rows.read(i0, i1)


class Packed(NamedTuple):
    """Where rows of numbers without gaps begin in a file (byte), of what kind and shape."""

    start: int
    kind: np.dtype
    shape: tuple[int, int]


class FileRows:
    """Rows packed in a file, read where they are wanted; the file stays open as long as they live.

    `file`: its name, or the number of an open file, which is closed in the end.
    """

    def __init__(self, file: Path | int, packed: Packed) -> None:
        self._name, self._packed, self.shape = file, packed, packed.shape
        self._open = file if isinstance(file, int) else os.open(file, os.O_RDONLY)
        weakref.finalize(self, os.close, self._open)

    def __reduce__(self) -> tuple[type[FileRows], tuple[Path, Packed]]:
        """Opened by its name, or, of a file without one, as the open file of this process, where the system shows it."""
        name = self._name
        if isinstance(name, int):
            name = Path(f"/proc/{os.getpid()}/fd/{name}")
        return FileRows, (name, self._packed)

    def read(self, i0: int, i1: int) -> Array:
        """InputError when the file has become shorter."""
        start, kind, (_, width) = self._packed
        size = width * kind.itemsize
        first, left, parts = start + i0 * size, (i1 - i0) * size, []
        while left:  # one call reads 2 GB at most
            parts.append(os.pread(self._open, left, first))
            if not parts[-1]:
                raise InputError(f"road.file {self._name}: ends while it is read")
            first, left = first + len(parts[-1]), left - len(parts[-1])
        # A signalling NaN would raise an invalid-operation flag when widened to double.
        with np.errstate(invalid="ignore"):
            return np.frombuffer(b"".join(parts), kind).reshape(-1, width).astype(float)


class Spool:
    """Rows that come one block after the other, from text or a compressed file.

    More than `PIECE` numbers go to a temporary file without a name, as doubles, and are read from
    there: it takes room on the disk (TMPDIR) until the program ends, not memory. InputError, which
    names `source`, when that would be more than half of the free room, or more than MAX_UNPACKED
    numbers; at once where their number is `announced`.
    """

    def __init__(self, source: str = "road", announced: int = 0) -> None:
        self._source, self._written = source, 0
        self._check_room(announced)
        self._blocks: list[Array] = []
        self._held = self._rows = self._width = 0
        self._open: int | None = None

    def add(self, block: Array) -> None:
        """Take rows (n, width)."""
        self._blocks.append(block)
        self._held += block.size
        self._rows += len(block)
        self._width = block.shape[1]
        if self._held > PIECE:
            self._flush()

    def rows(self) -> Rows:
        """All of them."""
        if self._open is None:
            return ArrayRows(np.concatenate(self._blocks) if self._blocks else np.empty((0, 0)))
        self._flush()
        return FileRows(self._open, Packed(0, np.dtype(float), (self._rows, self._width)))

    def _flush(self) -> None:
        if self._open is None:
            self._open, name = tempfile.mkstemp()
            os.unlink(name)
        self._check_room(self._held)
        self._written += self._held
        for block in self._blocks:
            data = np.ascontiguousarray(block, dtype=float).data.cast("B")
            while data:
                data = data[os.write(self._open, data) :]
        self._blocks, self._held = [], 0

    def _check_room(self, numbers: int) -> None:
        """InputError unless so many numbers more may go to the disk."""
        if numbers <= PIECE and self._written == 0:
            return
        folder = tempfile.gettempdir()
        free = shutil.disk_usage(folder).free
        total = self._written + numbers
        if total > MAX_UNPACKED or 8 * numbers > 0.5 * free:
            raise InputError(
                f"{self._source}: unpacked it has {total:.3g} heights, {8e-9 * total:.3g} GB in {folder} "
                f"({1e-9 * free:.3g} GB free); at most {8e-9 * MAX_UNPACKED:g} GB and half of what is free "
                "may be taken: cut the road first, set TMPDIR to a larger disk, or write it by "
                "numpy.savez or to .h5, which need not be unpacked"
            )


def pieces(rows: Rows, overlap: int = 0) -> Iterator[tuple[int, Array]]:
    """All rows as (first row, rows), each piece of at most `PIECE` numbers, the next beginning
    `overlap` rows before its end."""
    count, width = rows.shape
    step = max(PIECE // width, overlap + 1)
    first = 0
    while True:
        last = min(first + step, count)
        yield first, rows.read(first, last)
        if last == count:
            return
        first = last - overlap
