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


def band_sums(
    frequency: np.ndarray, square: np.ndarray, up_to: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (b,) Hz of base-ten bands, 1000 * 10^(k/10) (IEC 61260-1), and the sums (b, ...) of what the lines
    (f,) Hz, evenly spaced, hold of `square` (f, ...), those on a border shared.

    Bands that lie whole within the lines and below `up_to` Hz; a band narrower than three lines has no
    meaningful level, and a record of one line no band.
    """
    if len(frequency) < 2:
        return np.zeros(0), np.zeros((0, *square.shape[1:]))
    spacing = frequency[1] - frequency[0]
    centre = 1000.0 * 10.0 ** (np.arange(-30, 17) / 10)
    low, high = centre * 10**-0.05, centre * 10**0.05
    use = (high - low > 3 * spacing) & (high < min(frequency[-1], up_to)) & (low > frequency[0])
    edges = np.append(frequency - spacing / 2, frequency[-1] + spacing / 2)
    held = np.concatenate([np.zeros((1, *square.shape[1:])), np.cumsum(square, axis=0)])

    def below(limit: np.ndarray) -> np.ndarray:
        columns = held.reshape(len(edges), -1).T
        found = np.stack([np.interp(limit, edges, column) for column in columns], axis=-1)
        return found.reshape(-1, *square.shape[1:])

    return centre[use], below(high[use]) - below(low[use])
