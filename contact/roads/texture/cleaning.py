"""Cleaning of a measured profile: outliers are removed, gaps bridged, and both are counted.

An outlier is farther from the median of 11 neighbours than `limit` times 1.4826 times the median
such distance of all points, and farther than 50 um. For Gaussian noise the factor yields the
standard deviation, and the laser's own noise and the crests of fine waves remain. Gaps, outliers
included, are bridged by straight lines up to a length; longer ones are refused, since their heights
would be invented.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
_NEIGHBOURS = 11
_NOISE = 50e-6  # m
MOST_LOST = 0.1  # share of a profile that may be bridged


@dataclass(frozen=True)
class Cleaned:
    """`profile` (n,) m without holes; counts of `missing` and `outliers`; `longest` gap, m."""

    profile: Array
    missing: int
    outliers: int
    longest: float

    @property
    def summary(self) -> str:
        """The processing, in one line."""
        count = len(self.profile)
        lost = 100 * (self.missing + self.outliers) / count
        return (
            f"laser profile of {count} points: {self.missing} missing and {self.outliers} outliers bridged by "
            f"straight lines ({lost:.2g} %, longest {1e3 * self.longest:.3g} mm)"
        )


def cleaned(profile: Array, pitch: float, limit: float, longest: float, source: str) -> Cleaned:
    """Clean heights (n,) m every `pitch` m, nan where missing; gaps up to `longest` m are bridged.

    InputError if there is no valid height, if a gap is longer, or if more than a tenth would be
    bridged.
    """
    missing = np.isnan(profile)
    if missing.all():
        raise InputError(f"{source}: none of the {len(profile)} heights is a number")
    bridged = _bridged(profile, missing)
    outlier = _outliers(bridged, limit) & ~missing
    lost = missing | outlier
    gap, place = _longest_run(lost)
    if gap * pitch > longest * (1 + 1e-9):
        raise InputError(
            f"{source}: {gap * pitch:.3g} m without a sound height at {place * pitch:.4g} m, more than "
            f"road.longest_gap = {longest:g} m; cut the profile there, or allow longer gaps"
        )
    if lost.mean() > MOST_LOST:
        raise InputError(
            f"{source}: {int(missing.sum())} heights are missing and {int(outlier.sum())} are outliers, "
            f"{100 * lost.mean():.3g} % of {len(profile)}, more than {100 * MOST_LOST:g} %: the measurement "
            "is of no use"
        )
    whole = _bridged(profile, lost)
    return Cleaned(whole, int(missing.sum()), int(outlier.sum()), gap * pitch)


def _outliers(profile: Array, limit: float) -> NDArray[np.bool_]:
    from scipy.ndimage import median_filter  # not needed to read a scene

    distance = np.abs(profile - median_filter(profile, _NEIGHBOURS, mode="nearest"))
    return distance > max(limit * 1.4826 * float(np.median(distance)), _NOISE)


def _bridged(profile: Array, lost: NDArray[np.bool_]) -> Array:
    place, known = np.arange(len(profile)), np.flatnonzero(~lost)
    return np.interp(place, known, profile[known])


def _longest_run(lost: NDArray[np.bool_]) -> tuple[int, int]:
    """Number of points in the longest run of lost ones, and where it begins."""
    change = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    begin, end = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    if len(begin) == 0:
        return 0, 0
    which = int(np.argmax(end - begin))
    return int(end[which] - begin[which]), int(begin[which])
