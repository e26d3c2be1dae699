"""A road measured along a line by a laser: cleaned, documented, and widened to the tire."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.kinds.measured import CODES, MISSING_DOC
from tireroad.contact.roads.meaning import UNITS, ReadAs
from tireroad.contact.roads.profile_file import HEIGHTS, ProfileKeys, check_relief, read_profile
from tireroad.contact.roads.random_texture import cleaned, memory, widened
from tireroad.contact.roads.road import Levelled, road_kind
from tireroad.contact.roads.under_tire import DEVIATION, mean_profile_depth
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import (
    ParameterError,
    choice,
    filename,
    integer,
    number,
    numbers,
)

Array = NDArray[np.float64]
PITCH = 4e-5  # m between heights, where neither file nor scene says
MOST_HEIGHTS = 20_000_000  # of a widened profile: 160 MB, and four times that during its making
ENDINGS = ".csv", ".txt", ".dat", ".asc", ".prn", ".tsv", ".xyz"
_MANY = 100  # places of a file whose x may be rounded
_FINEST = 5e-6  # m between heights; less is x in another unit
_EVEN = 0.02  # of a step: tolerance of even positions


@dataclass(frozen=True)
class _Line:
    """Heights (n,) m every `pitch` m from x = `first` m on."""

    profile: Array
    pitch: float
    first: float = 0.0


@road_kind("laser", "heights measured along one line by a laser, cleaned and widened to the tire")
class LaserFile(Levelled):
    """The file and how it is read, cleaned, and extended across."""

    file: str | None = filename(
        "measured profile (.csv, .txt, .dat): one height per line, x and a height, or columns with headings"
    )
    pitch: float | None = number(
        None, "m", "distance between heights, where the file has no x; absent: what the file says, else 0.04 mm",
        least=1e-7, most=0.1,
    )  # fmt: skip
    length_unit: str | None = choice(
        None, tuple(UNITS), "unit of x in the file; absent: what the file says, else mm"
    )
    height_unit: str | None = choice(
        None,
        tuple(UNITS),
        "unit of the heights in the file; absent: what the file says, else mm, if the heights can be",
    )
    missing: tuple[float, ...] | None = numbers(MISSING_DOC, "-", CODES, None)
    outlier: float = number(
        8.0, "-", "a height is an outlier this many times the usual distance (1.48 times the median) from "
        "the median of its 11 neighbours", least=3, most=1e6,
    )  # fmt: skip
    longest_gap: float = number(
        0.005, "m", "gaps up to this length are bridged by straight lines; longer ones are an error",
        least=0, most=10,
    )  # fmt: skip
    shortest_wave: float = number(
        0.002, "m", "shorter waves are filtered out, and the profile is sampled at a quarter of it",
        least=1e-5, most=1,
    )  # fmt: skip
    across: str = choice(
        "isotropic", ("isotropic", "ruts"), "beside the line: a random surface of the same roughness with the line in its middle; or its heights across the "
        "whole width",
    )  # fmt: skip
    width: float = number(0.4, "m", "width of the road made of the line", least=0.01, most=5)
    seed: int = integer(0, "seed of the surface beside the line", least=0, most=2**31 - 1)
    end: str = choice(
        "refuse", ("refuse", "mirror"), "a run longer than the road: an error, or the road mirrored"
    )

    def validate(self) -> None:
        """Require a file."""
        if self.file is None:
            raise ParameterError("file", 'is missing: name a measured line by file = "…"')

    @property
    def reads(self) -> Path:
        """Path of the file."""
        return Path(self.file or "")

    def make(self) -> Grid:
        """The road, with the processing of the measurement in its `notes`.

        InputError if the measurement cannot be used.
        """
        source = f"road.file {self.file}"
        line, notes, readings = self._read(self.reads, source)
        sound = cleaned(line.profile, line.pitch, self.outlier, self.longest_gap, source)
        profile, pitch = self._resampled(sound.profile, line.pitch, source)
        depth = mean_profile_depth(sound.profile, line.pitch)
        if self.across == "ruts":
            y = np.array([-0.5, 0.5]) * self.width
            z, how = np.repeat(profile[:, None], 2, axis=1), "the same all across (ruts)"
        else:
            self._check_size(len(profile), pitch)
            y, z = widened(profile, pitch, self.width, self.seed)
            how = f"across an isotropic random surface as rough as the line, which is its middle (seed {self.seed})"
        x: Array = np.float64(line.first) + np.float64(pitch) * np.arange(len(profile))
        road = Grid(x, y, z, end=self.end, source=source)
        road.making = 0.0 if self.across == "ruts" else memory(len(profile), pitch, self.width)
        said = [] if depth is None else [f"mean profile depth as measured {1e3 * depth:.3g} mm"]
        road.readings = readings
        road.notes = (*notes, sound.summary, f"extended to {self.width:g} m: {how}", *said)
        return road

    def _read(self, path: Path, source: str) -> tuple[_Line, list[str], tuple[ReadAs, ...]]:
        if not path.is_file():
            raise InputError(f"{source}: no such file")
        if path.suffix.lower() not in ENDINGS:
            raise InputError(f"{source}: the ending {path.suffix!r} is not {', '.join(ENDINGS)}")
        keys = ProfileKeys(self.length_unit, self.height_unit, self.missing, self.pitch)
        measured = read_profile(path, source, keys)
        profile, notes = measured.heights, list(measured.notes)
        if measured.assumed:
            check_relief(profile, HEIGHTS, source)
        if measured.x is None:
            pitch = measured.pitch or self.pitch
            if pitch is None:
                pitch = PITCH
                notes.append(f"heights every {1e3 * pitch:g} mm: assumed (road.pitch)")
            every = ReadAs("x", "none in the file", f"every {1e3 * pitch:g} mm")
            return _Line(profile, pitch), notes, (*measured.readings, every)
        x = measured.x
        if not np.isfinite(x).all():
            line = int(measured.lines[np.flatnonzero(~np.isfinite(x))[0]])
            raise InputError(f"{source}, line {line}: x is missing")
        pitch = (x[-1] - x[0]) / (len(x) - 1)
        if measured.x_assumed and 0 < pitch < _FINEST:
            raise InputError(
                f"{source}: heights every {1e6 * pitch:.3g} um, {x[-1] - x[0]:.3g} m long, where x is read in mm: is it in m? "
                "Say road.length_unit"
            )
        off = np.abs(x - x[0] - pitch * np.arange(len(x)))
        # Both ends are rounded, too. Few places tell no rounding from uneven steps.
        rounded = 2.1 * measured.rounding if len(x) >= _MANY else 0.0
        steps = np.abs(np.diff(x) - pitch)
        if not (pitch > 0 and (steps.max() < _EVEN * pitch or off.max() <= rounded)):
            worst = int(steps.argmax())
            raise InputError(
                f"{source}, line {int(measured.lines[worst + 1])}: x must ascend in even steps, within {100 * _EVEN:g} % or "
                f"its last digit, and here goes on by {x[worst + 1] - x[worst]:.4g} m where {pitch:.4g} m is usual"
            )
        if steps.max() >= _EVEN * pitch:
            notes.append(f"x is rounded; its even steps are {1e3 * pitch:.5g} mm")
        return _Line(profile, float(pitch), float(x[0])), notes, measured.readings

    def _resampled(self, profile: Array, pitch: float, source: str) -> tuple[Array, float]:
        """Without waves shorter than `shortest_wave` (ISO 16610-21), sampled at a quarter of it."""
        from scipy.ndimage import gaussian_filter1d  # not needed to read a scene

        step = max(math.floor(self.shortest_wave / 4 / pitch), 1)
        if len(profile) <= 15 * step:  # before the filter, which is as long as the shortest wave
            raise InputError(
                f"{source}: {len(profile) * pitch:.3g} m are too short a road for waves of "
                f"{self.shortest_wave:g} m"
            )
        if step > 1:
            profile = gaussian_filter1d(
                profile, DEVIATION * self.shortest_wave / pitch, mode="nearest"
            )
            profile, pitch = profile[::step], pitch * step
        return profile, pitch

    def _check_size(self, count: int, pitch: float) -> None:
        heights = count * self.width / pitch
        if heights > MOST_HEIGHTS:
            raise InputError(
                f"road: {count * pitch:.4g} m of {self.width:g} m width every {1e3 * pitch:.3g} mm are "
                f"{heights:.3g} heights, more than {MOST_HEIGHTS:g}: take a longer road.shortest_wave, a smaller "
                'road.width or across = "ruts", or cut the file'
            )
