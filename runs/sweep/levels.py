"""Third octaves of a sweep's members in dB relative to the first with any, with their uncertainty.

Members that differ only in a seed are samples of one road: their powers are averaged, and the mean
power lies within t s / sqrt(n) of that of all roads in 95 of 100 cases (Student's t with n - 1
degrees of freedom, s the standard deviation over the n seeds). The error bars of the runs
(contact.results.error_bars) are added as squares; both are independent of each other and of those
of other members.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from tireroad.runs.sweep.gather import Gathered

Array = NDArray[np.float64]
LEVEL, ERROR = "axle force z, ", "error of the axle force z, "
_SURE = 0.95


@dataclass(frozen=True)
class Levels:
    """Levels of groups of members that differ in seeds only.

    `names`; number of `seeds` that have a level in any band; `level` (g, b) dB re 1 N and its `error` (g, b) dB at the `bands`,
    NaN where nothing is known.
    """

    names: tuple[str, ...]
    seeds: tuple[int, ...]
    bands: tuple[str, ...]
    level: Array
    error: Array

    @property
    def with_bands(self) -> tuple[int, ...]:
        """The groups that have a level in any band."""
        return tuple(np.flatnonzero(np.isfinite(self.level).any(axis=1)).tolist())

    def differences(self) -> tuple[Array, Array]:
        """Differences (g, b) dB from the first group that has bands, and their errors."""
        first = self.with_bands[0]
        both = np.sqrt(self.error**2 + self.error[first] ** 2)
        return self.level - self.level[first], both


def levels(table: Gathered) -> Levels | None:
    """Levels of the vertical axle force; None if no member has a finite one."""
    columns = {column.name: column.values for column in table.columns}
    bands = tuple(
        name.removeprefix(LEVEL) for name in columns if name.startswith(LEVEL) and "Hz" in name
    )
    level = np.array([columns[LEVEL + band] for band in bands]).T
    if not np.isfinite(level).any():
        return None
    nothing = np.full(len(level), np.nan)
    error = np.stack([columns.get(ERROR + band, nothing) for band in bands], axis=1)
    groups = _alike(table)
    found = [_mean(level[members], error[members]) for members in groups.values()]
    return Levels(
        names=tuple(groups),
        seeds=tuple(
            int(np.isfinite(level[members]).any(axis=1).sum()) for members in groups.values()
        ),
        bands=bands,
        level=np.array([one for one, _ in found]),
        error=np.array([off for _, off in found]),
    )


def _alike(table: Gathered) -> dict[str, list[int]]:
    """Members grouped by their settings other than seeds; one group each if no axis is a seed."""
    seeds = [key for key in table.settings if key.rpartition(".")[2] == "seed"]
    if not seeds:
        return {name: [k] for k, name in enumerate(table.names)}
    groups: dict[str, list[int]] = {}
    for k in range(len(table.names)):
        rest = [
            f"{key} = {values[k]}" for key, values in table.settings.items() if key not in seeds
        ]
        groups.setdefault(", ".join(rest) or "all", []).append(k)
    return groups


def _mean(level: Array, error: Array) -> tuple[Array, Array]:
    """Level of the mean power (b,) of n members (n, b), and its error, dB."""
    power = 10 ** (level / 10)
    count = np.isfinite(power).sum(axis=0)
    known = np.where(count > 0, count, 1)
    mean = np.where(count > 0, np.nansum(power, axis=0) / known, np.nan)
    squares = np.nansum((power - mean) ** 2, axis=0)
    more = np.maximum(count - 1, 1)
    width = stats.t.ppf((1 + _SURE) / 2, more) * np.sqrt(squares / more / known)
    spread = np.where(count > 1, 10 * np.log10(1 + width / mean), 0.0)
    own = np.sqrt(np.nansum(np.where(np.isfinite(error), error, 0.0) ** 2, axis=0) / known)
    unknown = ~np.isfinite(error).any(axis=0)
    total = np.sqrt(spread**2 + own**2)
    return 10 * np.log10(mean), np.where(unknown & (count < 2), np.nan, total)
