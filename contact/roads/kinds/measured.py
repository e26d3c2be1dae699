"""Measured roads, in files: a regular grid, or OpenCRG."""

from dataclasses import dataclass
from pathlib import Path

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.grid_file import read_grid
from tireroad.contact.roads.meaning import UNITS
from tireroad.contact.roads.opencrg import read_opencrg, referred
from tireroad.contact.roads.road import Levelled, road_kind
from tireroad.fem.parameters import Limits, ParameterError, choice, filename, numbers

_LAYOUT = (
    "measured road: .npz, .h5 or .nc with arrays x, y, z; or .csv, either a matrix (first line a corner entry and all y, then "
    "an x and its heights per line) or a list (headings x, y, z, then one point per line)"
)
MISSING_DOC = (
    'values in the file that mean "no height", such as -9999; nan always does. Absent: what the file says, and values that '
    "look like it are an error; []: there are none"
)
CODES = Limits(-1e40, 1e40)


@dataclass(frozen=True, kw_only=True)
class MeasuredRoad(Levelled):
    """Common parameters of roads in files; `file` is required, `what` names its content."""

    what = "the road"

    holes: str = choice(
        "refuse",
        ("refuse", "fill"),
        "heights missing in the strip driven over: an error, or filled",
    )
    end: str = choice(
        "refuse", ("refuse", "mirror"), "a run longer than the road: an error, or the road mirrored"
    )
    missing: tuple[float, ...] | None = numbers(MISSING_DOC, "-", CODES, None)
    file: str | None  # each kind of file describes it differently

    @property
    def reads(self) -> Path:
        """Path of the file."""
        assert self.file is not None, "validate() asks for it"
        return Path(self.file)

    def validate(self) -> None:
        """Require a file."""
        if self.file is None:
            raise ParameterError("file", f'is missing: name a file for {self.what} by file = "…"')


@road_kind("grid", "heights measured on a regular grid, in a .npz, .csv, .h5 or .nc file")
class GridFile(MeasuredRoad):
    """Heights on a grid, bilinear in between."""

    what = "the measured grid"
    file: str | None = filename(_LAYOUT)
    length_unit: str | None = choice(
        None,
        tuple(UNITS),
        "unit of x and y in the file; absent: what the file says, else m, if the sizes can be metres",
    )
    height_unit: str | None = choice(
        None,
        tuple(UNITS),
        "unit of the heights in the file; absent: what the file says, else as length_unit",
    )

    def make(self) -> Grid:
        """The road in the file; InputError if it cannot be used."""
        return read_grid(
            self.reads,
            holes=self.holes,
            end=self.end,
            length_unit=self.length_unit,
            height_unit=self.height_unit,
            missing=self.missing,
        )


@road_kind("crg", "a measured road in an OpenCRG file")
class CrgFile(MeasuredRoad):
    """Heights along the reference line of an OpenCRG file."""

    what = "the OpenCRG road (crg)"
    file: str | None = filename("measured road in OpenCRG (versions up to 1.2), text or binary")

    @property
    def files(self) -> tuple[Path, ...]:
        """The file, and those that it refers to."""
        return referred(self.reads)

    def make(self) -> Grid:
        """The road in the file; InputError if it cannot be used."""
        return read_opencrg(self.reads, holes=self.holes, end=self.end, missing=self.missing)
