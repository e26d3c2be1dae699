"""A road placed under the tire: the strip of a run, with run-in and levelling."""

from collections.abc import Iterator
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.levelling import Level, mean_level, wave_level
from tireroad.contact.roads.placement import begun_at, moved_start
from tireroad.contact.roads.texture.levels import Texture, texture_of
from tireroad.contact.roads.texture.repeated import Repeated
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

NOTHING = 1e-9  # m: relief below is rounding
# Smallest number of pieces that a strip is divided into for its bounds: the level varies slowly
# over one.
PIECES = 64
LONGEST = 0.25  # m, longest piece
# The reported texture: longest and shortest profile (m), most points, largest spacing (m).
_SEEN, _LEAST_SEEN, _MOST_SEEN, _COARSEST = 20.0, 0.1, 100_000, 1e-3


class Bounded(Protocol):
    """Bounds (m) of the heights in a strip of road."""

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...


class Road(Bounded, Protocol):
    """Heights (m) at x in rolling direction and y to the left (m).

    `extent` ((x0, x1), (y0, y1)) in m, may be infinite; `spacing` (m) the shortest length resolved.
    """

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]: ...

    @property
    def spacing(self) -> float: ...

    def height(self, x: Array, y: Array) -> Array: ...

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Road": ...


def is_level(road: Bounded, x0: float, x1: float, y0: float, y1: float) -> bool:
    """Whether a strip of road has one height, by its own bounds."""
    strip = x0, x1, y0, y1
    return bool(0.0 <= road.highest(*strip) - road.lowest(*strip) < NOTHING)


class RoadUnderTire:
    """A road placed under the axle; `prepare` cuts out the strip that a run passes over.

    start, lateral, run_in, offset, drum_radius (m), drum: see Placement; datum: "mean" subtracts
    the strip's mean height, "zero" nothing; longest_wave (m): longer waves are removed too.
    InputError for an unknown datum or a negative run_in.
    """

    def __init__(
        self,
        road: Road,
        *,
        start: float | None = None,
        lateral: float = 0.0,
        run_in: float = 0.1,
        offset: float = 0.0,
        datum: str = "zero",
        longest_wave: float | None = None,
        drum_radius: float | None = None,
        drum: str = "outside",
    ) -> None:
        if datum not in ("mean", "zero"):
            raise InputError(f'road: datum = "{datum}" is unknown: take "mean" or "zero"')
        if not run_in >= 0.0:
            raise InputError(f"road: run_in {run_in:g} m must not be negative")
        self._start = begun_at(road, start)
        self._moved = start is None and self._start != 0.0
        if drum_radius is not None and np.isfinite(road.spacing):
            road = Repeated(road, 2 * np.pi * drum_radius)
        self.road, self._datum, self.drum = road, datum, drum
        self._lateral, self.run_in, self._offset = lateral, run_in, offset
        self._longest_wave = longest_wave

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "PreparedRoad":
        """The strip of a run, in distances (m) from the axle's start and from the tire's middle.

        x0 is the foremost point of the patch at t = 0, ahead of the axle, x1 the farthest it gets,
        y0 and y1 its sides. Up to x0 the road is flat, whatever the file contains there, because
        the tire stands on it at t = 0. InputError if the road is too short, too narrow or has holes
        there.
        """
        if not (x0 <= x1 and y0 <= y1):
            raise InputError(f"road: empty strip, x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m")
        strip = (
            x0 + self._start,
            x1 + self._start,
            y0 + self._lateral,
            y1 + self._lateral,
        )
        road = self.road.prepare(*strip)
        prepared = PreparedRoad(
            road,
            shift=(self._start, self._lateral),
            level=self._level(road, strip),
            offset=self._offset,
            reach=(x0, x1),
            run_in=self.run_in,
        )
        if self._moved:
            prepared.notes += (moved_start(self._start),)
        return prepared

    def _level(self, road: Road, strip: tuple[float, float, float, float]) -> Level | None:
        if self._longest_wave is not None:
            return wave_level(road, *strip, self._longest_wave)
        return mean_level(road, *strip) if self._datum == "mean" else None


