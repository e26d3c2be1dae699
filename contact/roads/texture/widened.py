"""A surface around a measured profile: isotropic, with the profile itself along its middle.

The spectrum of the profile is taken as that of an isotropic Gaussian surface of density C(q). A
wave of the profile with wave number k along then decays across as

    rho_k(y) = int C(sqrt(k^2 + l^2)) cos(2 pi l y) dl / int C dl,

and the addition of u(k, y) - u(k, 0) rho_k(y), with an independent surface u, makes the whole
equally rough everywhere (simple kriging of the line: Chiles and Delfiner, Geostatistics, 7.3.1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.texture.isotropic import bands, filter_of, surface_density

Array = NDArray[np.float64]
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

    from tireroad.contact.roads.levelling import DEVIATION

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
