"""The road as the tire meets it: any `Road`, shifted under the axle, levelled and eased in."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contact.cobblestones import Blocks, Cobblestones
from contact.flat import Flat
from contact.grid import Grid
from contact.grid_file import read_grid
from contact.opencrg import read_opencrg
from contact.sine import Sine
from fem.errors import InputError

Array = NDArray[np.float64]

# The mean height of the strip is taken over at most this many points.
MEAN_POINTS = 1_000_000


class Road(Protocol):
    """Heights (m) at x in rolling direction from the road's beginning and y to the left (m).

    `extent` ((x0, x1), (y0, y1)) in m, may be infinite; `spacing` (m) the shortest length resolved.
    """

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]: ...

    @property
    def spacing(self) -> float: ...

    def height(self, x: Array, y: Array) -> Array: ...

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Road": ...


class RoadUnderTire:
    """A road placed under the axle; `prepare` cuts out the strip a run drives over.

    start (m): the road's x under the axle at t = 0; lateral (m): the road's y under the tire's
    middle; run_in (m): the length over which heights are eased in, so that the run starts at rest;
    offset (m): added to all heights; datum: "mean" subtracts the strip's mean height, "zero"
    nothing.
    """

    def __init__(
        self,
        road: Road,
        *,
        start: float = 0.0,
        lateral: float = 0.0,
        run_in: float = 0.1,
        offset: float = 0.0,
        datum: str = "zero",
    ) -> None:
        if datum not in ("mean", "zero"):
            raise InputError(f'road: datum = "{datum}" is unknown: take "mean" or "zero"')
        if not run_in >= 0.0:
            raise InputError(f"road: run_in {run_in:g} m must not be negative")
        self.road, self._datum = road, datum
        self._start, self._lateral, self._run_in, self._offset = start, lateral, run_in, offset

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "PreparedRoad":
        """The strip of a run, in distances (m) from the axle's start and from the tire's middle.

        x0 is the foremost point of the patch at t = 0, ahead of the axle, x1 the farthest it gets,
        y0 and y1 its sides. Up to x0 the road is flat, whatever the file holds there: the tire
        stands on it at t = 0. InputError when the road is too short, too narrow or has holes there.
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
        level = _mean(road, *strip) if self._datum == "mean" else 0.0
        return PreparedRoad(
            road,
            shift=(self._start, self._lateral),
            level=self._offset - level,
            reach=(x0, x1),
            run_in=self._run_in,
        )


