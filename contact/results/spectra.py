"""Spectra and levels of a record: lines, densities, third octaves (IEC 61260-1, 61672-1), and their upper limit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.contact.choices import USABLE
from tireroad.contact.patch import Patch

_PREFERRED = np.array((1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0))
FEWEST = 3  # lines across a band; with fewer it has no level
# Lines with which the process's level lies from 3.0 dB below to 4.6 dB above in 95 % of cases.
FEW = 10

# References of the levels: N, N m, and m/s by ISO 1683.
FORCE, MOMENT, VELOCITY = 1.0, 1.0, 1e-9
SILENT = -1000.0  # dB: levels below are of records that do not vary beyond rounding
BAND = 300.0  # Hz, up to which two histories are compared by default
_ROUNDING = 1e-12  # of the largest value of a record: less variation than this is rounding
_SEGMENTS = 4.5  # with half overlap, eight averages
_LONGEST = 0.5  # s of a segment: lines of 2 Hz; longer records give more averages instead
_ORDER = 4  # of the filter, passed twice: 24 dB an octave each way


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
    centre, low, high = _bands(min(frequency[-1] + spacing / 2, up_to), frequency[0])
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


def wide_enough(spacing: float, up_to: float, lowest: float = 0.0) -> np.ndarray:
    """Centres, Hz, of the bands in `lowest` to `up_to` Hz with 3 lines (`spacing` Hz) or more, which have a level."""
    centre, low, high = _bands(up_to, 0.0)
    return centre[(high - low > FEWEST * spacing) & (centre > 0.95 * lowest)]


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


def confidence(degrees: np.ndarray, share: float = 0.95) -> np.ndarray:
    """dB (..., 2), negative and positive, to add to a level with that number of degrees of freedom.

    The level of the process lies between them in `share` of all cases, if it is stationary and
    Gaussian: nu / chi-square(nu).
    """
    from scipy import stats  # imported here because it is slow

    nu, tail = np.asarray(degrees, float), (1 - share) / 2
    ends = [nu / stats.chi2.ppf(1 - tail, nu), nu / stats.chi2.ppf(tail, nu)]
    return 10 * np.log10(np.stack(ends, axis=-1))


def heard(level: np.ndarray) -> np.ndarray:
    """Levels in dB, NaN where nothing varies."""
    return np.where(level > SILENT, level, np.nan)


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
    in `contact.results.spectra.band_sums`, below `up_to` Hz and half the sampling rate. Hann window
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
    as in contact.results.spectra.
    """

    frequency: np.ndarray
    density: np.ndarray
    segment: float
    averages: int
    confidence: np.ndarray


