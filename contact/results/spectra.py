"""Spectra of time histories: amplitudes, densities, third-octave levels, distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.contact.results.levels import a_weighting, band_sums, confidence

# References of the levels: N, N m, and m/s by ISO 1683.
FORCE, MOMENT, VELOCITY = 1.0, 1.0, 1e-9
SILENT = -1000.0  # dB: levels below are of records that do not vary beyond rounding
BAND = 300.0  # Hz, up to which two histories are compared by default
_ROUNDING = 1e-12  # of the largest value of a record: less variation than this is rounding
_SEGMENTS = 4.5  # with half overlap, eight averages
_LONGEST = 0.5  # s of a segment: lines of 2 Hz; longer records give more averages instead


def amplitudes(values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (f,) Hz and complex amplitudes (f, d), in the unit of values (n, d).

    Hann window, mean removed, scaled so that a sine of amplitude a on a line of the spectrum yields
    |a|. `step` in s.
    """
    from scipy import signal  # a quarter of a second, which a run with all stages reused saves

    window = signal.get_window("hann", len(values))[:, None]
    spectrum = np.fft.rfft(window * (values - values.mean(axis=0)), axis=0)
    return np.fft.rfftfreq(len(values), step), 2 * spectrum / window.sum()


def third_octaves(
    values: np.ndarray,
    step: float,
    up_to: float = np.inf,
    *,
    reference: float = FORCE,
    rate: bool = False,
    weighted: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Band centres (b,) Hz and levels (b, d), dB re `reference` (rms), of values (n, d).

    With `rate`, of their rate of change per second; A-weighted line by line if `weighted`. Bands as
    in `contact.results.levels.band_sums`, below `up_to` Hz and half the sampling rate. Hann window
    over the whole record, mean removed. A record of one value has no band, and levels of one that
    does not vary are below `SILENT`.
    """
    if len(values) < 2:
        return np.zeros(0), np.zeros((0, values.shape[1]))
    frequency, square = _lines(values, step, rate, weighted)
    centre, square = band_sums(frequency, square, up_to)
    return centre, _decibel(square, reference)


def total_level(
    values: np.ndarray, step: float, up_to: float = np.inf, *, weighted: bool = False
) -> np.ndarray:
    """Level (d,), dB re `FORCE` (rms), of all lines of values (n, d) up to `up_to` Hz.

    Unlike a sum of `third_octaves` it includes bands with too few lines for a level of their own.
    Below `SILENT` if nothing varies.
    """
    frequency, square = _lines(values, step, weighted=weighted)
    return _decibel(square[frequency <= up_to].sum(axis=0), FORCE)


def off_middle(values: np.ndarray) -> np.ndarray:
    """By how much (d,), dB, the Hann window changes the mean square of values (n, d).

    0 for a stationary record; negative if what varies lies near its ends, positive if in its
    middle, as an impact may.
    """
    from scipy import signal

    weight = signal.get_window("hann", len(values))[:, None] ** 2
    square = (values - values.mean(axis=0)) ** 2
    seen, whole = (weight * square).sum(axis=0) / weight.sum(), square.mean(axis=0)
    return _decibel(seen, 1.0) - _decibel(whole, 1.0)


def _lines(
    values: np.ndarray, step: float, rate: bool = False, weighted: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (f,) Hz and mean squares (f, d) of the lines, as for `third_octaves`.

    Exactly 0 where the values vary by rounding alone, as a force on a flat road may.
    """
    from scipy import signal

    frequency, power = signal.periodogram(values, 1 / step, "hann", detrend="constant", axis=0)
    power = np.where(
        np.ptp(values, axis=0) > _ROUNDING * np.abs(values).max(initial=0.0), power, 0.0
    )
    if rate:
        power = power * (2 * np.pi * frequency[:, None]) ** 2
    if weighted:
        power = power * 10 ** (a_weighting(frequency)[:, None] / 10)
    return frequency, power * frequency[1]


def _decibel(square: np.ndarray, reference: float) -> np.ndarray:
    return 10 * np.log10(np.maximum(square, np.finfo(float).tiny) / reference**2)


def deviation(values: np.ndarray, step: float, up_to: float = np.inf) -> np.ndarray:
    """Standard deviation (d,) of the part of values (n, d), in steps of `step` s, up to `up_to` Hz.

    By Parseval; of the whole if the record is shorter than one period of `up_to`.
    """
    if up_to * len(values) * step < 1:
        up_to = np.inf
    square = 2 * np.abs(np.fft.rfft(values - values.mean(axis=0), axis=0)) ** 2
    if len(values) % 2 == 0:
        square[-1] /= 2  # half the sampling rate has a single line
    return np.sqrt(square[np.fft.rfftfreq(len(values), step) <= up_to].sum(axis=0)) / len(values)


@dataclass(frozen=True)
class Density:
    """One-sided power spectral `density` (f, d) at `frequency` (f,) Hz, by Welch's method.

    Hann windows of `segment` s, half overlapping, `averages` of them; `confidence` (2,) dB, 95 %,
    as in contact.results.levels.
    """

    frequency: np.ndarray
    density: np.ndarray
    segment: float
    averages: int
    confidence: np.ndarray


def density(values: np.ndarray, step: float, up_to: float = np.inf, rate: bool = False) -> Density:
    """Density of values (n, d) in steps of `step` s, or of their `rate`; unit squared per Hz.

    Segments of half the record or less: eight averages, or more if segments of 0.5 s allow. Each
    has its mean removed. The integral is the variance (Parseval). Under a Hann window the powers of
    segments with half overlap are correlated by 1/36 with the next, so k averages are worth
    k / (1 + (k - 1) / (18 k)).
    """
    from scipy import signal

    count = len(values)
    width = max(min(2 * int(count / _SEGMENTS / 2), round(_LONGEST / step)), min(count, 8))
    shift = width - width // 2
    averages = max(1 + (count - width) // shift, 1)
    frequency, power = signal.welch(
        values, 1 / step, "hann", width, width // 2, detrend="constant", axis=0
    )
    if rate:
        power = power * (2 * np.pi * frequency[:, None]) ** 2
    independent = averages / (1 + (averages - 1) / (18 * averages))
    kept = frequency <= up_to
    return Density(
        frequency[kept],
        power[kept],
        width * step,
        averages,
        confidence(np.array(2 * independent)),
    )


@dataclass(frozen=True)
class Distance:
    """Relative L2 distance in the band, and largest difference over largest variation."""

    mean: float
    worst: float


def distance(
    reference: np.ndarray, found: np.ndarray, duration: float, band: float = BAND
) -> Distance:
    """Fourier coefficients of windowed values (n, k) at t = h ... duration, up to `band` Hz."""
    rest = reference.mean(axis=0)
    exact = low_part(reference - rest, duration, band)
    off = low_part(found - rest, duration, band) - exact
    # Back in time, at the same number of instants for both.
    seen = [np.fft.irfft(part, 8 * len(exact), axis=0) for part in (off, exact)]
    worst, most = (np.abs(part).max() for part in seen)
    return Distance(float(np.linalg.norm(off) / np.linalg.norm(exact)), float(worst / most))


def low_part(values: np.ndarray, duration: float, band: float) -> np.ndarray:
    """Fourier coefficients of windowed values (n, k) at t = h ... duration, to `band` Hz."""
    n = len(values)
    # The window vanishes at both ends, so the value at t = 0 is arbitrary.
    window = np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    shifted = np.concatenate([values[:1], values[:-1]])
    keep = np.arange(n // 2 + 1) <= band * duration * (1 + 1e-9)
    return np.fft.rfft(window * shifted, axis=0)[keep] / n
