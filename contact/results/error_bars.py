"""Error bars of a run, from companion runs whose error is larger or smaller by a known ratio.

For a quantity Q with an error proportional to h^r, of a run at h and a companion at q h:

    Q_h - Q_0 = (Q_qh - Q_h) / (q^r - 1),

the share 1 / |q^r - 1| of their difference. For a history the difference is taken line by line of
its spectrum, with phase. Errors of several causes add as squares.

The error due to the points depends on where the edge of the contact falls between them, which
differs from grid to grid. The errors of the two runs are therefore nearly independent, their mean
squares add, and the share of the root mean square is 1 / (1 + q^2r)^(1/2) (`random_share`).

A figure changes by that part of an error which has its phase, with either sign. With two independent errors of one size, the difference
in one figure is below half of the error in 30 % of cases and within a factor of two in 41 %; where the error's size is known exactly, in 5
and 57 %. Mean, deviation and levels are therefore told by the sizes of lines (`estimated`).

A model with modes to f_m is off at f as one with modes to q f_m is at q f. The companion of fewer modes is therefore judged in
the band that its own modes cover, up to q times the run's, and its error there is the run's in its whole band (`similar`). Line by
line, since levels and deviations differ by the part in phase alone, which is as likely to vanish.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tireroad.contact.results.chance import freedom
from tireroad.contact.results.spectra import (
    FEWEST,
    band_sums,
    deviation,
    low_part,
    third_octaves,
)
from tireroad.greens.schemes import SCHEMES

_NAMES = ("mean", "deviation", "level", "history")
# Of an error of any phase, what counts in a level: 0.7 in the mean square where a band has one phase, less with several.
# Understated by more than two are then a tenth of the levels (docs/verification/error-bars.md).
_IN_LEVEL = 0.5
_PHASES = 4.0  # degrees of freedom of a third octave's error by a response: two phases

# Lines next to the mean that its removal under a Hann window leaves as they are, and the square of that window in the mean.
_BESIDE_MEAN, _HANN = slice(2, 4), 3 / 8

CAUSES = ("step", "points", "modes", "mesh")


def orders(
    elements: int, scheme: str = "linear", friction: bool = False, compounds: int = 1
) -> dict[str, float]:
    """Order of the error in the size that causes it, by cause.

    `elements`: order of the mesh, of a wall of so many `compounds`; `scheme`: the force's course within a step. Step: second order
    with linear forces, first with constant ones (half a step of delay) and with `friction`, which meets the road and begins to
    slide at the end of a step (quickstart against steps of 6.25 us, vertical axle force: 2.6 % in steps of 50 us, of which
    twice the step tells 1.6 %; 1.6 and 1.6 % in steps of 25 us). Points: a footprint's
    pressure ends as the square root of the distance to its edge. Modes: the error of static
    responses falls as the cube of the highest frequency. Mesh: displacements of order p have order
    p + 1 in the mean (Nitsche), observed between 3.7 and 4.7 for order 3 (histories of 18 x 8
    elements beside 9 x 4 and 30 x 12; bench error_bars). Where several compounds and their plies end inside the wall, stresses there
    have no bounds, and the order is theirs, whatever that of the elements: 1.5 (the built-in tire on 16 x 10 to 40 x 26 elements of order 2
    beside half of them and 52 x 34: docs/verification/error-bars.md).
    """
    mesh = elements + 1.0 if compounds == 1 else 1.5
    step = 1.0 if friction else SCHEMES[scheme].order
    return {"step": step, "points": 1.5, "modes": 3.0, "mesh": mesh}


def share(ratio: float, order: float) -> float:
    """Error of a run over its difference to a companion of `ratio` times its size."""
    return 1 / abs(ratio**order - 1)


def random_share(ratio: float, order: float) -> float:
    """The same for errors that are independent of each other but for their magnitudes."""
    return 1 / float(np.hypot(1.0, ratio**order))


@dataclass(frozen=True)
class Measured:
    """Quantities of a force for comparison.

    `mean`, `deviation` (3,) N within the valid band of the model; `level` (b, 3) dB of the bands at
    `centre` (b,) Hz, NaN of those for which the record is too short; `lines` (f, 3) N: Fourier coefficients of the variable
    part in that band, `spacing` Hz apart from 0 on (contact.results.spectra.low_part); histories are compared up to `up_to` Hz.
    """

    mean: np.ndarray
    deviation: np.ndarray
    centre: np.ndarray
    level: np.ndarray
    lines: np.ndarray
    spacing: float = 1.0
    up_to: float = np.inf

    def between(self, low: float, high: float) -> np.ndarray:
        """The lines (f', 3) N from `low` to `high` Hz."""
        frequency = self.spacing * np.arange(len(self.lines))
        return self.lines[(frequency >= low) & (frequency <= high * (1 + 1e-9))]

    def around(self, centre: float, decades: float = 0.1) -> tuple[float, float]:
        """Limits (Hz) of so many `decades` around a frequency, a third octave by default, with three lines at least."""
        low, high = centre * 10 ** (-decades / 2), centre * 10 ** (decades / 2)
        least = FEWEST / 2 * self.spacing
        return min(low, centre - least), max(high, centre + least)


def of_sound(pressure: np.ndarray, spacing: float, bands: np.ndarray) -> Measured:
    """Quantities of a sound from the lines (f, k) Pa of its pressure at k microphones from 0 Hz on, `spacing` Hz apart; levels in
    `bands` (b,) Hz."""
    frequency = spacing * np.arange(len(pressure))
    centre, square = band_sums(frequency[1:], np.abs(pressure[1:]) ** 2)
    level = np.full((len(bands), pressure.shape[1]), np.nan)
    own, band = np.nonzero(np.isclose(bands[:, None], centre))
    level[own] = 10 * np.log10(np.maximum(square[band], np.finfo(float).tiny))
    none = np.zeros(pressure.shape[1])
    return Measured(none, none, bands, level, pressure, spacing, float(frequency[-1]))


@dataclass(frozen=True)
class Bars:
    """Estimated errors, NaN where unknown.

    Of the `mean` and `deviation` (3,) N, of each `level` (b, 3) dB, and of the `history` (3,):
    relative L2 norm of the variable part up to a frequency, NaN if nothing varies.
    """

    mean: np.ndarray
    deviation: np.ndarray
    level: np.ndarray
    history: np.ndarray


def measured(
    force: np.ndarray,
    step: float,
    limit: float,
    up_to: float = np.inf,
    bands: np.ndarray | None = None,
) -> Measured:
    """The quantities of a force (n, 3) N in steps of `step` s.

    Deviation and bands below `limit` Hz; the history up to `up_to` Hz, if that is lower. `bands` (b,) Hz: the centres asked
    for, by default those that the record resolves.
    """
    centre, level = third_octaves(force, step, limit)
    if bands is not None:
        own, band = np.nonzero(np.isclose(bands[:, None], centre))
        resolved, level, centre = level, np.full((len(bands), 3), np.nan), bands
        level[own] = resolved[band]
    mean, duration = force.mean(axis=0), len(force) * step
    lines = low_part(force - mean, duration, limit)
    off = deviation(force, step, limit)
    return Measured(mean, off, centre, level, lines, 1 / duration, min(limit, up_to))


def bars(run: Measured, other: Measured, share: float = 1.0) -> Bars:
    """The `share` of the differences of two runs, without sign; NaN of a band that is not in both."""
    level = np.full(run.level.shape, np.nan)
    for k, centre in enumerate(run.centre):
        same = np.flatnonzero(np.isclose(other.centre, centre))
        if len(same):
            level[k] = share * np.abs(other.level[same[0]] - run.level[k])
    return Bars(
        share * np.abs(other.mean - run.mean),
        share * np.abs(other.deviation - run.deviation),
        level,
        share * _apart(run, other, 0.0, run.up_to),
    )


def estimated(
    run: Measured, companion: Measured, share: float, longer: float | None = None
) -> Bars:
    """The error of a run by the `share` of its differences to a companion.

    Of differences d in lines s, with any phase, a figure changes by r in the root mean square:

        level:      r = (sum |d|^2 / nu sum |s|^2)^(1/2), relative, nu its degrees of freedom by chance,
        deviation:  r = (sum |s|^2 |d|^2 / 2)^(1/2) / sum |s|^2, relative,
        mean:       r as the lines next to it, in N;

    what the figure's own difference D has beyond it is systematic, and e^2 = max(D^2 - r^2, 0) + r^2.

    `longer`: of errors that differ from line to line at random, the run's own record over that compared, by which r^2 falls. Other
    errors are those of a response, whose phase turns once or twice within a third octave at a loss factor of a tire: nu is `_PHASES` at
    most, however long the record.
    A band for which the record is too short has no D, and d from the three lines nearest to it; one of which the companion knows nothing
    has no error.
    """
    apart = bars(run, companion)
    level = np.full(run.level.shape, np.nan)
    for k, centre in enumerate(run.centre):
        if not np.isclose(companion.centre, centre).any():
            continue
        size = _apart(run, companion, *run.around(centre))
        here, whole = (freedom(centre, run.spacing / part)[0] for part in (1.0, longer or 1.0))
        if longer is None:
            here = whole = min(here, _PHASES)
        own = np.nan_to_num(10 ** (apart.level[k] / 20) - 1)
        stays = np.maximum(own**2 - size**2 / here, 0.0)
        level[k] = 20 * np.log10(1 + share * np.sqrt(stays + size**2 / whole))
    varies = np.nan_to_num(_in_deviation(run, companion))
    return Bars(
        share * _lasting(apart.mean, _beside_mean(run, companion), longer or 1.0),
        share * _lasting(apart.deviation, varies, longer or 1.0),
        level,
        share * apart.history,
    )


class Relation(NamedTuple):
    """How the error of a run follows from its differences to a companion.

    `share`: of the differences, the error; `within` < 1: of the run's band that in which they are compared, where the error is the
    run's by similarity; `longer`: of errors that differ from line to line at random, as in `estimated`, else None.
    """

    share: float = 1.0
    within: float = 1.0
    longer: float | None = None

    def bars(self, run: Measured, companion: Measured) -> Bars:
        """The error of the run."""
        if self.within < 1.0:
            return similar(run, companion, self.within)
        return estimated(run, companion, self.share, self.longer)


def _lasting(difference: np.ndarray, random: np.ndarray, longer: float) -> np.ndarray:
    """Size of an error in a `longer` record, from its `difference` in a short one, of which a part is `random`."""
    return np.sqrt(np.maximum(difference**2 - random**2, 0.0) + random**2 / longer)


def _beside_mean(run: Measured, companion: Measured) -> np.ndarray:
    """Difference (3,) N of two means, in the root mean square, by the lines next to them."""
    _, differs = _squares(run, companion)
    lines = differs[_BESIDE_MEAN]
    return np.sqrt(lines.mean(axis=0) / _HANN) if len(lines) else np.zeros(3)


def _in_deviation(run: Measured, companion: Measured, within: float = 1.0) -> np.ndarray:
    """Change (3,) N of a deviation, in the root mean square, by differences of any phase in the lines up to `within` of the band."""
    power, differs = (part[: round(within * len(part))] for part in _squares(run, companion))
    with np.errstate(invalid="ignore", divide="ignore"):
        return run.deviation * np.sqrt((power * differs).sum(axis=0) / 2) / power.sum(axis=0)


def _squares(run: Measured, companion: Measured) -> tuple[np.ndarray, np.ndarray]:
    """Squares (f, 3) of the run's lines and of the companion's differences to them, in the lines that both have."""
    count = min(len(run.lines), len(companion.lines))
    own, other = run.lines[:count], companion.lines[:count]
    return np.abs(own) ** 2, np.abs(other - own) ** 2


def similar(run: Measured, companion: Measured, within: float) -> Bars:
    """The error of the run, by similarity that of a companion at frequencies `within` (< 1) times its own.

    Relative differences e in the band of the companion, up to `within` times that of the run, are those of the run in its whole
    band. A third octave at f takes the geometric mean of e at `within` f and at f, of which one is smaller and one larger than
    the run's: with an order of 3 and `within` 0.7 their mean is 1.09 times that. Of an error with any phase in each line, a part
    counts in a level, and in a deviation as in `estimated`.
    """
    level = np.full(run.level.shape, np.nan)
    for k, centre in enumerate(run.centre):
        here = _apart(run, companion, *run.around(centre))
        there = _apart(run, companion, *run.around(within * centre, 0.2))
        level[k] = _in_level(np.sqrt(here * there))
    return Bars(
        np.maximum(np.abs(companion.mean - run.mean), _beside_mean(run, companion)),
        _in_deviation(run, companion, within),
        level,
        _apart(run, companion, 0.0, within * run.up_to),
    )


def _in_level(apart: np.ndarray) -> np.ndarray:
    """Error (...) dB of a level whose lines are so far apart, relative."""
    return 20 * np.log10(1 + _IN_LEVEL * apart)


def _apart(run: Measured, companion: Measured, low: float, high: float) -> np.ndarray:
    """Relative L2 distance (3,) of two spectra from `low` to `high` Hz, NaN where there is nothing."""
    own, other = run.between(low, high), companion.between(low, high)
    count = min(len(own), len(other))
    size = np.linalg.norm(own, axis=0)
    off = np.linalg.norm(other[:count] - own[:count], axis=0)
    return np.divide(off, size, out=np.full(size.shape, np.nan), where=size > 0)


def total(causes: Mapping[Any, Bars]) -> Bars:
    """The error from all causes: the root of the sum of squares, NaN if a cause is unknown."""
    parts = [np.sqrt(sum(getattr(bar, name) ** 2 for bar in causes.values())) for name in _NAMES]
    return Bars(*parts)
