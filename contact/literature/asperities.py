"""Asperities by mean road parameters and Hertz springs (Fujikawa et al. 1994, 2005; thesis 3.1).

A profile is cut at its median height by the line H-H, above which half of the road lies. The parts
above are asperities; each has the height of its apex over the line, and the radius of the circle
through the apex and both crossings. Those narrower than a quarter of the mean width are left out,
since the arcs of the others contain them. The road then becomes rows of equal spheres, alternately
higher and lower; the tire is a surface of constant shape over which they pass:

    F(t) = sum_k F_Hertz(d0 + h_k - g(k x_A - v t)),   F_Hertz = 4/3 E* sqrt(r_A) d^1.5,

where g is its static gap along the middle and d0 follows from the mean load. The response of the
tire is neglected, and so are all waves but those of the mean spacing: only the vibratory part of F
is meaningful.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
_NARROW = 0.25  # of the mean width
_PHASES = 64  # over one period, for the mean load


@dataclass(frozen=True)
class Asperities:
    """Means of a profile, m: `height` over H-H, `unevenness` of neighbours, `spacing`, `radius`."""

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
