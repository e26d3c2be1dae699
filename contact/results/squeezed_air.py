"""Air that is squeezed out between tread and road, from the gaps of a run.

Tread and road pass the axle at the same speed v, and so does the air in the pits of the texture. A column of air of the
area A and height g that is at x at the time t was at x + d at t - d/v, so that it gives off

    q = A [g(x + d, t - d/v) - g(x, t)] v/d    (m3/s),

in the mean over d/v, d being the spacing of the contact points along. A texture that only passes under a tread gives off nothing,
whatever its waves; what does are the tread's entry and exit, and its motion over the pits. Of a tire at rest q = -A dg/dt.
A tread pattern passes as the texture does: gaps are counted from its outer face, without the depth of its grooves.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.kernel import GridPlaces
from tireroad.contact.tread.memory import cubic

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True)
class FootprintCells:
    """Cells of the grid of contact points within the footprint at rest.

    `inside` (nx, ny): the footprint on the grid, rows forwards and columns to the left; `cell` (k, 2): rows and columns of the cells that have a point
    further ahead, `point` and `ahead` (k,): numbers of their points and of those; `spacing` (2,) m along and across.
    """

    inside: NDArray[np.bool_]
    cell: Index
    point: Index
    ahead: Index
    spacing: tuple[float, float]

    @staticmethod
    def of(places: GridPlaces, force: Array) -> FootprintCells:
        """From the first to the last point of each line along that bears a `force` (c,) N at rest.

        Lines that bear none, as those in a groove, are filled as far as the nearest that do are on both sides.
        """
        number = np.full(places.shape, -1)
        row, column = np.divmod(places.place, places.shape[1])
        number[row, column] = np.arange(len(row))
        touches = np.zeros(places.shape, bool)
        touches[row, column] = force > 0
        begun = np.logical_or.accumulate(touches, axis=0)
        inside = begun & np.logical_or.accumulate(touches[::-1], axis=0)[::-1] & (number >= 0)
        bearing = np.flatnonzero(inside.any(axis=0))
        between = np.arange(*bearing[[0, -1]]) if len(bearing) else bearing
        for j in np.setdiff1d(between, bearing):
            right, left = bearing[np.searchsorted(bearing, j) - 1 :][:2]
            inside[:, j] = inside[:, right] & inside[:, left] & (number[:, j] >= 0)
        ahead = np.vstack([number[1:], np.full((1, places.shape[1]), -1)])
        cell = np.argwhere(inside & (ahead >= 0))
        at = cell[:, 0], cell[:, 1]
        return FootprintCells(inside, cell, number[at], ahead[at], places.spacing)

    @property
    def area(self) -> float:
        """Area of a cell, m2."""
        return self.spacing[0] * self.spacing[1]


@dataclass(frozen=True)
class SqueezedAir:
    """Volume velocities of the cells' air over a record.

    `rate` (n, o) m3/s: sums over cells by `sums`, at the ends of the steps; each is the mean over the `over` seconds before;
    `height` (m): mean gap over steps and the cells that are no groove's.
    """

    rate: Array
    over: float
    height: float


def squeezed(
    cells: FootprintCells,
    gaps: Iterable[Array],
    sums: Array,
    speed: float,
    step: float,
    depths: Iterable[Array] | None = None,
) -> SqueezedAir:
    """The air squeezed by `gaps` (n, c) m of successive blocks of steps of `step` s on a road that passes at `speed` m/s.

    `sums` (o, k): by which the cells' volume velocities are added up (dense or sparse); `depths` (n, c) m: what of the gaps is the
    depth of a tread pattern, none by default. Before the first step gaps are as they are then. Not collective.
    """
    over = cells.spacing[0] / speed if speed > 0 else step
    ahead = cells.ahead if speed > 0 else cells.point
    back = int(np.floor(over / step))
    at = 1.0 - (over / step - back)  # from back + 1 steps ago to back
    weights = np.array(cubic(at)) if back and at < 1.0 else np.array([0.0, 1.0 - at, at, 0.0])
    kept: Array | None = None
    rates, total, count = [], 0.0, 0
    for block, depth in zip(gaps, repeat(None) if depths is None else depths, strict=False):
        from_face = block if depth is None else block - depth
        here, there = (np.asarray(from_face[:, some], float) for some in (cells.point, ahead))
        if kept is None:
            kept = np.repeat(there[:1], back + 3, axis=0)
        known = np.vstack([kept, there])
        n = len(there)
        # known[k + back + 3] is the gap of step k of the block.
        before = np.zeros(there.shape)
        for weight, steps in zip(weights, (back + 2, back + 1, back, back - 1), strict=True):
            if weight:
                first = back + 3 - steps
                before += weight * known[first : first + n]
        rates.append((sums @ ((before - here) * (cells.area / over)).T).T)
        land = here if depth is None else here[depth[:, cells.point] <= 0]
        total, count = total + float(land.sum()), count + land.size
        kept = known[n:]
    return SqueezedAir(np.concatenate(rates), over, total / max(count, 1))
