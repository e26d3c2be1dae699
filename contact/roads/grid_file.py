"""Files of heights on a grid, .npz, .csv and .h5: read in pieces and checked for plausibility."""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import (
    MAX_POINTS,
    PIECE,
    ArrayRows,
    FileRows,
    Grid,
    Packed,
    Rows,
    Scaled,
    Spool,
    check_count,
)
from tireroad.fem.errors import InputError

if TYPE_CHECKING:
    import h5py


Array = NDArray[np.float64]

WIDEST = 50.0  # m: a measured road across; a texture of 300 mm is 300 m wide when read as metres
# Median of |dz|/dx or |dz|/dy between neighbours, the larger: ruts and steps have but one of them.
# Measured: 0.03 on Belgian block every 10 mm, about 0.2 on a texture of 0.5 mm rms every 0.5 mm.
# Millimetres read as metres give a thousand times that.
STEEPEST = 5.0
# Median over the rows of their relief over the width: a kerb of 0.15 m on 0.3 m has 0.5.
ROUGHEST = 2.0
HIGHEST = 1e4  # m above sea level; larger values are damage
SAMPLES = 64  # rows inspected


def check_plausible(
    extent: tuple[float, float],
    steps: tuple[float, float],
    rows: Rows,
    source: str,
    *,
    lengths: bool = True,
    heights: str | None = "m",
) -> None:
    """InputError if a road cannot be in the unit in which it was read.

    `extent` (m) along and across, `steps` (m) between points, `rows` of heights (m), of which 64
    are read. `lengths`: whether their unit was assumed rather than given; `heights`: the unit that
    was assumed for them, None: it was given. The message then names the keys that give it. Heights
    beyond 10 km are refused in any case.
    """
    if lengths and extent[1] > WIDEST:
        raise InputError(
            f"{source}: x and y were read as metres, and the road is {extent[1]:.4g} m wide, which is "
            f'more than {WIDEST:g} m: if the file is in millimetres say length_unit = "mm" in [road]; '
            'if it really is in metres say length_unit = "m"'
        )
    count = rows.shape[0]
    picked = np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).astype(int))
    pairs = [rows.read(i, min(i + 2, count)) for i in picked]
    z = np.concatenate([pair[:1] for pair in pairs])
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.nanmax(np.abs(z), initial=0.0)
        differ = (
            _median(np.concatenate([np.diff(pair, axis=0) for pair in pairs])),
            _median(np.diff(z)),
        )
    slope, apart, height = max(
        (dz / step, step, dz) for dz, step in zip(differ, steps, strict=True)
    )
    if largest > HIGHEST:
        raise InputError(
            f"{source}: heights of {largest:.3g} m are implausible for a road: check height_unit"
        )
    relief = np.ptp(z[~np.isnan(z).any(axis=1)], axis=1)
    if heights and (slope > STEEPEST or _median(relief) > ROUGHEST * extent[1]):
        raise InputError(
            f"{source}: heights were read as {heights}, and in the median they differ by "
            f"{height:.3g} m between neighbours {apart:.3g} m apart, by "
            f"{_median(relief):.3g} m across the road's {extent[1]:.3g} m: say in [road] what they "
            f'are in, height_unit = "mm" or "um"; if they really are in {heights} say height_unit = "{heights}"'
        )


def _median(values: Array) -> float:
    """The median magnitude of the finite values; 0 if there are none."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.median(known)) if known.size else 0.0


# Exceptions of the standard library, numpy and h5py for damaged files; NotImplementedError and
# RuntimeError are zipfile's for damaged version numbers and flags, KeyError is h5py's.
UNREADABLE = (
    OSError,
    EOFError,
    KeyError,
    zipfile.BadZipFile,
    zlib.error,
    NotImplementedError,
    RuntimeError,
)


class Header(NamedTuple):
    """The header of an array in an archive."""

    shape: tuple[int, ...]
    by_columns: bool
    kind: np.dtype
    start: int


def read_header(stream: IO[bytes], info: zipfile.ZipInfo, name: str) -> Header:
    """The header of an array. ValueError if it has no numbers or does not fit the member's size."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0
    if version != (1, 0):
        read = np.lib.format.read_array_header_2_0
    try:
        shape, by_columns, kind = read(stream)
    # numpy parses it as Python text, and passes on any error of the parser.
    except Exception as problem:
        raise ValueError(f"the header of {name} is damaged: {problem}") from problem
    if kind.kind not in "iuf" or 0 in shape:
        raise ValueError(f"{name} is {kind} of shape {shape}")
    start, size = stream.tell(), kind.itemsize
    for length in shape:
        size *= length
    if size != info.file_size - start:
        raise ValueError(
            f"the header of {name} announces {size:,} bytes, the archive {info.file_size - start:,}"
        )
    return Header(shape, by_columns, kind, start)


