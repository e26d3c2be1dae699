"""Roads of heights on a regular grid, read row by row, and windows of it with holes filled."""

from __future__ import annotations

import copy
import os
import shutil
import tempfile
import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.meaning import ReadAs
from tireroad.contact.roads.missing import CodeSearch
from tireroad.contact.roads.under_tire import shown
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Numbers read at a time, 32 MB: the memory that a road of any length takes.
PIECE = 4_000_000
# Points in a list are sorted in memory, and positions along x are kept there.
MAX_POINTS = 10_000_000
# Codes for missing heights are looked for in at most 64 places of so many numbers.
SEARCHED, MOST_SEARCHED = 500_000, 64
# Largest number of heights unpacked into a temporary file: 16 GB.
MAX_UNPACKED = 2_000_000_000

# Axes that deviate from even spacing by less than this fraction of a step count as even, because
# files round positions.
EVEN = 1e-4
# Limits of steps and positions of a measured road, m; anything beyond is damage.
FINEST, FARTHEST = 1e-6, 1e8


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


class GridColumns:
    """Selected columns of rows, reordered."""

    def __init__(self, rows: Rows, columns: list[int]) -> None:
        self._rows, self._columns = rows, columns
        self.shape = rows.shape[0], len(columns)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return self._rows.read(i0, i1)[:, self._columns]


@dataclass(frozen=True)
class Coding:
    """Coding of a file's heights: metres = (number * scale + offset) * unit, and nan for what is no height.

    No heights are numbers equal to one of `missing`, and those out of `valid` (lowest, highest).
    """

    unit: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    missing: tuple[float, ...] = ()
    valid: tuple[float, float] = (-np.inf, np.inf)

    def decoded(self, numbers: Array) -> Array:
        """Heights in m."""
        z = self.numbers(numbers)
        return z if self.unit == 1.0 else self.unit * z

    def numbers(self, numbers: Array) -> Array:
        """Heights in the file's unit."""
        low, high = self.valid
        gone = (numbers < low) | (numbers > high) if np.isfinite((low, high)).any() else None
        for code in self.missing:
            here = np.isclose(numbers, code, rtol=1e-6, atol=1e-12)
            gone = here if gone is None else gone | here
        z = numbers
        if (self.scale, self.offset) != (1.0, 0.0):
            z = numbers * self.scale + self.offset
        return z if gone is None else np.where(gone, np.nan, z)


