"""Road heights on a grid from .npz, .csv and .h5 files, read as data and checked before use."""

import struct
import zipfile
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.rows import PIECE, ArrayRows, FileRows, Packed, Rows, Spool
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Lists of points are sorted in memory, and positions along x are held there.
MAX_POINTS = 10_000_000
BLOCK = 4096  # lines of text taken at a time
# What the standard library, numpy and h5py raise for damaged files; NotImplementedError and
# RuntimeError are zipfile's for damaged version numbers and flags.
UNREADABLE = (
    OSError,
    EOFError,
    zipfile.BadZipFile,
    zlib.error,
    NotImplementedError,
    RuntimeError,
)


def read_grid(file: Path, holes: str = "refuse", end: str = "refuse") -> Grid:
    """The road of a grid file: x (nx,), y (ny,) and z (nx, ny), all in m, x in rolling direction.

    .npz: arrays x, y, z. .h5 or .hdf5: datasets x, y, z in the root. .csv: with a first line
    `x,y,z`, one point a line, every point of the grid once, in any order; otherwise a matrix whose
    first line holds an ignored corner and then all y, and whose further lines hold one x and its
    heights. Lines starting with # are skipped; `nan` is a hole. InputError names file and place of
    what is wrong.

    Heights stay in the file, whose part under the tire is read when it is needed: .h5, and .npz as
    numpy.savez writes it. A .csv matrix or a compressed .npz is converted once, at the start, to a
    temporary file (contact.rows.Spool). Only a list of points is held in memory, 10 million at most.
    """
    readers = {".npz": _read_npz, ".csv": _read_csv, ".h5": _read_hdf5, ".hdf5": _read_hdf5}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"road.file {file}: the ending {file.suffix!r} is not .npz, .csv, .h5 or .hdf5; for "
            'OpenCRG files take kind = "crg"'
        )
    if not file.is_file():
        raise InputError(f"road.file {file}: no such file")
    try:
        x, y, z = reader(file)
    except UNREADABLE as error:
        raise InputError(f"road.file {file}: cannot be read ({error}); is it complete?") from error
    return Grid(x, y, z, holes=holes, end=end, source=f"road.file {file}")


