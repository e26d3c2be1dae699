"""A road measured on a regular grid, with bilinear heights in between."""

import copy

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.placement import shown
from tireroad.contact.roads.rows import ArrayRows, Rows
from tireroad.contact.roads.window import Window
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Axes that deviate from even spacing by less than this fraction of a step count as even, because
# files round positions.
EVEN = 1e-4

# Limits of steps and positions of a measured road, m; anything beyond is damage.
FINEST, FARTHEST = 1e-6, 1e8


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

    def part(self, places: slice) -> "Axis":
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

    z may be rows in a file (contact.roads.rows), read as the road rolls by, 32 MB at a time.
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
        self.making = 0.0  # bytes of memory that making it took

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

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Grid":
        """The road of the strip alone (m), without holes, for fast evaluation in it.

        InputError if the strip leaves the road or contains holes that are to be refused.
        """
        self._check_strip(x0, x1, y0, y1)
        rows, columns = self._cells(x0, x1, y0, y1)
        window = self._over(rows, columns)
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
        raise InputError(f"{source}: z has shape {shape}, x and y ask for {(len(x), len(y))}")


def _check_choice(key: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f'road: {key} = "{value}" is unknown: take {" or ".join(choices)}')
