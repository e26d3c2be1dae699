"""Texture characteristics of a profile: mean profile depth and third-octave levels.

Mean profile depth (ISO 13473-1): the profile without waves shorter than 2.5 mm is divided into
pieces of 100 mm, each less its straight line; the mean of the highest peaks in the two halves of a
piece, averaged over the pieces. Level of a third octave (ISO 13473-4): 20 lg(a / 1 um), a being the
root mean square of the profile in the band, from a periodogram of Hann-windowed pieces with half
overlap, each less its straight line. Bands by wavelength, 10^(k/10) m.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BASE = 0.1  # m, of a piece
SHORTEST = 2.5e-3  # m, shortest waves that count for the mean profile depth
REFERENCE = 1e-6  # m
_CYCLES = 5  # waves in a piece at a band's centre, at least


@dataclass(frozen=True)
class Texture:
    """Mean profile `depth` m, None for a profile shorter than 100 mm, and third-octave levels.

    `wavelength` (k,) m, descending, and `level` (k,) dB re 1 um.
    """

    depth: float | None
    wavelength: Array
    level: Array


def texture_of(profile: Array, pitch: float, shortest: float = 0.0) -> Texture:
    """The texture of heights (n,) m every `pitch` m, in bands of waves longer than `shortest` m.

    Below that, a road on a grid has what its interpolation makes: 26 dB at 1.3 mm of a road cut off
    at 4 mm.
    """
    depth, (wavelength, level) = mean_profile_depth(profile, pitch), third_octaves(profile, pitch)
    whole = wavelength > 10**0.05 * shortest
    return Texture(depth, wavelength[whole], level[whole])


def mean_profile_depth(profile: Array, pitch: float) -> float | None:
    """Mean profile depth, m; None for less than 100 mm, or fewer than 8 points per 100 mm."""
    count = round(BASE / pitch)
    if count < 8 or len(profile) < count:
        return None
    smooth = _without_short(profile, pitch)
    pieces = _level(smooth[: len(smooth) // count * count].reshape(-1, count))
    halves = np.array_split(pieces, 2, axis=1)
    return float(np.mean([half.max(axis=1) for half in halves]))


def third_octaves(profile: Array, pitch: float) -> tuple[Array, Array]:
    """Wavelengths (k,) m, descending, and levels (k,) dB re 1 um; empty for a short profile."""
    length = len(profile) * pitch
    first = int(np.ceil(10 * np.log10(2.5 * pitch)))
    last = int(np.floor(10 * np.log10(length / _CYCLES / 2)))
    exponents = np.arange(last, first - 1, -1)
    if len(exponents) == 0:
        return np.zeros(0), np.zeros(0)
    wavelength = 10.0 ** (exponents / 10)
    count = min(len(profile), 2 * int(_CYCLES * wavelength[0] / pitch))
    density, spacing = _periodogram(profile, pitch, count)
    # The integral of the density up to a wave number, linear between its lines.
    edges = (np.arange(len(density) + 1) - 0.5) * spacing
    total = np.concatenate([[0.0], np.cumsum(density) * spacing])
    low, high = (np.interp(10**s / wavelength, edges, total) for s in (-0.05, 0.05))
    power = np.maximum(high - low, 1e-30)
    return wavelength, 10 * np.log10(power / REFERENCE**2)


def _periodogram(profile: Array, pitch: float, count: int) -> tuple[Array, float]:
    """One-sided density (count // 2 + 1,) m^3 of pieces of `count` points; line spacing (1/m)."""
    window = np.hanning(count + 1)[:-1]
    begin = np.arange(0, len(profile) - count + 1, max(count // 2, 1))
    total = np.zeros(count // 2 + 1)
    for first in begin:  # one at a time: a long road has thousands
        piece = _level(profile[None, first : first + count])[0]
        total += np.abs(np.fft.rfft(window * piece)) ** 2
    return 2 * total / len(begin) * pitch / (window @ window), 1 / (count * pitch)


def _level(pieces: Array) -> Array:
    """Each row (n,) m less its straight line."""
    place = np.linspace(-1.0, 1.0, pieces.shape[1])
    slope = pieces @ place / (place @ place)
    return pieces - pieces.mean(axis=1, keepdims=True) - slope[:, None] * place


def _without_short(profile: Array, pitch: float) -> Array:
    """The profile without waves shorter than 2.5 mm, by the Gaussian filter of ISO 16610-21.

    The filter passes half of a wave of that length.
    """
    from scipy.ndimage import gaussian_filter1d  # not needed to read a scene

    from tireroad.contact.roads.levelling import DEVIATION

    return gaussian_filter1d(profile, DEVIATION * SHORTEST / pitch, mode="nearest")