def density(
    records: Sequence[np.ndarray], step: float, up_to: float = np.inf, rate: bool = False
) -> Density:
    """Density of the values (n, d) of independent `records` in steps of `step` s, or of their `rate`; unit squared per Hz.

    Segments of half a record or less: eight averages, or more if segments of 0.5 s allow; of several records as long as the
    shortest allows. Each has its mean removed. The integral is the variance (Parseval). Under a Hann window the powers of
    segments with half overlap are correlated by 1/36 with the next, so k averages are worth
    k / (1 + (k - 1) / (18 k)).
    """
    from scipy import signal

    count = min(len(values) for values in records)
    parts = _SEGMENTS if len(records) == 1 else 1.0
    width = max(min(2 * int(count / parts / 2), round(_LONGEST / step)), min(count, 8))
    shift = width - width // 2
    averages = np.array([max(1 + (len(values) - width) // shift, 1) for values in records])
    every = [
        signal.welch(values, 1 / step, "hann", width, width // 2, detrend="constant", axis=0)
        for values in records
    ]
    frequency = every[0][0]
    power = (
        sum(number * found for number, (_, found) in zip(averages, every, strict=True))
        / averages.sum()
    )
    if rate:
        power = power * (2 * np.pi * frequency[:, None]) ** 2
    independent = averages.sum() ** 2 / (averages + (averages - 1) / 18).sum()
    below_limit = frequency <= up_to
    return Density(
        frequency[below_limit],
        power[below_limit],
        width * step,
        int(averages.sum()),
        confidence(np.array(2 * independent)),
    )


@dataclass(frozen=True)
class Distance:
    """Relative L2 distance in the band, and largest difference over largest variation; NaN where nothing varies."""

    mean: float
    worst: float


def distance(
    reference: np.ndarray, history: np.ndarray, duration: float, band: float = BAND
) -> Distance:
    """The distance of a history (n, k) from a reference of the same duration (s), both at t = h ... duration, in what varies up to
    `band` Hz."""
    rest = reference.mean(axis=0)
    exact = low_part(reference - rest, duration, band)
    off = low_part(history - rest, duration, band) - exact
    # Back in time, at the same number of instants for both.
    seen = [np.fft.irfft(part, 8 * len(exact), axis=0) for part in (off, exact)]
    worst, most = (np.abs(part).max() for part in seen)
    if not most:
        return Distance(np.nan, np.nan)
    return Distance(float(np.linalg.norm(off) / np.linalg.norm(exact)), float(worst / most))


def in_band(values: np.ndarray, step: float, up_to: float) -> np.ndarray:
    """The part of values (n, d), in steps of `step` s, below `up_to` Hz, where it is 6 dB down.

    Butterworth of fourth order forwards and backwards, so without delay. As given where there is no
    room for it: a limit near half the sampling rate, or a record shorter than a period of it.
    """
    from scipy.signal import butter, sosfiltfilt

    if up_to * step > 0.45 or up_to * step * len(values) < 1 or len(values) <= 6 * _ORDER:
        return values
    low = butter(_ORDER, up_to, fs=1 / step, output="sos")
    return sosfiltfilt(low, values, axis=0, padtype="constant")


def low_part(values: np.ndarray, duration: float, band: float) -> np.ndarray:
    """Fourier coefficients of windowed values (n, k) at t = h ... duration, to `band` Hz."""
    n = len(values)
    # The window vanishes at both ends, so the value at t = 0 is arbitrary.
    window = np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    shifted = np.concatenate([values[:1], values[:-1]])
    keep = np.arange(n // 2 + 1) <= band * duration * (1 + 1e-9)
    return np.fft.rfft(window * shifted, axis=0)[keep] / n


@dataclass(frozen=True)
class Limit:
    """A limiting `frequency` in Hz, and its `cause` in words."""

    frequency: float
    cause: str


def limits(*, step: float, highest: float, pitch: float, speed: float) -> tuple[Limit, ...]:
    """All limits: of `step` (s), `highest` mode (Hz), points `pitch` m apart at `speed` m/s.

    A wave of the road needs at least two points, hence half the frequency at which points pass,
    speed / pitch. Shorter waves are aliased, and at the passing frequency the force of any road has
    a spurious peak, since points come into contact one by one.
    """
    found = [
        Limit(0.5 / step, f"half the sampling rate of the time step of {step:.4g} s"),
        Limit(USABLE * highest, f"{USABLE:g} of the highest mode kept, {highest:.5g} Hz"),
    ]
    if speed > 0 and np.isfinite(pitch):
        passing = speed / pitch
        found.append(
            Limit(
                0.5 * passing, f"half the passing frequency of the contact points, {passing:.5g} Hz"
            )
        )
    return tuple(found)


def lowest(limits: Iterable[Limit]) -> Limit:
    """The lowest limit, which counts."""
    return min(limits, key=lambda limit: limit.frequency)


def pitch(patch: Patch) -> float:
    """Largest distance (m) along x between neighbouring points at rest, or of all without any."""
    some = patch.force > 0
    sizes = patch.half_sizes[some if some.any() else slice(None), 0]
    return float(2 * sizes.max())
