"""Third-octave bands and weighting of levels, by IEC 61260-1 and IEC 61672-1."""

from __future__ import annotations

import numpy as np


def a_weighting(frequency: np.ndarray) -> np.ndarray:
    """dB to add at frequencies (f,) Hz: the analytic form of IEC 61672-1, 0 at 1 kHz."""
    f2 = np.asarray(frequency, float) ** 2
    f1, low, high, f4 = 20.598997, 107.65265, 737.86223, 12194.217

    def response(square: np.ndarray | float) -> np.ndarray:
        return (f4**2 * square**2) / (
            (square + f1**2) * np.sqrt((square + low**2) * (square + high**2)) * (square + f4**2)
        )

    with np.errstate(divide="ignore"):
        return 20 * np.log10(response(f2) / response(1000.0**2))


def band_sums(frequency: np.ndarray, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centres (b,) Hz of the bands that lie whole within the lines (f,) Hz, evenly spaced, and hold more
    than three of them; and the sums (b,) of what the lines hold, those on a border shared."""
    spacing = frequency[1] - frequency[0]
    k = np.arange(-30, 17)
    centre = 1000.0 * 10.0 ** (k / 10)
    low, high = centre * 10**-0.05, centre * 10**0.05
    use = (high - low > 3 * spacing) & (high < frequency[-1]) & (low > frequency[0])
    edges = np.append(frequency - spacing / 2, frequency[-1] + spacing / 2)
    held = np.concatenate([[0.0], np.cumsum(square)])
    return centre[use], np.interp(high[use], edges, held) - np.interp(low[use], edges, held)
