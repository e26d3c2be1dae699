"""Heights of a road in rows across it, in memory or left in their file until needed."""

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

# Numbers read at a time, 32 MB: the memory that a road of any length takes.
PIECE = 4_000_000
# Points in a list are sorted in memory, and positions along x are kept there.
MAX_POINTS = 10_000_000
# Largest number of heights unpacked into a temporary file: 16 GB.
MAX_UNPACKED = 2_000_000_000


def check_count(file: Path, count: int) -> None:
    """InputError for more positions than can be kept in memory."""
    if count > MAX_POINTS:
        raise InputError(
            f"road.file {file}: {count:,} positions to be held in memory, more than the "
            f"{MAX_POINTS:,} that may be; cut the road first, or write its heights as a matrix by rows"
        )


class Rows(Protocol):
    """`shape` (rows, numbers per row); `read` returns rows i0 to i1, (i1 - i0, width).

    Rows are pickled for other processes of the machine: arrays as buffers, files by reopening them.
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
    """Selected columns of rows, reordered."""

    def __init__(self, rows: Rows, columns: list[int]) -> None:
        self._rows, self._columns = rows, columns
        self.shape = rows.shape[0], len(columns)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return self._rows.read(i0, i1)[:, self._columns]


class Scaled:
    """Rows in another unit: multiplied by a factor."""

    def __init__(self, rows: Rows, factor: float) -> None:
        self._rows, self._factor = rows, factor
        self.shape = rows.shape

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return self._factor * self._rows.read(i0, i1)


class Packed(NamedTuple):
    """Position (byte), number type and shape of contiguous rows of numbers in a file."""

    start: int
    kind: np.dtype
    shape: tuple[int, int]


class FileRows:
    """Rows packed in a file, read when needed; the file stays open as long as they live.

    `file`: its name, or the descriptor of an open file, which is closed at the end.
    """

    def __init__(self, file: Path | int, packed: Packed) -> None:
        self._name, self._packed, self.shape = file, packed, packed.shape
        self._open = file if isinstance(file, int) else os.open(file, os.O_RDONLY)
        weakref.finalize(self, os.close, self._open)

    def __reduce__(self) -> tuple[type[FileRows], tuple[Path, Packed]]:
        """Reopen by name or, for a file without one, through this process's descriptor."""
        name = self._name
        if isinstance(name, int):
            name = Path(f"/proc/{os.getpid()}/fd/{name}")
        return FileRows, (name, self._packed)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1. InputError if the file has become shorter."""
        start, kind, (_, width) = self._packed
        size = width * kind.itemsize
        first, left, parts = start + i0 * size, (i1 - i0) * size, []
        while left:  # one call reads at most 2 GB
            parts.append(os.pread(self._open, left, first))
            if not parts[-1]:
                raise InputError(f"road.file {self._name}: ends while it is read")
            first, left = first + len(parts[-1]), left - len(parts[-1])
        # A signalling NaN would raise an invalid-operation flag when widened to double.
        with np.errstate(invalid="ignore"):
            return np.frombuffer(b"".join(parts), kind).reshape(-1, width).astype(float)


class Spool:
    """Rows that arrive block by block, from text or a compressed file.

    More than `PIECE` numbers go to an unnamed temporary file, as doubles, and are read from there:
    this takes disk space (TMPDIR) until the program ends, not memory. InputError, which names
    `source`, if that exceeds half of the free space or MAX_UNPACKED numbers; immediately if their
    number is `announced`.
    """

    def __init__(self, source: str = "road", announced: int = 0) -> None:
        self._source, self._written = source, 0
        self._check_room(announced)
        self._blocks: list[Array] = []
        self._held = self._rows = self._width = 0
        self._open: int | None = None

    def add(self, block: Array) -> None:
        """Append rows (n, width)."""
        self._blocks.append(block)
        self._held += block.size
        self._rows += len(block)
        self._width = block.shape[1]
        if self._held > PIECE:
            self._flush()

    def rows(self) -> Rows:
        """All rows."""
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
        """InputError unless this many more numbers may be written to disk."""
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
    """All rows as (first row, rows), in pieces of at most `PIECE` numbers.

    The next piece begins `overlap` rows before the end of the previous one.
    """
    count, width = rows.shape
    step = max(PIECE // width, overlap + 1)
    first = 0
    while True:
        last = min(first + step, count)
        yield first, rows.read(first, last)
        if last == count:
            return
        first = last - overlap
