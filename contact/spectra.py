"""Spectra of a force that was computed in time: amplitudes, and third-octave levels."""

from __future__ import annotations

import numpy as np
from scipy import signal

from tireroad.contact.levels import band_sums

REFERENCE = 1.0  # N, of the levels


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
