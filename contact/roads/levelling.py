"""The part of a road that the axle is assumed to follow: its mean height, or its long waves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tireroad.contact.roads.under_tire import Road

Array = NDArray[np.float64]

# The profile of the strip is sampled at no more than this many points.
MOST_POINTS = 1_000_000
PIECE = 20_000  # points evaluated at once
# The Gaussian profile filter of ISO 16610-21 passes half of a wave of the cut-off length; its
# weight exp(-pi (x / (alpha lambda))^2) has the standard deviation alpha lambda / sqrt(2 pi).
DEVIATION = np.sqrt(np.log(2) / np.pi) / np.sqrt(2 * np.pi)


class Level:
    """Heights (m) along x (m), linear between its points and constant beyond them."""

    def __init__(self, x: Array, z: Array) -> None:
        self._x, self._z = x, z

    def __call__(self, x: Array) -> Array:
        return np.interp(x, self._x, self._z)

    def bounds(self, x0: float, x1: float) -> tuple[float, float]:
        """Least and greatest height from x0 to x1, m."""
        inside = self._z[np.searchsorted(self._x, x0) : np.searchsorted(self._x, x1)]
        ends = np.interp([x0, x1], self._x, self._z)
        values = np.concatenate([inside, ends])
        return float(values.min()), float(values.max())


def mean_level(road: Road, x0: float, x1: float, y0: float, y1: float) -> Level:
    """The mean height of a strip of road (contact.roads.under_tire.Road), as a constant level."""
    _, profile = _profile(road, x0, x1, y0, y1)
    return Level(np.array([x0]), np.array([profile.mean()]))


def wave_level(
    road: Road, x0: float, x1: float, y0: float, y1: float, longest_wave: float
) -> Level:
    """The waves of the strip longer than `longest_wave` (m): ISO 16610-21 on its mean profile.

    Beyond its ends the profile is continued by reflection. It is then a sum of cosines, each
    transmitted by the filter as exp(-pi (alpha lambda_c / lambda)^2), at a cost that does not
    depend on the cut-off.
    """
    from scipy.fft import dct, idct  # not needed to read a scene

    x, profile = _profile(road, x0, x1, y0, y1)
    waves = np.arange(len(x)) / (2 * (x1 - x0))  # 1/m
    passed = np.exp(-0.5 * (2 * np.pi * DEVIATION * longest_wave * waves) ** 2)
    return Level(x, idct(passed * dct(profile)))


def _profile(road: Road, x0: float, x1: float, y0: float, y1: float) -> tuple[Array, Array]:
    """x (n,) m and mean height over the width (n,) m, at half the road's spacing if affordable."""
    step = 0.5 * road.spacing
    if not np.isfinite(step):
        return np.array([x0]), np.zeros(1)
    counts = [max(int(np.ceil(d / step)), 1) for d in (x1 - x0, y1 - y0)]
    excess = np.sqrt(max(1.0, counts[0] * counts[1] / MOST_POINTS))
    nx, ny = (max(int(c / excess), 1) for c in counts)
    x = x0 + (np.arange(nx) + 0.5) * (x1 - x0) / nx
    y = y0 + (np.arange(ny) + 0.5) * (y1 - y0) / ny
    # The full width of a short piece at a time, so that a file is read once and a texture generated
    # once, not once for every y.
    pieces = np.array_split(x, max(nx * ny // PIECE, 1))
    means = [road.height(*np.meshgrid(piece, y)).sum(axis=0) / ny for piece in pieces]
    return x, np.concatenate(means)
