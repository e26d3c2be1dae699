"""Road heights on a grid from .npz, .csv and .h5 files, read as data and checked before use."""

from pathlib import Path

from tireroad.contact.roads.files.archive import UNREADABLE
from tireroad.contact.roads.files.grid_csv import read_csv
from tireroad.contact.roads.files.grid_hdf5 import read_hdf5
from tireroad.contact.roads.files.grid_npz import read_npz
from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.plausible import check_plausible
from tireroad.contact.roads.rows import Scaled
from tireroad.fem.errors import InputError

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
    file (contact.roads.rows.Spool). Only a list of points is kept in memory, at most 10 million.
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
