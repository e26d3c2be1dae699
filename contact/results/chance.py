"""The chance of a random road in third-octave levels: of records of it, beside the process.

A stretch of road is cut into windows that overlap by half. With Hann's weight w_t (t = 0 ... N-1) and g_i the share of line
i that lies in a band, the band has the power P = mean over windows a of sum_i g_i |X_ai|^2. For stationary Gaussian
noise whose density is level across the band

    Var P / (E P)^2 = sum_ab sum_ij g_i g_j r_|a-b|(i - j) / (W sum_i g_i)^2,
    r_s(d) = |sum_t w_t w_(t + s N/2) exp(-2 pi i d t / N)|^2 / (sum_t w_t^2)^2,

W windows (P. D. Welch, IEEE Trans. Audio Electroacoust. 15, 1967). P has about a chi-square distribution of
nu = 2 (E P)^2 / Var P degrees of freedom. Half overlap recovers what Hann's weight takes from the ends: of a long stretch a
window of its length has 3.9 degrees of freedom at 3.4 lines across a band, twice that for each second of the record.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from tireroad.contact.results.spectra import confidence, lowest_wanted, wide_enough

Array = np.ndarray
LEAST_WINDOWS = 2  # whose spread tells anything
MOST_WINDOWS = 16  # of a stretch
MOST_STRETCHES = 1024
_SURE = 0.95
_STEPS = 512  # at which Hann's weight is taken


@dataclass(frozen=True)
class StretchPlan:
    """A number of `stretches` of road beside a run's own, each of so many half-overlapping `windows` of the run's length."""

    stretches: int
    windows: int

    @property
    def all_windows(self) -> tuple[int, ...]:
        """Windows of each stretch, the run's own first."""
        return 1, *[self.windows] * self.stretches


def shift(length: int) -> int:
    """Steps from one window of `length` steps to the next."""
    return length - length // 2


def steps(windows: int, length: int) -> int:
    """Steps of a record of so many `windows` of `length` steps."""
    return length + (windows - 1) * shift(length)


def windows(values: Array, length: int) -> list[Array]:
    """The half-overlapping windows (length, ...) of values (n, ...); what is left at the end is left out."""
    last = len(values) - length
    return [values[first : first + length] for first in range(0, last + 1, shift(length))]


def freedom(centre: Array, spacing: float, held: Sequence[int] = (1,)) -> Array:
    """Degrees of freedom (b,) of the third octaves at `centre` (b,) Hz, of lines `spacing` Hz apart.

    `held`: windows of each of several independent stretches, whose powers are averaged; by default one window alone.
    """
    count, several = np.array(held, float), np.array(held) > 1
    within, between = count.sum(), (count - 1)[several].sum()
    degrees = []
    for middle in np.atleast_1d(centre):
        own, next_ = _variances(float(middle), spacing)
        degrees.append(2 * within**2 / (within * own + 2 * between * next_))
    return np.array(degrees)


def _variances(centre: float, spacing: float) -> tuple[float, float]:
    """Variance of the power of a window in a band, over its square, and covariance of two that follow each other."""
    first, last = centre * 10**-0.05 / spacing, centre * 10**0.05 / spacing
    lines = np.arange(np.floor(first + 0.5), np.ceil(last - 0.5) + 1)
    share = np.clip(np.minimum(lines + 0.5, last) - np.maximum(lines - 0.5, first), 0.0, 1.0)
    share /= share.sum()
    pairs = np.correlate(share, share, "full")[len(share) - 1 :]  # sum_i g_i g_(i+d), d >= 0
    pairs[1:] *= 2
    return tuple(float(pairs[: len(r)] @ r[: len(pairs)]) for r in _correlations())  # type: ignore[return-value]


@cache
def _correlations() -> tuple[Array, Array]:
    """r_0(d) and r_1(d), d = 0 ... 15, beyond which they are below 1e-7."""
    weight = np.sin(np.pi * np.arange(_STEPS) / _STEPS) ** 2
    lags, half = 16, _STEPS // 2
    products = weight**2, np.concatenate([weight[half:] * weight[:half], np.zeros(half)])
    own, next_ = (
        np.abs(np.fft.fft(product)[:lags]) ** 2 / (weight @ weight) ** 2 for product in products
    )
    return own, next_


def asked(spacing: float, up_to: float) -> Array:
    """Centres (b,) Hz of the bands whose chance is to be small: those of a record with lines `spacing` Hz apart, from 63 Hz
    on, or the highest one below `up_to` Hz where that is lower."""
    return wide_enough(spacing, up_to, lowest_wanted(up_to))


def largest(degrees: Array) -> float:
    """The larger of the two 95 % bounds, dB, of the level with the fewest degrees of freedom."""
    return float(np.abs(confidence(degrees)).max(initial=0.0))


def planned(centre: Array, spacing: float, decibels: float) -> StretchPlan:
    """As few stretches as bring the levels at `centre` (b,) Hz within `decibels` dB of those of the process, in 95 %.

    `spacing` (Hz): of the lines of the run's own record. A longer stretch is cheaper than several: it has one run-in, and
    overlapping windows. There are two at least, for two processes, and a power of two beyond `MOST_WINDOWS` windows each,
    whatever the number of processes, so that results do not depend on it.
    """
    if not len(centre) or largest(freedom(centre, spacing)) <= decibels:
        return StretchPlan(0, 0)
    count = 2
    while count < MOST_STRETCHES:
        for each in range(1, MOST_WINDOWS + 1):
            plan = StretchPlan(count, each)
            if largest(freedom(centre, spacing, plan.all_windows)) <= decibels:
                return plan
        count *= 2
    return StretchPlan(MOST_STRETCHES, MOST_WINDOWS)


def pooled(level: Array) -> Array:
    """Levels (b, ...) dB of the mean power of windows with the levels (w, b, ...) dB."""
    return level[0] if len(level) == 1 else 10 * np.log10(np.mean(10 ** (level / 10), axis=0))


def spread(level: Array, each: Array, together: Array) -> Array:
    """dB (b, ..., 2), negative and positive, to add to `pooled` levels, by the spread of their windows' levels (w, b, ...).

    As `confidence` for the degrees of freedom that the powers p of the windows show,

        nu = 2 mean(p)^2 / var(p) * together / each * (1.96 / t)^2,

    `together` (b,) of all windows over `each` (b,) of one undo their overlap, and Student's t (w - 1) for 1.96 what the
    spread of few windows leaves open. Wider than by the number of lines where forces are no Gaussian noise, as on
    single obstacles. NaN for fewer than `LEAST_WINDOWS`, and where nothing varies.
    """
    from scipy import stats

    count, b = len(level), level.shape[1]
    if count < LEAST_WINDOWS:
        return np.full((*level.shape[1:], 2), np.nan)
    power = 10 ** ((level - level.max(axis=0)) / 10)
    varied = power.var(axis=0, ddof=1)
    share = (together / each).reshape(b, *[1] * (level.ndim - 2))
    normal, student = stats.norm.ppf((1 + _SURE) / 2), stats.t.ppf((1 + _SURE) / 2, count - 1)
    seen = 2 * power.mean(axis=0) ** 2 * share * (normal / student) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return confidence(np.where(varied > 0, seen / varied, np.nan))