def read_numbers(archive: zipfile.ZipFile, name: str, most: int) -> Array:
    """The whole array `name`. ValueError as in `read_header` or for more than `most` numbers.

    Also raises the exceptions UNREADABLE.
    """
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > 8 * most + 20_000:
        raise ValueError(f"{name} has {info.file_size:,} bytes, more than {most:,} numbers")
    with archive.open(info) as stream:
        header = read_header(stream, info, name)
        if np.prod(header.shape, dtype=float) > most:
            raise ValueError(f"{name} has the shape {header.shape}, more than {most:,} numbers")
        numbers = np.frombuffer(stream.read(), header.kind)
    return numbers.reshape(header.shape, order="F" if header.by_columns else "C").astype(float)


Line = tuple[int, str]  # line number and text

BLOCK = 4096  # most lines per block
BLOCK_CHARACTERS = 32_000_000  # most characters per block
MAX_LINE = 16_000_000  # characters of a line: about a million heights across the road


def read_csv(file: Path) -> tuple[Array, Array, Rows]:
    """x (nx,), y (ny,) and z (nx, ny) of a text file in the layout given in `grid_file.read_grid`.

    InputError names the line of an error.
    """
    try:
        with file.open(encoding="utf-8-sig") as stream:
            return _csv_rows(file, _lines(file, stream))
    except UnicodeDecodeError as error:
        raise InputError(f"road.file {file}: is not a text file (byte {error.start})") from error


def _lines(file: Path, stream: TextIO) -> Iterator[Line]:
    """Lines of data with their numbers, none longer than MAX_LINE."""
    number = 0
    while line := stream.readline(MAX_LINE + 1):
        number += 1
        if len(line) > MAX_LINE:
            raise InputError(
                f"road.file {file}, line {number}: longer than {MAX_LINE:,} characters; write a line "
                "for each x, or a list of points with the first line x,y,z"
            )
        if line.strip() and not line.startswith("#"):
            yield number, line.rstrip("\r\n")


