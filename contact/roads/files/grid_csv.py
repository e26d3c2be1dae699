"""Road heights in text files (.csv): a matrix, or a list of points."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.rows import ArrayRows, Rows, Spool, check_count
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
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
        raise InputError(f"road.file {file}: is no text file (byte {error.start})") from error


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


def _blocks(lines: Iterator[Line]) -> Iterator[list[Line]]:
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
    for block in _blocks(lines):
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
