"""Road heights on a grid from .npz, .csv and .h5 files, read as data and checked before use."""

import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contact.grid import Grid
from fem.errors import InputError

Array = NDArray[np.float64]

# 4 GB of doubles: a larger road has to be cut before it is driven on.
MAX_VALUES = 500_000_000
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


def _read_npz(file: Path) -> tuple[Array, Array, Array]:
    with zipfile.ZipFile(file) as archive:
        sizes = {member.filename: member.file_size for member in archive.infolist()}
    missing = [name for name in "xyz" if f"{name}.npy" not in sizes]
    if missing:
        raise InputError(f"road.file {file}: no array {', '.join(missing)}; x, y and z are needed")
    _check_count(file, sum(sizes.values()) // 8)
    try:
        with np.load(file, allow_pickle=False) as arrays:
            return tuple(np.asarray(arrays[name], dtype=float) for name in "xyz")
    except (ValueError, TypeError) as error:
        raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error


def _read_hdf5(file: Path) -> tuple[Array, Array, Array]:
    import h5py  # only for the one format that needs it

    with h5py.File(file, "r") as store:
        missing = [n for n in "xyz" if not isinstance(store.get(n), h5py.Dataset)]
        if missing:
            raise InputError(
                f"road.file {file}: no dataset {', '.join(missing)}; x, y and z are needed"
            )
        _check_count(file, sum(store[name].size for name in "xyz"))
        try:
            return tuple(np.asarray(store[name][()], dtype=float) for name in "xyz")
        except (ValueError, TypeError) as error:
            raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error


def _read_csv(file: Path) -> tuple[Array, Array, Array]:
    _check_count(file, file.stat().st_size // 2)
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"road.file {file}: is no text file (byte {error.start})") from error
    numbered = [
        (i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")
    ]
    if len(numbered) < 3:
        raise InputError(f"road.file {file}: {len(numbered)} lines of data, at least 3 are needed")
    header = [field.strip().lower() for field in numbered[0][1].split(",")]
    if header == ["x", "y", "z"]:
        return _points(file, _numbers(file, numbered[1:], 3))
    corner, _, rest = numbered[0][1].partition(",")
    width = len(header)
    # The corner's text is nobody's number: a zero takes its place.
    table = _numbers(file, [(numbered[0][0], f"0,{rest}"), *numbered[1:]], width)
    return table[1:, 0], table[0, 1:], table[1:, 1:]


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


def _check_count(file: Path, values: int) -> None:
    if values > MAX_VALUES:
        raise InputError(
            f"road.file {file}: about {values:,} numbers, more than the {MAX_VALUES:,} that are "
            "read; cut the road first"
        )
