"""Third-octave bands and weighting of levels, by IEC 61260-1 and IEC 61672-1."""

from __future__ import annotations

import numpy as np

_PREFERRED = np.array((1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0))
FEWEST = 3  # lines across a band; with fewer it has no level
# Lines with which the process's level lies from 3.0 dB below to 4.6 dB above in 95 % of cases.
FEW = 10


def a_weighting(frequency: np.ndarray) -> np.ndarray:
    """A-weighting in dB at frequencies (f,) Hz: the analytic form of IEC 61672-1, 0 at 1 kHz."""
    f2 = np.asarray(frequency, float) ** 2
    f1, low, high, f4 = 20.598997, 107.65265, 737.86223, 12194.217

    def response(square: np.ndarray | float) -> np.ndarray:
        return (f4**2 * square**2) / (
            (square + f1**2) * np.sqrt((square + low**2) * (square + high**2)) * (square + f4**2)
        )

    with np.errstate(divide="ignore"):
        return 20 * np.log10(response(f2) / response(1000.0**2))


def nominal(centre: np.ndarray) -> np.ndarray:
    """Nominal frequencies, Hz, of IEC 61260-1 for exact band centres 1000 * 10^(k/10) Hz.

    For instance 315 for 316.23; other values are unchanged.
    """
    band = np.rint(10.0 * np.log10(np.maximum(centre, 1e-9)))
    name = _PREFERRED[(band % 10).astype(int)] * 10.0 ** (band // 10)
    return np.where(np.abs(name / np.maximum(centre, 1e-9) - 1.0) < 0.03, name, centre)


def band_sums(
    frequency: np.ndarray, square: np.ndarray, up_to: float = np.inf
) -> tuple[np.ndarray, np.ndarray]:
    """Centres (b,) Hz of base-ten bands, 1000 * 10^(k/10) (IEC 61260-1), and sums (b, ...).

    `square` (f, ...) is given at evenly spaced lines (f,) Hz; lines on a border are divided. Only
    bands that lie entirely within the lines and below `up_to` Hz: a band narrower than three lines
    has no meaningful level, and a record of one line has no band.
    """
    if len(frequency) < 2:
        return np.zeros(0), np.zeros((0, *square.shape[1:]))
    spacing = frequency[1] - frequency[0]
    centre, low, high = _bands(min(frequency[-1], up_to), frequency[0])
    use = high - low > FEWEST * spacing
    edges = np.append(frequency - spacing / 2, frequency[-1] + spacing / 2)
    held = np.concatenate([np.zeros((1, *square.shape[1:])), np.cumsum(square, axis=0)])

    def below(limit: np.ndarray) -> np.ndarray:
        columns = held.reshape(len(edges), -1).T
        found = np.stack([np.interp(limit, edges, column) for column in columns], axis=-1)
        return found.reshape(-1, *square.shape[1:])

    return centre[use], below(high[use]) - below(low[use])


def _bands(up_to: float, above: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres, lower and upper borders, Hz, of all bands from 1 Hz between two frequencies."""
    centre = 1000.0 * 10.0 ** (np.arange(-30, 17) / 10)
    low, high = centre * 10**-0.05, centre * 10**0.05
    use = (high < up_to) & (low > above)
    return centre[use], low[use], high[use]


def too_narrow(spacing: float, up_to: float, lowest: float = 20.0) -> np.ndarray:
    """Centres, Hz, of bands in `lowest` to `up_to` Hz with fewer than 3 lines (`spacing` Hz)."""
    centre, low, high = _bands(up_to, 0.0)
    return centre[(high - low <= FEWEST * spacing) & (centre > 0.95 * lowest)]


def lowest_wanted(up_to: float, lowest: float = 63.0) -> float:
    """Exact centre, Hz, of the lowest band that a record should resolve: `lowest`, or the highest one
    below `up_to` Hz where that is lower; 0 if there is none."""
    centre, _, _ = _bands(up_to, 0.0)
    return float(centre[centre < 1.05 * lowest].max(initial=0.0))


def least_duration(centre: float) -> float:
    """Duration, s, of a record with so many lines across the band of `centre` Hz that it has a level."""
    return FEWEST / (centre * (10**0.05 - 10**-0.05))


def lines(centre: np.ndarray, spacing: float) -> np.ndarray:
    """Number of lines, `spacing` Hz apart, across each band (b,)."""
    return centre * (10**0.05 - 10**-0.05) / spacing


def freedom(count: np.ndarray) -> np.ndarray:
    """Degrees of freedom of the sum of `count` adjacent lines of noise under a Hann window.

    Adjacent lines are correlated by 2/3 and the next but one by 1/6, so n lines are worth
    n^2 / (n + 2 (n - 1) 4/9 + 2 (n - 2) 1/36) independent ones (Welch's method on one segment), of
    two degrees of freedom each.
    """
    n = np.maximum(np.asarray(count, float), 1.0)
    shared = 2 * (n - 1) * 4 / 9 + 2 * np.maximum(n - 2, 0) / 36
    return 2 * n**2 / (n + shared)


def confidence(degrees: np.ndarray, share: float = 0.95) -> np.ndarray:
    """dB (..., 2), negative and positive, to add to a level with that number of degrees of freedom.

    The level of the process lies between them in `share` of all cases, if it is stationary and
    Gaussian: nu / chi-square(nu).
    """
    from scipy import stats  # imported here because it is slow

    nu, tail = np.asarray(degrees, float), (1 - share) / 2
    ends = [nu / stats.chi2.ppf(1 - tail, nu), nu / stats.chi2.ppf(tail, nu)]
    return 10 * np.log10(np.stack(ends, axis=-1))