class Decoded:
    """Rows of a file as heights: by its coding, and without those where `mask` (rows of 0 and 1) is 1."""

    def __init__(self, rows: Rows, coding: Coding, mask: Rows | None = None) -> None:
        self._rows, self._coding, self._mask = rows, coding, mask
        self.shape = rows.shape

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1, m."""
        z = self._coding.decoded(self._rows.read(i0, i1))
        if self._mask is None:
            return z
        return np.where(self._mask.read(i0, i1) != 0, np.nan, z)


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


class Window:
    """Heights z at rows `first` to `first` + len(x) and columns of a road, x (n,), y (w,) in m.

    Only the rows last needed, and as many ahead of them as make `PIECE` numbers, are in memory;
    holes in them are filled. `missing` counts all holes, `hole` is the first (row, column) or None.
    """

    def __init__(
        self, rows: Rows, place: tuple[int, slice], x: Array, y: Array, source: str
    ) -> None:
        self._rows, (self._first, self._columns), self._source = rows, place, source
        self._x, self._y = x, y
        # As many rows as are read at a time: files yield whole rows, of which a part is kept.
        self._most = max(PIECE // rows.shape[1], 2)
        self._begin, self._z = 0, np.empty((0, len(y)))
        self._corners: tuple[Array, ...] = ()
        self._known = np.zeros(0, dtype=bool)
        self.missing = 0
        self.hole: tuple[int, int] | None = None
        self.search: CodeSearch | None = None  # looks for values that mean "no height"

    def __getstate__(self) -> dict[str, Any]:
        """The state without the rows in memory, which are read again when needed."""
        nothing = {"_begin": 0, "_z": np.empty((0, len(self._y))), "_corners": ()}
        return self.__dict__ | nothing

    def scan(self) -> None:
        """Search all rows for holes, once. InputError if there is no height at all."""
        known = np.ones(len(self._x), dtype=bool)
        for first in range(0, len(self._x), self._most):
            last = min(first + self._most, len(self._x))
            z = self._read(first, last)
            if self.search is not None:
                self.search(z, self._x[first:last], self._y)
            missing = np.isnan(z)
            known[first : first + len(missing)] = ~missing.all(axis=1)
            if self.hole is None and missing.any():
                i, j = np.argwhere(missing)[0]
                self.hole = first + int(i), int(j)
            self.missing += int(missing.sum())
        if not known.any():
            raise InputError(f"{self._source}: no valid height in the strip driven over")
        self._known = known

    def bilinear(self, i: NDArray[np.intp], s: Array, j: NDArray[np.intp], t: Array) -> Array:
        """Heights in the cells (i, j) at the fractions s along and t across."""
        if i.size == 0:
            return np.zeros(i.shape)
        low, high = int(i.min()), int(i.max())
        if high - low + 2 > self._most:
            return self._by_pieces(i, s, j, t)
        self._hold(low, high + 2)
        k = (i - self._begin) * len(self._y) + j
        near, near_left, far, far_left = (corner.take(k) for corner in self._corners)
        near += t * (near_left - near)
        far += t * (far_left - far)
        return near + s * (far - near)

    def bounds(self, rows: slice, columns: slice) -> tuple[float, float]:
        """Lowest and highest height of the rows and columns, without holes."""
        low, high = np.inf, -np.inf
        for first in range(rows.start, rows.stop, self._most):
            last = min(first + self._most, rows.stop)
            self._hold(first, last)
            z = self._z[first - self._begin : last - self._begin, columns]
            # Without a known height both stay infinite, and nothing is warned of.
            low = min(low, np.nanmin(z, initial=np.inf))
            high = max(high, np.nanmax(z, initial=-np.inf))
        return float(low), float(high)

    def _by_pieces(self, i: NDArray[np.intp], s: Array, j: NDArray[np.intp], t: Array) -> Array:
        out, piece = np.empty(i.shape), i // (self._most - 1)
        for number in np.unique(piece):
            here = piece == number
            out[here] = self.bilinear(i[here], s[here], j[here], t[here])
        return out

    def _hold(self, low: int, high: int) -> None:
        """Load the rows from `low` to `high`, and as many beyond as there is room for."""
        if low >= self._begin and high <= self._begin + len(self._z):
            return
        # A few behind too, since not all points of a patch are evaluated in one call.
        margin = (self._most - (high - low)) // 8
        begin = max(low - margin, 0)
        end = min(max(begin + self._most, high), len(self._x))
        z = self._read(begin, end)
        if len(self._known) and self.missing:
            z = self._without_holes(z, begin, end)
        # Four views in which a single index finds the corners of a cell.
        self._begin, self._z = begin, np.ascontiguousarray(z)
        flat, width = self._z.ravel(), len(self._y)
        self._corners = flat, flat[1:], flat[width:], flat[width + 1 :]

    def _without_holes(self, z: Array, begin: int, end: int) -> Array:
        """Fill holes, using the nearest known row on either side for rows without any height."""
        known = np.flatnonzero(self._known)
        k0, k1 = np.searchsorted(known, [begin, end - 1])
        before, after = known[max(k0 - 1, 0)], known[min(k1, len(known) - 1)]
        extra = [row for row in (before, after) if not begin <= row < end]
        index = np.concatenate([np.arange(begin, end), np.array(extra, dtype=int)])
        z = np.concatenate([z, *(self._read(row, row + 1) for row in extra)])
        order = np.argsort(index)
        filled = fill_holes(z[order], self._x[index[order]], self._y, self._source)
        return filled[np.searchsorted(index[order], np.arange(begin, end))]

    def _read(self, i0: int, i1: int) -> Array:
        try:
            z = self._rows.read(self._first + i0, self._first + i1)[:, self._columns]
        except (OSError, RuntimeError) as error:
            raise InputError(f"{self._source}: cannot be read ({error})") from error
        if np.isinf(z).any():
            raise InputError(f"{self._source}: {int(np.isinf(z).sum())} heights are infinite")
        return z


def fill_holes(z: Array, x: Array, y: Array, source: str = "road") -> Array:
    """z (nx, ny) m with NaN replaced.

    Linear across y between valid neighbours, the nearest one beyond the last; then the same
    along x for rows without any. InputError if all heights are missing.
    """
    if not np.isnan(z).any():
        return z
    z = z.copy()
    for row in np.flatnonzero(np.isnan(z).any(axis=1)):
        valid = ~np.isnan(z[row])
        if valid.any():
            z[row] = np.interp(y, y[valid], z[row, valid])
    known = ~np.isnan(z[:, 0])
    if not known.any():
        raise InputError(f"{source}: no valid height in the strip driven over")
    for column in range(z.shape[1] if not known.all() else 0):
        z[:, column] = np.interp(x, x[known], z[known, column])
    return z


class Axis:
    """Ascending positions (m), with a search for the cell of a value."""

    def __init__(self, positions: Array) -> None:
        self.positions = positions
        self._cells = len(positions) - 1
        mean = float(positions[-1] - positions[0]) / self._cells
        ideal = positions[0] + mean * np.arange(len(positions))
        self._even = bool(np.abs(positions - ideal).max() < EVEN * mean)
        self._per_metre = 1.0 / mean
        self.step = mean if self._even else float(np.diff(positions).min())

    def part(self, places: slice) -> Axis:
        """A contiguous part of the positions."""
        return Axis(self.positions[places])

    def locate(self, values: Array) -> tuple[NDArray[np.intp], Array]:
        """Index of the cell and fraction (0 to 1) within it; values outside move to the border."""
        if self._even:
            place = (values - self.positions[0]) * self._per_metre
            place = np.minimum(np.maximum(place, 0.0), float(self._cells))
            cell = np.minimum(place.astype(np.intp), self._cells - 1)
            return cell, place - cell
        cell = np.searchsorted(self.positions, values, side="right") - 1
        cell = np.minimum(np.maximum(cell, 0), self._cells - 1)
        left = self.positions[cell]
        share = (values - left) / (self.positions[cell + 1] - left)
        return cell, np.minimum(np.maximum(share, 0.0), 1.0)


class Grid:
    """Heights z (nx, ny) at ascending x (nx,) and y (ny,), all in m: z(x, y) at the file's own x.

    z may be rows in a file (above), read as the road rolls by, 32 MB at a time.
    `holes`: treatment of missing heights (NaN) in the strip given to `prepare`: "refuse", or "fill"
    by linear interpolation across the road, then along it, and by the nearest valid height at the
    borders; `filled` counts them. `end`: treatment of a strip longer than the road: "refuse", or
    "mirror" (reflected at both ends, so that z stays continuous). `source` names the road in
    messages. InputError if the arrays do not fit together.
    """

    def __init__(
        self,
        x: Array,
        y: Array,
        z: Array | Rows,
        holes: str = "refuse",
        end: str = "refuse",
        source: str = "road",
    ) -> None:
        x, y = (np.asarray(a, dtype=float) for a in (x, y))
        rows = _as_rows(z)
        _check_axes(x, y, rows.shape, source)
        _check_choice("holes", holes, ("refuse", "fill"))
        _check_choice("end", end, ("refuse", "mirror"))
        self._holes, self._end, self.source = holes, end, source
        self._x, self._y = Axis(x), Axis(y)
        self._rows = rows
        self._window = self._over(slice(0, len(x)), slice(0, len(y)))
        self.measured = float(x[0]), float(x[-1])  # the first and the last x, m
        self._sides = float(y[0]), float(y[-1])
        self.filled = 0
        self.notes: tuple[str, ...] = ()  # how the measurement was processed, for the user
        self.readings: tuple[ReadAs, ...] = ()  # what of the file was read as what
        self.search: CodeSearch | None = None
        self.making = 0.0  # bytes of memory that making it took

    def look_for_codes(self) -> None:
        """InputError for values that look like "no height" (`search`), of a long file in places all along it.

        The strip that is driven over is searched completely when it is prepared.
        """
        if self.search is None:
            return
        count, width = self._rows.shape
        most = max(SEARCHED // width, 2)
        begins = range(0, count, most)
        for first in begins[:: -(-len(begins) // MOST_SEARCHED)]:
            last = min(first + most, count)
            x, y = self._x.positions[first:last], self._y.positions
            self.search(self._rows.read(first, last), x, y)

    def _over(self, rows: slice, columns: slice) -> Window:
        place = rows.start, columns
        x, y = self._x.positions[rows], self._y.positions[columns]
        return Window(self._rows, place, x, y, self.source)

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((x0, x1), (y0, y1)) in m; a mirrored road is endless along x."""
        reach = (-np.inf, np.inf) if self._end == "mirror" else self.measured
        return reach, self._sides

    @property
    def extent_of_file(self) -> tuple[float, float]:
        """Length and width of the measurement, m."""
        return self.measured[1] - self.measured[0], self._sides[1] - self._sides[0]

    @property
    def steps(self) -> tuple[float, float]:
        """The smallest steps along and across, m."""
        return self._x.step, self._y.step

    @property
    def spacing(self) -> float:
        """The smallest step of the grid, m."""
        return min(self._x.step, self._y.step)

    @property
    def shortest_wave(self) -> float:
        """The shortest wave that its points resolve, m."""
        return 2 * self.spacing

    def height(self, x: Array, y: Array) -> Array:
        """Bilinear heights (m) at x, y (m) of equal shape; beyond the strip those of its edge."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if self._end == "mirror":
            x = self._reflect(x)
        i, s = self._x.locate(x)
        j, t = self._y.locate(y)
        return self._window.bilinear(i, s, j, t)

    def _reflect(self, x: Array) -> Array:
        """x folded into what was measured, with mirrors at both of its ends."""
        first, length = self.measured[0], self.extent_of_file[0]
        return first + (length - np.abs(length - np.mod(x - first, 2.0 * length)))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The highest grid height around the strip (m), which bilinear heights cannot exceed."""
        return self._window.bounds(*self._cells(x0, x1, y0, y1))[1]

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The lowest grid height around the strip, m."""
        return self._window.bounds(*self._cells(x0, x1, y0, y1))[0]

    def _cells(self, x0: float, x1: float, y0: float, y1: float) -> tuple[slice, slice]:
        """Grid points of all cells in the strip; all rows if it leaves a mirrored road."""
        (i0, i1), _ = self._x.locate(np.array([x0, x1]))
        (j0, j1), _ = self._y.locate(np.array([y0, y1]))
        first, last = self.measured
        if self._end == "mirror" and (x0 < first or x1 > last):
            i0, i1 = 0, len(self._x.positions) - 2
        return slice(int(i0), int(i1) + 2), slice(int(j0), int(j1) + 2)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Grid:
        """The road of the strip alone (m), without holes, for fast evaluation in it.

        InputError if the strip leaves the road or contains holes that are to be refused.
        """
        self._check_strip(x0, x1, y0, y1)
        rows, columns = self._cells(x0, x1, y0, y1)
        window = self._over(rows, columns)
        window.search = self.search
        window.scan()
        if window.missing and self._holes == "refuse":
            self._refuse_holes(window, rows.start, columns.start)
        road = copy.copy(self)
        road._window, road.filled = window, window.missing
        road._x, road._y = self._x.part(rows), self._y.part(columns)
        return road

    def _check_strip(self, x0: float, x1: float, y0: float, y1: float) -> None:
        slack = 1e-6 * self.spacing
        left, right = self._sides
        if y0 < left - slack or y1 > right + slack:
            raise InputError(
                f"{self.source}: the tire needs y from {y0:.4g} to {y1:.4g} m, the road has "
                f"{left:.4g} to {right:.4g} m; change [road] lateral"
            )
        first, last = self.measured
        if self._end == "refuse" and (x0 < first - slack or x1 > last + slack):
            raise InputError(
                f"{self.source}: the run needs the road from x = {shown(x0)} to {shown(x1)} m, and "
                f"it has {shown(first)} to {shown(last)} m; change [road] start, shorten [time] "
                'duration, or continue it by end = "mirror"'
            )

    def _refuse_holes(self, window: Window, row: int, column: int) -> None:
        assert window.hole is not None, "no height is missing"
        i, j = window.hole
        raise InputError(
            f"{self.source}: {window.missing} heights are missing in the strip driven over, "
            f"the first at x = {shown(self._x.positions[row + i])} m and y = "
            f"{self._y.positions[column + j]:.4g} m; choose another [road] lateral or start, or "
            'fill them by holes = "fill"'
        )


def _as_rows(z: Array | Rows) -> Rows:
    if hasattr(z, "read"):
        return z
    z = np.asarray(z, dtype=float)
    if np.isinf(z).any():
        raise InputError(f"road: {int(np.isinf(z).sum())} heights are infinite")
    return ArrayRows(z)


def _check_axes(x: Array, y: Array, shape: tuple[int, ...], source: str) -> None:
    for name, axis in (("x", x), ("y", y)):
        if axis.ndim != 1 or len(axis) < 2:
            raise InputError(f"{source}: {name} must hold at least two positions (m)")
        if not np.all(np.isfinite(axis)) or not np.all(np.diff(axis) > 0.0):
            raise InputError(f"{source}: {name} must be finite and ascend (m)")
        if np.diff(axis).min() < FINEST or np.abs(axis).max() > FARTHEST:
            raise InputError(
                f"{source}: {name} has steps down to {np.diff(axis).min():.3g} m and reaches from "
                f"{axis[0]:.3g} to {axis[-1]:.3g} m; steps must be at least {FINEST:g} m, positions "
                f"within {FARTHEST:g} m"
            )
    if shape != (len(x), len(y)):
        raise InputError(f"{source}: z has shape {shape}, x and y require {(len(x), len(y))}")


def _check_choice(key: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f'road: {key} = "{value}" is unknown: take {" or ".join(choices)}')
