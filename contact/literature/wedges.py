"""Wedges of the tire and the road volume in them (Mancosu and Minen 1998, 2nd model; thesis 3.1).

The tire is cut into wedges around the axle. The volume in which a wedge of the unloaded tire
intersects the road gives its force by a look-up table, here from the finite elements pressed on a
plane at several heights. Per metre of circumference, the area A of a wedge's cross-section inside
the road and the force F that it carries form pairs, over all wedges and heights; the table is their
mean in classes of A, made monotone. Wedges are independent of each other, and the tire has no
response in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
_CLASSES = 24


@dataclass(frozen=True)
class LookUp:
    """Force (k,) N/m over area (k,) m^2, both from 0.

    `scatter`: rms deviation of the pairs from it, relative to their largest force.
    """

    area: Array
    force: Array
    scatter: float

    def __call__(self, area: Array) -> Array:
        """Force, N/m; extrapolated with the last slope beyond the largest area."""
        slope = (self.force[-1] - self.force[-2]) / (self.area[-1] - self.area[-2])
        beyond = np.maximum(area - self.area[-1], 0.0)
        return np.interp(area, self.area, self.force) + slope * beyond


def look_up(area: Array, force: Array) -> LookUp:
    """The table from pairs (n,) m^2 and N/m. InputError if fewer than three are inside the road."""
    inside = area > 0
    if inside.sum() < 3:
        raise InputError("wedges: fewer than three of them meet the road: press further")
    a, f = area[inside], force[inside]
    order = np.argsort(a)
    groups = np.array_split(order, min(_CLASSES, len(order)))
    x = np.array([a[group].mean() for group in groups])
    y = _monotone(np.array([f[group].mean() for group in groups]))
    grid, values = np.concatenate([[0.0], x]), np.concatenate([[0.0], y])
    left = f - np.interp(a, grid, values)
    return LookUp(grid, values, float(np.sqrt(np.mean(left**2)) / f.max()))


def _monotone(values: Array) -> Array:
    """The least-squares nearest ascending sequence, by pooling neighbours that descend."""
    pools: list[list[float]] = []
    for value in values:
        pools.append([value, 1.0])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (a, m), (b, n) = pools[-2:]
            pools[-2:] = [[(a * m + b * n) / (m + n), m + n]]
    return np.concatenate([np.full(int(n), a) for a, n in pools])


@dataclass(frozen=True, kw_only=True)
class Wedges:
    """The face of the unloaded tire as seen from the road.

    `x` (a,) m of the wedges, `length` (a,) m of each around the tire, `y` (a, b) and `height`
    (a, b) m over the plane of the road, `width` (a, b) m that each point represents.
    """

    x: Array
    length: Array
    y: Array
    height: Array
    width: Array

    def area(self, road: Array) -> Array:
        """Area (a,) m^2 of each wedge inside a road of heights (a, b) m under its points."""
        return (np.maximum(road - self.height, 0.0) * self.width).sum(axis=1)

    def force(self, road: Array, table: LookUp) -> float:
        """Total force, N."""
        return float(table(self.area(road)) @ self.length)
