"""Spectra of a force that was computed in time: amplitudes, and third-octave levels."""

from __future__ import annotations

import numpy as np
from scipy import signal

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
    """Band centres (b,) Hz and levels (b, d), dB re 1 N (rms), of values (n, d) in N.

    Base-ten bands 1000 * 10^(k/10) (IEC 61260-1), those that lie whole between the lines of the
    record's spectrum and half the sampling rate, and below `up_to` Hz; mean square in a band from the power spectrum,
    lines on the border shared. A record of one value has no band.
    """
    if len(values) < 2:
        return np.zeros(0), np.zeros((0, values.shape[1]))
    frequency, power = signal.periodogram(values, 1 / step, "hann", detrend="constant", axis=0)
    spacing = frequency[1]
    k = np.arange(-30, 17)
    centre = 1000.0 * 10.0 ** (k / 10)
    low, high = centre * 10**-0.05, centre * 10**0.05
    # A band narrower than three lines has no meaningful level.
    use = (high - low > 3 * spacing) & (high < min(frequency[-1], up_to))
    cumulative = np.concatenate([np.zeros((1, power.shape[1])), np.cumsum(power, axis=0)]) * spacing
    edges = np.concatenate([[0.0], frequency + spacing / 2])

    def below(limit: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(limit, edges, column) for column in cumulative.T], axis=-1)

    square = below(high[use]) - below(low[use])
    floor = np.finfo(float).tiny
    return centre[use], 10 * np.log10(np.maximum(square, floor) / REFERENCE**2)