def _blocks_of_lines(lines: Iterator[Line]) -> Iterator[list[Line]]:
    """Lines in blocks of bounded size."""
    while first := next(lines, None):
        count = max(min(BLOCK, BLOCK_CHARACTERS // (len(first[1]) + 1)), 1)
        yield [first, *islice(lines, count - 1)]


def _csv_rows(file: Path, lines: Iterator[Line]) -> tuple[Array, Array, Rows]:
    """x, y and z from numbered lines of text, block by block."""
    number, first = next(lines, (0, ""))
    if "," not in first:
        raise InputError(
            f"road.file {file}, line {number}: no comma; a matrix has the positions across in its first line, "
            "after a comma, and then a line for each x; a list of points begins with x,y,z"
            if number
            else f"road.file {file}: is empty"
        )
    header = [field.strip().lower() for field in first.split(",")]
    listed = header == ["x", "y", "z"]
    # The text of the corner is ignored: a zero replaces it.
    _, _, rest = first.partition(",")
    if ";" in rest:
        raise InputError(
            f"road.file {file}, line {number}: fields separated by semicolons: take commas, and points in the "
            "numbers instead of decimal commas"
        )
    axis = None if listed else _first_line(file, (number, f"0,{rest}"), len(header))
    positions, spool, count = [], Spool(f"road.file {file}"), 0
    for block in _blocks_of_lines(lines):
        table = _numbers(file, block, len(header))
        count += len(table)
        check_count(file, count)
        positions.append(table if listed else table[:, 0])
        if axis is not None and axis.size:
            spool.add(table[:, 1:])
    if count < 2:
        raise InputError(f"road.file {file}: {count + 1} lines of data, at least 3 are needed")
    if axis is None:
        x, y, z = _points(file, np.concatenate(positions))
        return x, y, ArrayRows(z)
    return np.concatenate(positions), axis, spool.rows()


def _first_line(file: Path, line: Line, width: int) -> Array:
    """The positions across of a matrix. InputError explains the layout if they do not ascend."""
    try:
        axis = _numbers(file, [line], width)[0, 1:]
    except InputError as error:
        raise InputError(
            f"{error}; a list of points begins with the line x,y,z, a matrix with a corner that is not read, then the "
            "y of its columns"
        ) from error
    if len(axis) > 1 and not np.all(np.diff(axis) > 0):
        raise InputError(
            f"road.file {file}, line {line[0]}: the first line must hold a corner that is not read, "
            "then the ascending y of the columns; each further line one x, then its heights. Is this "
            "a plain matrix of heights? Then add the x and the y"
        )
    return axis


def _numbers(file: Path, numbered: list[Line], width: int) -> Array:
    """(lines, width) numbers; InputError names the line of the first field that is not a number."""
    if all(line.count(",") == width - 1 for _, line in numbered):
        try:
            table = np.loadtxt(
                [line for _, line in numbered], delimiter=",", comments=None, ndmin=2, dtype=float
            )
        except ValueError:
            pass  # again, slowly, to find the line and the wording
        else:
            if table.shape == (len(numbered), width):
                return table
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
    """The grid of a list of points, which must hold each combination of x and y exactly once."""
    if not np.all(np.isfinite(table[:, :2])):
        raise InputError(f"road.file {file}: x and y must be finite numbers")
    x, i = np.unique(table[:, 0], return_inverse=True)
    y, j = np.unique(table[:, 1], return_inverse=True)
    full = len(x) * len(y) == len(table)
    count = np.zeros((len(x), len(y)) if full else (0, 0), dtype=int)
    if full:
        np.add.at(count, (i, j), 1)
    if not full or not np.all(count == 1):
        raise InputError(
            f"road.file {file}: {len(table)} points do not fill the grid of their {len(x)} x and "
            f"{len(y)} y once each; list every point, nan where the height is missing"
        )
    z = np.empty(count.shape)
    z[i, j] = table[:, 2]
    return x, y, z


def read_npz(file: Path) -> tuple[Array, Array, Rows]:
    """The arrays x (nx,), y (ny,) and z (nx, ny) of an archive; z stays in the file if possible.

    InputError for missing arrays, arrays without numbers, and headers that announce other sizes
    than the archive holds.
    """
    with zipfile.ZipFile(file) as archive:
        members = {member.filename for member in archive.infolist()}
        missing = [name for name in "xyz" if f"{name}.npy" not in members]
        if missing:
            names = ", ".join(missing)
            raise InputError(f"road.file {file}: no array {names}; x, y and z are needed")
        try:
            x, y = (read_numbers(archive, name, MAX_POINTS) for name in "xy")
            return x, y, _rows(file, archive)
        except (ValueError, TypeError) as error:
            raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error


def _rows(file: Path, archive: zipfile.ZipFile) -> Rows:
    """z, left in the archive if it is not compressed; all of it is read once, as a check."""
    info = archive.getinfo("z.npy")
    with archive.open(info) as stream:
        header = read_header(stream, info, "z")
        if len(header.shape) != 2:
            raise ValueError(f"z has the shape {header.shape}")
        if header.by_columns:
            check_count(file, header.shape[0] * header.shape[1])
            numbers = np.frombuffer(stream.read(), header.kind)
            return ArrayRows(numbers.reshape(header.shape, order="F").astype(float))
        rows, width = header.shape
        packed = Packed(header.start, header.kind, (rows, width))
        stored = info.compress_type == zipfile.ZIP_STORED
        spool = Spool(f"road.file {file}", 0 if stored else rows * width)
        for block in _blocks(stream, packed):
            if not stored:
                spool.add(block)
    return _stored(file, info, packed) if stored else spool.rows()


def _blocks(stream: IO[bytes], packed: Packed) -> Iterator[Array]:
    """Blocks of rows in their order; reading past the last lets the archive verify its checksum."""
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
    """Rows of an uncompressed member of an archive.

    Its local header has the lengths of two variable fields at byte 26.
    """
    with file.open("rb") as stream:
        stream.seek(info.header_offset + 26)
        name, extra = struct.unpack("<HH", stream.read(4))
    start = info.header_offset + 30 + name + extra + packed.start
    return FileRows(file, packed._replace(start=start))


MAX_CHUNK = 256_000_000  # bytes: HDF5 unpacks a chunk as a whole


class Hdf5Rows:
    """Rows of a dataset that stays in its file."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset, self.shape = dataset, dataset.shape

    def __reduce__(self) -> tuple[Callable[[str, str], Hdf5Rows], tuple[str, str]]:
        """Another process reopens the file."""
        return _opened, (self._dataset.file.filename, self._dataset.name)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return np.asarray(self._dataset[i0:i1], dtype=float)


def _opened(file: str, name: str) -> Hdf5Rows:
    import h5py

    return Hdf5Rows(h5py.File(file, "r")[name])


def read_hdf5(file: Path) -> tuple[Array, Array, Rows]:
    """The datasets x (nx,), y (ny,) and z (nx, ny) in the root of the file.

    Only data of this file are read: links to other files, external and virtual datasets are refused
    (InputError).
    """
    import h5py  # needed for this format only

    store = h5py.File(file, "r")
    datasets = {}
    for name in "xyz":
        if isinstance(store.get(name, getlink=True), h5py.ExternalLink):
            raise InputError(
                f"road.file {file}: {name} is a link to another file; copy it into this"
            )
        datasets[name] = store.get(name)
    missing = [name for name, found in datasets.items() if not isinstance(found, h5py.Dataset)]
    if missing:
        raise InputError(
            f"road.file {file}: no dataset {', '.join(missing)}; x, y and z are needed"
        )
    for name, dataset in datasets.items():
        _check(file, name, dataset)
    try:
        x, y = (np.asarray(datasets[name][()], dtype=float) for name in "xy")
    except (ValueError, TypeError) as error:
        raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error
    return x, y, Hdf5Rows(datasets["z"])


def _check(file: Path, name: str, dataset: h5py.Dataset) -> None:
    """Require numbers of the right shape, in this file, in chunks that fit into memory."""
    if dataset.external or dataset.is_virtual:
        raise InputError(
            f"road.file {file}: the numbers of {name} are in another file; copy them into this one"
        )
    if dataset.dtype.kind not in "iuf" or dataset.ndim != (2 if name == "z" else 1):
        raise InputError(f"road.file {file}: x, y and z must hold numbers, z in rows and columns")
    if name != "z":
        check_count(file, dataset.size)
    if dataset.chunks and np.prod(dataset.chunks, dtype=float) * dataset.dtype.itemsize > MAX_CHUNK:
        raise InputError(
            f"road.file {file}: {name} is in chunks of {dataset.chunks}, more than "
            f"{MAX_CHUNK // 1_000_000} MB each; write it in smaller ones"
        )


UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
READERS = {".npz": read_npz, ".csv": read_csv, ".h5": read_hdf5, ".hdf5": read_hdf5}


def read_grid(
    file: Path,
    holes: str = "refuse",
    end: str = "refuse",
    *,
    length_unit: str | None = None,
    height_unit: str | None = None,
) -> Grid:
    """The road of a grid file: x (nx,) in rolling direction, y (ny,) to the left, z (nx, ny).

    .npz: arrays x, y, z. .h5 or .hdf5: datasets x, y, z in the root. .csv: with a first line
    `x,y,z`, one point per line, every point of the grid once, in any order; otherwise a matrix
    whose first line holds an ignored corner and then all y, and whose further lines hold one x and
    its heights. Lines starting with # are skipped; `nan` is a hole. InputError names the file and
    the place of an error.

    `length_unit` is that of x and y, `height_unit` that of z (one of UNITS). None: metres, and the
    sizes of the road must be plausible in metres (InputError), since a file in millimetres looks
    the same. A height unit of None is the length unit where that is given.

    Heights stay in the file, and the part under the tire is read when needed: for .h5, and for .npz
    as written by numpy.savez. A .csv matrix or a compressed .npz is first converted to a temporary
    file (contact.roads.grid.Spool). Only a list of points is kept in memory, at most 10 million.
    """
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"road.file {file}: the ending {file.suffix!r} is not .npz, .csv, .h5 or .hdf5; for "
            'OpenCRG files take kind = "crg"'
        )
    if not file.is_file():
        raise InputError(f"road.file {file}: no such file")
    source = f"road.file {file}"
    try:
        x, y, rows = reader(file)
        length, height = _factors(length_unit, height_unit)
        if height != 1.0:
            rows = Scaled(rows, height)
        grid = Grid(length * x, length * y, rows, holes=holes, end=end, source=source)
        check_plausible(
            grid.extent_of_file,
            grid.steps,
            rows,
            source,
            lengths=length_unit is None,
            heights=None if height_unit else length_unit or "m",
        )
    except UNREADABLE as error:
        raise InputError(f"{source}: cannot be read ({error}); is it complete?") from error
    return grid


def _factors(length_unit: str | None, height_unit: str | None) -> tuple[float, float]:
    """Metres per unit of x and y, and of z. InputError for an unknown unit."""
    for key, unit in (("length_unit", length_unit), ("height_unit", height_unit)):
        if unit is not None and unit not in UNITS:
            raise InputError(f'road: {key} = "{unit}" is unknown: take one of {", ".join(UNITS)}')
    length = UNITS[length_unit or "m"]
    return length, UNITS[height_unit] if height_unit else length
