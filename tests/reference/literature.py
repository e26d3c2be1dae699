"""Tread models of the literature, for comparison: shifted springs, asperities, wedges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.law import TreadLaw
from tireroad.fem.errors import InputError

_ACROSS = 21  # points across the square that the sphere is pressed into

Array = NDArray[np.float64]
_NARROW = 0.25  # of the mean width
_PHASES = 64  # over one period, for the mean load
_CLASSES = 24


def fitted_stiffness(law: TreadLaw, radius: float, depth: float) -> float:
    """Stiffness (N/m^3) of the bed that carries as much as the tread under a rigid sphere.

    The sphere has the `radius` (m) and is pressed in by `depth` (m). The complementarity problem is
    solved on 21 x 21 points over the sphere's undeformed cut, sqrt(2 r d).
    """
    reach = 1.1 * np.sqrt(2 * radius * depth)
    pitch = 2 * reach / _ACROSS
    line = (np.arange(_ACROSS) - _ACROSS // 2) * pitch
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    half = np.full((len(x), 2), pitch / 2)
    sunk = depth - (x**2 + y**2) / (2 * radius)
    points = np.stack([x, y], axis=-1)
    matrix = law.matrix(points, half, 4 * reach)
    force = float(ActiveSet(matrix).solve(-sunk).sum())
    return force / float(np.maximum(sunk, 0.0).sum() * pitch**2)


@dataclass(frozen=True)
class Asperities:
    """Means of a profile, m: `height` over H-H, `unevenness` of neighbours, `spacing`, `radius`.

    A profile is cut at its median height by the line H-H, above which half of the road lies. The
    parts above are asperities; each has the height of its apex over the line, and the radius of the
    circle through the apex and both crossings. Those narrower than a quarter of the mean width are
    left out, since the arcs of the others contain them. The road then becomes rows of equal
    spheres, alternately higher and lower; the tire is a surface of constant shape over which they
    pass:

        F(t) = sum_k F_Hertz(d0 + h_k - g(k x_A - v t)),   F_Hertz = 4/3 E* sqrt(r_A) d^1.5,

    where g is its static gap along the middle and d0 follows from the mean load. The response of
    the tire is neglected, and so are all waves but those of the mean spacing: only the vibratory
    part of F is meaningful.
    """

    height: float
    unevenness: float
    spacing: float
    radius: float


def asperities(profile: Array, pitch: float) -> Asperities:
    """The asperities of heights (n,) m every `pitch` m. InputError for fewer than three of them.

    The mean radius is that of the mean curvature, because nearly flat asperities would dominate a
    mean of radii.
    """
    z = profile - np.median(profile)
    above = np.concatenate([[0], (z > 0).astype(int), [0]])
    begin, end = np.flatnonzero(np.diff(above) == 1), np.flatnonzero(np.diff(above) == -1)
    whole = (begin > 0) & (end < len(z))
    begin, end = begin[whole], end[whole]
    if len(begin):
        wide = end - begin >= _NARROW * (end - begin).mean()
        begin, end = begin[wide], end[wide]
    if len(begin) < 3:
        raise InputError(
            f"road: {len(begin)} asperities in {len(z) * pitch:.3g} m, three are needed"
        )
    apex = np.array([a + int(np.argmax(z[a:b])) for a, b in zip(begin, end, strict=True)])
    left, right = _crossing(z, begin - 1), _crossing(z, end - 1)
    curvature = 1.0 / _radius((apex - left) * pitch, (right - apex) * pitch, z[apex])
    return Asperities(
        float(z[apex].mean()),
        float(np.abs(np.diff(z[apex])).mean()),
        float(np.diff(apex).mean() * pitch),
        float(1.0 / curvature.mean()),
    )


def _crossing(z: Array, before: NDArray[np.intp]) -> Array:
    """Positions (in points) where z crosses 0 after the points `before`."""
    return before + z[before] / (z[before] - z[before + 1])


def _radius(left: Array, right: Array, height: Array) -> Array:
    """Radius (m) of the circle through an apex and two points `height` below it: a b c / (4 area).

    The points are at `left` and `right` of the apex, m.
    """
    sides = np.hypot(left, height), np.hypot(right, height), left + right
    return sides[0] * sides[1] * sides[2] / (2 * (left + right) * height)


@dataclass(frozen=True, kw_only=True)
class ShiftedSprings:
    """The model of spheres under a surface of constant shape.

    `road`; effective `modulus` E* Pa; `width` m of the footprint, with rows `spacing` apart; its
    `gap` (m) at positions (m) along it; `length` m from the middle beyond which nothing touches;
    mean `load` N.
    """

    road: Asperities
    modulus: float
    width: float
    gap: Callable[[Array], Array]
    length: float
    load: float

    def forces(self, travelled: Array) -> Array:
        """Total force (n,) N after the distances (n,) m."""
        depth = self._depth()
        return self._at(travelled, depth)

    def _depth(self) -> float:
        """d0, m, at the mean load."""
        way = 2 * self.road.spacing * np.arange(_PHASES) / _PHASES

        def excess(depth: float) -> float:
            return float(self._at(way, depth).mean()) / self.load - 1.0

        high = 1e-5
        while excess(high) < 0:
            high *= 2
        return brentq(excess, 0.0, high, xtol=1e-12)

    def _at(self, travelled: Array, depth: float) -> Array:
        spacing, rows = self.road.spacing, self.width / self.road.spacing
        period = np.mod(travelled, 2 * spacing)
        count = int(np.ceil(self.length / spacing)) + 3
        number = np.arange(-count, count + 1)
        place = number * spacing - period[:, None]
        higher = 0.5 * self.road.unevenness * np.where(number % 2, -1.0, 1.0)
        sunk = np.maximum(depth + higher - self.gap(place), 0.0)
        sunk[np.abs(place) > self.length] = 0.0
        springs = 4 / 3 * self.modulus * np.sqrt(self.road.radius) * sunk**1.5
        return rows * springs.sum(axis=1)


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
        raise InputError("wedges: fewer than three wedges are in contact: increase the deflection")
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

    The tire is cut into wedges around the axle. The volume in which a wedge of the unloaded tire
    intersects the road gives its force by a look-up table, here from the finite elements pressed on
    a plane at several heights. Per metre of circumference, the area A of a wedge's cross-section
    inside the road and the force F that it carries form pairs, over all wedges and heights; the
    table is their mean in classes of A, made monotone. Wedges are independent of each other, and
    the tire has no response in time.
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