class PreparedRoad:
    """z(x, y) = s((x - lead)/run_in) [h(x + start, y + lateral) + offset - level] in m.

    s is the smoothstep, x the distance from the axle's starting point, y from the tire's middle.
    Also a `Road`, except for `prepare`. `filled` counts the holes that were filled; `notes`
    describes how else a measured road was processed.
    """

    def __init__(
        self,
        road: Road,
        shift: tuple[float, float],
        level: Level | None,
        offset: float,
        reach: tuple[float, float],
        run_in: float,
    ) -> None:
        self._road, self._shift, self._level, self._offset = road, shift, level, offset
        self._lead, self._run_in = reach[0], run_in
        self.end = reach[1]  # the largest x (m) at which `height` may be evaluated
        self._span = (reach[1] - reach[0]) * (1.0 + 1e-9)
        self.spacing = road.spacing
        self.filled: int = getattr(road, "filled", 0)
        self.notes: tuple[str, ...] = getattr(road, "notes", ())
        self._shortest: float = getattr(road, "shortest_wave", 0.0)

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((x0, x1), (y0, y1)) of the road in the axle's coordinates, m."""
        (x0, x1), (y0, y1) = self._road.extent
        dx, dy = self._shift
        return (x0 - dx, x1 - dx), (y0 - dy, y1 - dy)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) over the static road plane at x, y (m) of equal shape.

        ValueError for x beyond the prepared strip, where the border would be mistaken for the road.
        """
        ahead = np.asarray(x) - self._lead
        farthest = ahead.max(initial=0.0)
        if farthest > self._span:
            raise ValueError(f"x = {farthest + self._lead:g} m lies beyond the prepared strip")
        first = self._lead + self._shift[0]
        along = np.maximum(ahead, 0.0) + first
        z = self._road.height(along, np.asarray(y) + self._shift[1])
        if self._offset != 0.0:
            z = z + self._offset
        if self._level is not None:
            z = z - self._level(along)
        if ahead.min(initial=np.inf) >= self._run_in:
            return z
        return z * self._share(ahead)

    def _share(self, ahead: Array) -> Array:
        if self._run_in == 0.0:
            return (ahead > 0.0).astype(float)
        s = np.minimum(np.maximum(ahead / self._run_in, 0.0), 1.0)
        return s * s * s * (10.0 + s * (6.0 * s - 15.0))

    def share(self, along: float) -> float:
        """The share of its height that the run-in leaves at x = `along` (m) of the road itself."""
        return float(self._share(np.array(along - self._shift[0] - self._lead)))

    @property
    def grown(self) -> float:
        """x (m) from which on the heights are whole, behind the run-in."""
        return self._lead + self._run_in

    @property
    def passed(self) -> tuple[float, float]:
        """First and last x (m) of the road itself that the front of the patch passes over."""
        return self._lead + self._shift[0], self.end + self._shift[0]

    @cached_property
    def texture(self) -> Texture | None:
        """Texture of the middle line after the run-in, over at most 20 m.

        None for a road without resolution (flat), or too short for an evaluation.
        """
        first = self.grown
        length = min(self.end - first, _SEEN)
        if not (np.isfinite(self.spacing) and length >= _LEAST_SEEN):
            return None
        pitch = max(min(0.25 * self.spacing, _COARSEST), length / _MOST_SEEN)
        x: Array = np.float64(first) + np.float64(pitch) * np.arange(int(length / pitch))
        return texture_of(self.height(np.asarray(x), np.zeros(len(x))), pitch, self._shortest)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound (m) of the heights in a strip, including the flat start."""
        pieces = self._pieces(x0, x1, y0, y1)
        return max(0.0, *(self._road.highest(*piece) - low for piece, low, _ in pieces))

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound (m) of the heights in a strip, including the flat start."""
        pieces = self._pieces(x0, x1, y0, y1)
        return min(0.0, *(self._road.lowest(*piece) - high for piece, _, high in pieces))

    def _pieces(
        self, x0: float, x1: float, y0: float, y1: float
    ) -> Iterator[tuple[tuple[float, float, float, float], float, float]]:
        """The strip in the road's own coordinates, in pieces with bounds of what is subtracted."""
        dx, dy = self._shift
        count = max(PIECES, int(np.ceil((x1 - x0) / LONGEST))) if self._level else 1
        edges = np.linspace(x0 + dx, x1 + dx, count + 1)
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            low, high = self._level.bounds(start, end) if self._level else (0.0, 0.0)
            yield (start, end, y0 + dy, y1 + dy), low - self._offset, high - self._offset
