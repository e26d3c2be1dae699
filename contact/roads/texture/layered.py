"""Superposed roads: long waves, and a texture of several bands with a skewed distribution."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.texture.isotropic import filter_of, surface_density
from tireroad.contact.roads.texture.tiles import Tiles
from tireroad.contact.roads.under_tire import Road
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Longest over shortest wave of one field of tiles. The tiles of long waves can be coarse; the
# number of points of a single field for all waves would grow with the fourth power of their ratio.
_RATIO = 8.0
MOST_SKEW = 1.5


class Skewed:
    """z = rms (h + b (h^2 - 1)) / sqrt(1 + 2 b^2) of a Gaussian h of variance 1.

    Mean 0, variance rms^2, skewness (6 b + 8 b^3) / (1 + 2 b^2)^1.5. Negative: plateaus with pits,
    as on rolled asphalt.
    """

    def __init__(self, skewness: float) -> None:
        from scipy.optimize import brentq  # not needed to read a scene

        def excess(b: float) -> float:
            return (6 * b + 8 * b**3) / (1 + 2 * b**2) ** 1.5 - skewness

        self._b = brentq(excess, -0.7, 0.7) if skewness else 0.0

    def __call__(self, h: Array) -> Array:
        b = self._b
        return (h + b * (h * h - 1.0)) / np.sqrt(1.0 + 2.0 * b * b)

    def bounds(self, low: float, high: float) -> tuple[float, float]:
        """Lowest and highest z for h from low to high."""
        ends = [float(self(np.array(h))) for h in (low, high)]
        turn = -0.5 / self._b if self._b else np.inf
        if low < turn < high:
            ends.append(float(self(np.array(turn))))
        return min(ends), max(ends)


class Layered:
    """`base` + rms * skew(sum of fields / rms), m; independent fields with a joint `rms` (m)."""

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, base: Road | None, fields: Sequence[Tiles], rms: float, skew: float) -> None:
        self._base, self._fields, self._rms, self._skew = base, fields, rms, Skewed(skew)
        self.spacing = min(field.spacing for field in fields)
        self.shortest_wave = min(field.shortest_wave for field in fields)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        texture = np.sum([field.height(x, y) for field in self._fields], axis=0)
        z = self._rms * self._skew(texture / self._rms)
        return z if self._base is None else z + self._base.height(x, y)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of the heights in a strip, m."""
        return self._bounds((x0, x1, y0, y1))[1]

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of the heights in a strip, m."""
        return self._bounds((x0, x1, y0, y1))[0]

    def _bounds(self, strip: tuple[float, float, float, float]) -> tuple[float, float]:
        low, high = (
            sum(getattr(field, which)(*strip) for field in self._fields) / self._rms
            for which in ("lowest", "highest")
        )
        low, high = (self._rms * end for end in self._skew.bounds(low, high))
        if self._base is None:
            return low, high
        return low + self._base.lowest(*strip), high + self._base.highest(*strip)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Layered:
        """Nothing to prepare."""
        return self


def textured(
    edges: Array, power: Array, seed: int, base: Road | None = None, skewness: float = 0.0
) -> Layered:
    """An isotropic texture with given profile variances, on top of `base`.

    `power` (k,) m^2 in the bands between the `edges` (k + 1,) 1/m (isotropic.surface_density).
    InputError if the resulting surface has no variance.
    """
    density = surface_density(edges, power)
    # Variance of the surface in its bands.
    own = np.pi * density * (edges[1:] ** 2 - edges[:-1] ** 2)
    if not own.sum() > 0:
        raise InputError("road: a texture needs a level above nothing in one band at least")

    def field(part: slice, number: int) -> Tiles:
        ends = edges[part.start : part.stop + 1]
        return Tiles(
            lambda q: filter_of(ends, density[part], np.clip(q, ends[0], ends[-1] * (1 - 1e-12))),
            shortest=1.0 / ends[-1],
            longest=1.0 / ends[0],
            rms=float(np.sqrt(own[part].sum())),
            seed=(seed, number),
        )

    parts = [part for part in _parted(edges) if own[part].sum() > 0]
    fields = [field(part, number) for number, part in enumerate(parts, 1)]
    return Layered(base, fields, float(np.sqrt(own.sum())), skewness)


def _parted(edges: Array) -> list[slice]:
    """Bands in groups whose longest wave is at most _RATIO times the shortest."""
    count = len(edges) - 1
    groups = max(int(np.ceil(np.log(edges[-1] / edges[0]) / np.log(_RATIO))), 1)
    cuts = np.unique(np.linspace(0, count, min(groups, count) + 1).round().astype(int))
    return [slice(a, b) for a, b in pairwise(cuts.tolist())]


def band_power(wavelength: Sequence[float], level: Sequence[float], edges: Array) -> Array:
    """Variances (k,) m^2 in the bands between `edges` (1/m) from third-octave levels (re 1 um).

    The levels are given at wavelengths (m) and interpolated linearly over the logarithm, constant
    beyond.
    """
    middle = -np.log(np.sqrt(edges[1:] * edges[:-1]))
    order = np.argsort(wavelength)
    of = np.interp(middle, np.log(np.array(wavelength))[order], np.array(level, float)[order])
    width = np.log10(edges[1:] / edges[:-1]) / 0.1  # third octaves per band
    return 1e-12 * 10 ** (of / 10) * width
