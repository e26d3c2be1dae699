"""Spectra of what was computed in time: amplitudes, third-octave levels, and how far two are apart in a band."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from tireroad.contact.levels import band_sums

REFERENCE = 1.0  # N, of the levels
BAND = 300.0  # Hz, up to which two histories are compared where nothing else is said


def amplitudes(values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (f,) Hz and complex amplitudes (f, d), in the unit of values (n, d).

    Hann window, mean removed, scaled so that a sine of amplitude a on a line of the spectrum shows |a|.
    """
    window = signal.get_window("hann", len(values))[:, None]
    spectrum = np.fft.rfft(window * (values - values.mean(axis=0)), axis=0)
    return np.fft.rfftfreq(len(values), step), 2 * spectrum / window.sum()


def third_octaves(
    values: np.ndarray, step: float, up_to: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Band centres (b,) Hz and levels (b, d), dB re 1 N (rms), of values (n, d) in N; bands as of
    `contact.levels.band_sums`, below `up_to` Hz and half the sampling rate. A record of one value has no band.
    """
    if len(values) < 2:
        return np.zeros(0), np.zeros((0, values.shape[1]))
    frequency, power = signal.periodogram(values, 1 / step, "hann", detrend="constant", axis=0)
    centre, square = band_sums(frequency, power * frequency[1], up_to)
    return centre, 10 * np.log10(np.maximum(square, np.finfo(float).tiny) / REFERENCE**2)


@dataclass(frozen=True)
class Distance:
    """Relative L2 distance in the band, and the largest difference there over the largest variation."""

    mean: float
    worst: float


def distance(
    reference: np.ndarray, found: np.ndarray, duration: float, band: float = BAND
) -> Distance:
    """How far `found` (n', k) is from what varies of `reference` (n, k), both over `duration` s, from
    0 to `band` Hz.

    Each is looked at with its own step: thinned out to a common one, force above half its sampling
    frequency would fold down into the band (seen: 0.6 % where there was 0.03 %). Hann window.
    """
    rest = reference.mean(axis=0)
    exact = low_part(reference - rest, duration, band)
    off = low_part(found - rest, duration, band) - exact
    # Seen in time again, the same number of instants for both.
    seen = [np.fft.irfft(part, 8 * len(exact), axis=0) for part in (off, exact)]
    worst, most = (np.abs(part).max() for part in seen)
    return Distance(float(np.linalg.norm(off) / np.linalg.norm(exact)), float(worst / most))


def low_part(values: np.ndarray, duration: float, band: float) -> np.ndarray:
    """Fourier coefficients of windowed values (n, k) at t = h, 2h, ... = duration, up to `band` Hz."""
    n = len(values)
    # The window vanishes at both ends, so the value at t = 0 may be any.
    window = np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    shifted = np.concatenate([values[:1], values[:-1]])
    keep = np.arange(n // 2 + 1) <= band * duration * (1 + 1e-9)
    return np.fft.rfft(window * shifted, axis=0)[keep] / n
