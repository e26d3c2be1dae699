"""A line measured by a laser: cleaned of drop-outs, and widened to a surface.

Cleaning of a measured profile: outliers are removed, gaps bridged, and both are counted.

An outlier is farther from the median of 11 neighbours than `limit` times 1.4826 times the median
such distance of all points, and farther than 50 um. For Gaussian noise the factor yields the
standard deviation, and the laser's own noise and the crests of fine waves remain. Gaps, outliers
included, are bridged by straight lines up to a length; longer ones are refused, since their heights
would be invented.

A surface around a measured profile: isotropic, with the profile itself along its middle.

The spectrum of the profile is taken as that of an isotropic Gaussian surface of density C(q). A
wave of the profile with wave number k along then decays across as

    rho_k(y) = int C(sqrt(k^2 + l^2)) cos(2 pi l y) dl / int C dl,

and the addition of u(k, y) - u(k, 0) rho_k(y), with an independent surface u, makes the whole
equally rough everywhere (simple kriging of the line: Chiles and Delfiner, Geostatistics, 7.3.1).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.texture.random_surface import bands, filter_of, surface_density
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
_NEIGHBOURS = 11
_NOISE = 50e-6  # m
MOST_LOST = 0.1  # share of a profile that may be bridged


@dataclass(frozen=True)
class Cleaned:
    """`profile` (n,) m without holes; counts of `missing` and `outliers`; `longest` gap, m."""

    profile: Array
    missing: int
    outliers: int
    longest: float

    @property
    def summary(self) -> str:
        """The processing, in one line."""
        count = len(self.profile)
        lost = 100 * (self.missing + self.outliers) / count
        return (
            f"laser profile of {count} points: {self.missing} missing and {self.outliers} outliers bridged by "
            f"straight lines ({lost:.2g} %, longest {1e3 * self.longest:.3g} mm)"
        )


def cleaned(profile: Array, pitch: float, limit: float, longest: float, source: str) -> Cleaned:
    """Clean heights (n,) m every `pitch` m, nan where missing; gaps up to `longest` m are bridged.

    InputError if there is no valid height, if a gap is longer, or if more than a tenth would be
    bridged.
    """
    missing = np.isnan(profile)
    if missing.all():
        raise InputError(f"{source}: none of the {len(profile)} heights is a number")
    bridged = _bridged(profile, missing)
    outlier = _outliers(bridged, limit) & ~missing
    lost = missing | outlier
    gap, place = _longest_run(lost)
    if gap * pitch > longest * (1 + 1e-9):
        raise InputError(
            f"{source}: {gap * pitch:.3g} m without a sound height at {place * pitch:.4g} m, more than "
            f"road.longest_gap = {longest:g} m; cut the profile there, or allow longer gaps"
        )
    if lost.mean() > MOST_LOST:
        raise InputError(
            f"{source}: {int(missing.sum())} heights are missing and {int(outlier.sum())} are outliers, "
            f"{100 * lost.mean():.3g} % of {len(profile)}, more than {100 * MOST_LOST:g} %: the measurement "
            "is of no use"
        )
    whole = _bridged(profile, lost)
    return Cleaned(whole, int(missing.sum()), int(outlier.sum()), gap * pitch)


def _outliers(profile: Array, limit: float) -> NDArray[np.bool_]:
    from scipy.ndimage import median_filter  # not needed to read a scene

    distance = np.abs(profile - median_filter(profile, _NEIGHBOURS, mode="nearest"))
    return distance > max(limit * 1.4826 * float(np.median(distance)), _NOISE)


def _bridged(profile: Array, lost: NDArray[np.bool_]) -> Array:
    place, known = np.arange(len(profile)), np.flatnonzero(~lost)
    return np.interp(place, known, profile[known])


def _longest_run(lost: NDArray[np.bool_]) -> tuple[int, int]:
    """Number of points in the longest run of lost ones, and where it begins."""
    change = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    begin, end = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    if len(begin) == 0:
        return 0, 0
    which = int(np.argmax(end - begin))
    return int(end[which] - begin[which]), int(begin[which])


_LONGEST = 4  # longest waves of the surface that fit into the profile; twice the width fits one


def widened(profile: Array, pitch: float, width: float, seed: int) -> tuple[Array, Array]:
    """y (m,) m, symmetric about 0, and z (n, m) m of a surface with the profile (n,) m at y = 0.

    Waves too long for either length are those of the profile, constant across.
    """
    from scipy import fft  # not needed to read a scene

    half, longest, shape = _sizes(len(profile), pitch, width)
    across = 2 * half + 1
    smooth, rough = _split(profile, pitch, longest)
    edges = bands(2 * pitch, longest)
    power = _band_power(rough, pitch, edges)
    amplitude = _amplitude(edges, power, shape, pitch)
    middle = np.fft.rfft(np.pad(rough, (0, shape[0] - len(profile)), mode="reflect"))
    rho = _decay(amplitude)
    noise = np.random.default_rng(seed).standard_normal(shape)
    other = fft.ifft(fft.fft(fft.rfft(noise, axis=0), axis=1) * amplitude, axis=1)
    lag = np.abs(np.arange(across) - half)
    field = other[:, :across] + rho[:, lag] * (middle - other[:, half])[:, None]
    z = fft.irfft(field, shape[0], axis=0)[: len(profile)]
    y: Array = np.float64(pitch) * np.arange(-half, half + 1)
    return y, z + smooth[:, None]


def memory(count: int, pitch: float, width: float) -> float:
    """Largest memory of `widened`, bytes: 37 per height of the periodic surface (measured)."""
    _, _, shape = _sizes(count, pitch, width)
    return 37.0 * shape[0] * shape[1]


def _sizes(count: int, pitch: float, width: float) -> tuple[int, float, tuple[int, int]]:
    """Heights on either side of the profile, longest wave (m), and heights along and across."""
    from scipy.fft import next_fast_len  # not needed to read a scene

    half = int(np.ceil(0.5 * width / pitch))
    longest = min(count * pitch / _LONGEST, 2.0 * width)
    return half, longest, (_padded(count, longest, pitch), next_fast_len(2 * (2 * half + 1)))


def _split(profile: Array, pitch: float, longest: float) -> tuple[Array, Array]:
    """Waves longer than `longest` (m), including the straight line, and the rest."""
    from scipy.ndimage import gaussian_filter1d  # not needed to read a scene

    from tireroad.contact.roads.under_tire import DEVIATION

    smooth = gaussian_filter1d(profile, DEVIATION * longest / pitch, mode="nearest")
    return smooth, profile - smooth


def _band_power(profile: Array, pitch: float, edges: Array) -> Array:
    """Variances (k,) m^2 of the profile in the bands between the `edges` (1/m)."""
    power = np.abs(np.fft.rfft(profile - profile.mean())) ** 2 * 2 / len(profile) ** 2
    wave = np.fft.rfftfreq(len(profile), pitch)
    total = np.concatenate([[0.0], np.cumsum(power)])
    ends = np.interp(edges, np.concatenate([[0.0], wave + 0.5 * wave[1]]), total)
    return np.maximum(np.diff(ends), 1e-30)


def _padded(count: int, longest: float, pitch: float) -> int:
    """A length with small factors at which the profile does not meet its own beginning."""
    from scipy.fft import next_fast_len

    extra = min(int(longest / pitch), count - 1)
    whole = next_fast_len(count + extra, real=True)
    return whole if whole - count < count else count + extra


def _amplitude(edges: Array, power: Array, shape: tuple[int, int], pitch: float) -> Array:
    """(n // 2 + 1, m) amplitudes for white noise, such that profiles have the `power`."""
    density = surface_density(edges, power)
    along, across = np.fft.rfftfreq(shape[0], pitch), np.fft.fftfreq(shape[1], pitch)
    wave = np.hypot(along[:, None], across[None, :])
    return filter_of(edges, density, wave) / pitch


def _decay(amplitude: Array) -> Array:
    """rho (n // 2 + 1, m) at the transform's lags across."""
    correlation = np.fft.ifft(amplitude**2, axis=1).real
    own = correlation[:, :1]
    return np.where(own > 0, correlation / np.where(own > 0, own, 1.0), 1.0)