def _read_npz(file: Path) -> tuple[Array, Array, Rows]:
    with zipfile.ZipFile(file) as archive:
        sizes = {member.filename: member.file_size for member in archive.infolist()}
        missing = [name for name in "xyz" if f"{name}.npy" not in sizes]
        if missing:
            names = ", ".join(missing)
            raise InputError(f"road.file {file}: no array {names}; x, y and z are needed")
        _check_count(file, max(sizes["x.npy"], sizes["y.npy"]) // 8)
        try:
            with np.load(file, allow_pickle=False) as arrays:
                x, y = (np.asarray(arrays[name], dtype=float) for name in "xy")
            return x, y, _npz_rows(file, archive)
        except (ValueError, TypeError) as error:
            raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error


def _npz_rows(file: Path, archive: zipfile.ZipFile) -> Rows:
    """z, left in the archive where it is not compressed; all of it passes by once, as a check."""
    info = archive.getinfo("z.npy")
    with archive.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0
        shape, by_columns, kind = (
            read if version == (1, 0) else np.lib.format.read_array_header_2_0
        )(stream)
        if kind.kind not in "iuf" or len(shape) != 2 or 0 in shape:
            raise ValueError(f"z is {kind} of shape {shape}")
        if by_columns:
            _check_count(file, info.file_size // kind.itemsize)
            with np.load(file, allow_pickle=False) as arrays:
                return ArrayRows(np.asarray(arrays["z"], dtype=float))
        packed = Packed(stream.tell(), kind, shape)
        stored = info.compress_type == zipfile.ZIP_STORED
        spool = Spool()
        for block in _blocks(stream, packed):
            if not stored:
                spool.add(block)
    return _stored(file, info, packed) if stored else spool.rows()


def _blocks(stream: BinaryIO, packed: Packed) -> Iterator[Array]:
    """Blocks of rows in their order; beyond the last, the archive checks its sum."""
    (count, width), size = packed.shape, packed.kind.itemsize
    most = max(PIECE // width, 1)
    for first in range(0, count, most):
        wanted = min(most, count - first) * width * size
        data = stream.read(wanted)
        if len(data) < wanted:
            raise EOFError("z ends too early")
        yield np.frombuffer(data, packed.kind).reshape(-1, width).astype(float)
    stream.read(1)


def _stored(file: Path, info: zipfile.ZipInfo, packed: Packed) -> FileRows:
    """Rows of an archive's member that is not compressed: its own header has two lengths at byte 26."""
    with file.open("rb") as stream:
        stream.seek(info.header_offset + 26)
        name, extra = struct.unpack("<HH", stream.read(4))
    start = info.header_offset + 30 + name + extra + packed.start
    return FileRows(file, packed._replace(start=start))


class _Hdf5Rows:
    """A dataset, which stays in its file."""

    def __init__(self, dataset) -> None:
        self._dataset, self.shape = dataset, dataset.shape

    def read(self, i0: int, i1: int) -> Array:
        return np.asarray(self._dataset[i0:i1], dtype=float)


def _read_hdf5(file: Path) -> tuple[Array, Array, Rows]:
    import h5py  # only for the one format that needs it

    store = h5py.File(file, "r")
    missing = [n for n in "xyz" if not isinstance(store.get(n), h5py.Dataset)]
    if missing:
        raise InputError(
            f"road.file {file}: no dataset {', '.join(missing)}; x, y and z are needed"
        )
    _check_count(file, max(store["x"].size, store["y"].size))
    if store["z"].dtype.kind not in "iuf" or store["z"].ndim != 2:
        raise InputError(f"road.file {file}: x, y and z must hold numbers, z in rows and columns")
    try:
        x, y = (np.asarray(store[name][()], dtype=float) for name in "xy")
    except (ValueError, TypeError) as error:
        raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error
    return x, y, _Hdf5Rows(store["z"])


def _read_csv(file: Path) -> tuple[Array, Array, Rows]:
    try:
        with file.open(encoding="utf-8-sig") as stream:
            lines = (
                (i, line.rstrip("\r\n"))
                for i, line in enumerate(stream, 1)
                if line.strip() and not line.startswith("#")
            )
            return _csv_rows(file, lines)
    except UnicodeDecodeError as error:
        raise InputError(f"road.file {file}: is no text file (byte {error.start})") from error


def _csv_rows(file: Path, lines: Iterator[tuple[int, str]]) -> tuple[Array, Array, Rows]:
    """From numbered lines of text, taken block by block."""
    number, first = next(lines, (1, ""))
    header = [field.strip().lower() for field in first.split(",")]
    listed = header == ["x", "y", "z"]
    # The corner's text is nobody's number: a zero takes its place.
    _, _, rest = first.partition(",")
    axis = None if listed else _numbers(file, [(number, f"0,{rest}")], len(header))[0, 1:]
    positions, spool, count = [], Spool(), 0
    while block := list(islice(lines, BLOCK)):
        table = _numbers(file, block, len(header))
        count += len(table)
        _check_count(file, count)
        positions.append(table if listed else table[:, 0])
        if not listed and axis.size:
            spool.add(table[:, 1:])
    if count < 2:
        raise InputError(f"road.file {file}: {count + 1} lines of data, at least 3 are needed")
    if listed:
        x, y, z = _points(file, np.concatenate(positions))
        return x, y, ArrayRows(z)
    return np.concatenate(positions), axis, spool.rows()


def _numbers(file: Path, numbered: list[tuple[int, str]], width: int) -> Array:
    """(lines, width) numbers; InputError with the line of the first field that is none."""
    table = np.empty((len(numbered), width))
    for row, (number, line) in enumerate(numbered):
        fields = line.split(",")
        if len(fields) != width:
            raise InputError(
                f"road.file {file}, line {number}: {len(fields)} fields, {width} expected"
            )
        try:
            table[row] = [float(field) for field in fields]
        except ValueError as error:
            raise InputError(f"road.file {file}, line {number}: {error}") from error
    return table


def _points(file: Path, table: Array) -> tuple[Array, Array, Array]:
    """The grid of a list of points, which must hold every crossing of its x and y once."""
    if not np.all(np.isfinite(table[:, :2])):
        raise InputError(f"road.file {file}: x and y must be finite numbers")
    x, i = np.unique(table[:, 0], return_inverse=True)
    y, j = np.unique(table[:, 1], return_inverse=True)
    count = np.zeros((len(x), len(y)), dtype=int)
    if len(x) * len(y) == len(table):
        np.add.at(count, (i, j), 1)
    if not np.all(count == 1):
        raise InputError(
            f"road.file {file}: {len(table)} points do not fill the grid of their {len(x)} x and "
            f"{len(y)} y once each; list every point, nan where the height is missing"
        )
    z = np.empty(count.shape)
    z[i, j] = table[:, 2]
    return x, y, z


def _check_count(file: Path, count: int) -> None:
    if count > MAX_POINTS:
        raise InputError(
            f"road.file {file}: {count:,} positions to be held in memory, more than the "
            f"{MAX_POINTS:,} that may be; cut the road first, or write its heights as a matrix by rows"
        )