class PreparedRoad:
    """z(x, y) = s((x - lead)/run_in) [h(x + start, y + lateral) + level] in m, s the smoothstep.

    x is the distance from the axle's starting point, y from the tire's middle. Also a `Road`, apart
    from `prepare`. `filled` counts the holes that were filled, `level` is what was added to all
    heights.
    """

    def __init__(
        self,
        road: Road,
        shift: tuple[float, float],
        level: float,
        reach: tuple[float, float],
        run_in: float,
    ) -> None:
        self._road, self._shift, self.level = road, shift, level
        self._lead, self._run_in = reach[0], run_in
        self._span = (reach[1] - reach[0]) * (1.0 + 1e-9)
        self.spacing = road.spacing
        self.filled: int = getattr(road, "filled", 0)

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((x0, x1), (y0, y1)) of the road in the axle's coordinates, m."""
        (x0, x1), (y0, y1) = self._road.extent
        dx, dy = self._shift
        return (x0 - dx, x1 - dx), (y0 - dy, y1 - dy)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) over the static road plane at x, y (m) of equal shape.

        ValueError for x beyond the strip that was prepared: the border would pass for the road.
        """
        ahead = np.asarray(x) - self._lead
        farthest = ahead.max(initial=0.0)
        if farthest > self._span:
            raise ValueError(f"x = {farthest + self._lead:g} m lies beyond the prepared strip")
        first = self._lead + self._shift[0]
        z = self._road.height(np.maximum(ahead, 0.0) + first, np.asarray(y) + self._shift[1])
        if self.level != 0.0:
            z = z + self.level
        if ahead.min(initial=np.inf) >= self._run_in:
            return z
        return z * self._share(ahead)

    def _share(self, ahead: Array) -> Array:
        if self._run_in == 0.0:
            return (ahead > 0.0).astype(float)
        s = np.minimum(np.maximum(ahead / self._run_in, 0.0), 1.0)
        return s * s * s * (10.0 + s * (6.0 * s - 15.0))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound (m) of the heights in a strip, the flat start included."""
        dx, dy = self._shift
        return max(0.0, self._road.highest(x0 + dx, x1 + dx, y0 + dy, y1 + dy) + self.level)

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound (m) of the heights in a strip, the flat start included."""
        dx, dy = self._shift
        return min(0.0, self._road.lowest(x0 + dx, x1 + dx, y0 + dy, y1 + dy) + self.level)


def make_road(spec: Any = None, /, **keys: Any) -> RoadUnderTire:
    """The road of a scene, make_road(scene.road), or of keys, make_road(kind="flat").

    Read are the attributes kind, start, lateral, run_in, offset, datum, and by kind: sine:
    amplitude and wavelength (m), phase (degrees); cobblestones: block_length, block_width,
    joint_width, joint_depth, edge_radius, height_scatter (m), stagger, seed; grid and crg: file,
    holes, end.
    What is absent or None takes its default; datum is "mean" for files and "zero" otherwise.
    InputError for an unknown kind, a missing key or a file that cannot be used.
    """
    spec = SimpleNamespace(**keys) if spec is None else spec
    kind = _get(spec, "kind")
    if kind not in _MAKERS:
        raise InputError(f'road.kind = "{kind}" is not supported: take one of {", ".join(_MAKERS)}')
    return RoadUnderTire(
        _MAKERS[kind](spec),
        start=_get(spec, "start", 0.0),
        lateral=_get(spec, "lateral", 0.0),
        run_in=_get(spec, "run_in", 0.1),
        offset=_get(spec, "offset", 0.0),
        datum=_get(spec, "datum", "mean" if kind in ("grid", "crg") else "zero"),
    )


def _get(spec: Any, key: str, default: Any = None) -> Any:
    value = getattr(spec, key, None)
    if value is None and default is None:
        raise InputError(f"road.{key} is missing")
    return default if value is None else value


def _sine(spec: Any) -> Sine:
    phase = np.deg2rad(_get(spec, "phase", 0.0))
    return Sine(_get(spec, "amplitude"), _get(spec, "wavelength"), float(phase))


def _cobblestones(spec: Any) -> Cobblestones:
    return Cobblestones(
        Blocks(
            length=_get(spec, "block_length"),
            width=_get(spec, "block_width"),
            joint_width=_get(spec, "joint_width"),
            joint_depth=_get(spec, "joint_depth"),
            edge_radius=_get(spec, "edge_radius", 0.0),
            scatter=_get(spec, "height_scatter", 0.0),
            stagger=_get(spec, "stagger", True),
            seed=_get(spec, "seed", 0),
        )
    )


def _from_file(reader: Any) -> Any:
    def make(spec: Any) -> Grid:
        return reader(
            Path(_get(spec, "file")),
            holes=_get(spec, "holes", "refuse"),
            end=_get(spec, "end", "refuse"),
        )

    return make


_MAKERS = {
    "flat": lambda spec: Flat(),
    "sine": _sine,
    "cobblestones": _cobblestones,
    "grid": _from_file(read_grid),
    "crg": _from_file(read_opencrg),
}


def _mean(road: Road, x0: float, x1: float, y0: float, y1: float) -> float:
    """Mean height (m) over the strip's area, at half the road's spacing where affordable."""
    step = 0.5 * road.spacing
    if not np.isfinite(step):
        return 0.0
    counts = [max(int(np.ceil(d / step)), 1) for d in (x1 - x0, y1 - y0)]
    excess = np.sqrt(max(1.0, counts[0] * counts[1] / MEAN_POINTS))
    nx, ny = (max(int(c / excess), 1) for c in counts)
    x = x0 + (np.arange(nx) + 0.5) * (x1 - x0) / nx
    y = y0 + (np.arange(ny) + 0.5) * (y1 - y0) / ny
    total = sum(road.height(x, np.full(nx, yj)).sum() for yj in y)
    return float(total) / (nx * ny)
