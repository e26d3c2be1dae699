"""How far the figures of a run may be off, by companions whose error is larger by a known ratio.

For a quantity Q with an error that goes as h^r, of a run at h and a companion at q h:

    Q_h - Q_0 = (Q_qh - Q_h) / (q^r - 1),

the share 1 / (q^r - 1) of the difference of both. Errors of several causes add up as squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tireroad.contact.spectra import third_octaves

_NAMES = ("mean", "deviation", "level")
# Shares of the difference to a companion; each from the known order of what it changes.
SHARES = {
    "step": 1 / 3,  # twice the step: second order
    "points": 1
    / (2**1.5 - 1),  # twice the spacing: a footprint's pressure ends as the root of the distance
    # Modes up to 1/sqrt(2) of the highest: what static answers leave out falls as its cube.
    "modes": 1 / (2**1.5 - 1),
    "mesh": 1
    / (2**2 - 1),  # elements of twice the size: the edge of the footprint leads, second order
}


@dataclass(frozen=True)
class Told:
    """What is told of a force: `mean`, `deviation` (3,) N, `level` (b, 3) dB of the bands at `centre` (b,) Hz."""

    mean: np.ndarray
    deviation: np.ndarray
    centre: np.ndarray
    level: np.ndarray


@dataclass(frozen=True)
class Bars:
    """Estimated errors: of the `mean` and `deviation` (3,) N and of each `level` (b, 3) dB; NaN where unknown."""

    mean: np.ndarray
    deviation: np.ndarray
    level: np.ndarray


def told(force: np.ndarray, step: float, up_to: float) -> Told:
    """Of a force (n, 3) N in steps of `step` s, with the bands below `up_to` Hz."""
    centre, level = third_octaves(force, step, up_to)
    return Told(force.mean(axis=0), force.std(axis=0), centre, level)


def bars(run: Told, companion: Told, share: float) -> Bars:
    """The error of the run: the `share` of its difference to the companion, without sign."""
    level = np.full(run.level.shape, np.nan)
    for k, centre in enumerate(run.centre):
        same = np.flatnonzero(np.isclose(companion.centre, centre))
        if len(same):
            level[k] = share * np.abs(companion.level[same[0]] - run.level[k])
    return Bars(
        share * np.abs(companion.mean - run.mean),
        share * np.abs(companion.deviation - run.deviation),
        level,
    )


def total(causes: Mapping[str, Bars]) -> Bars:
    """Of all causes at once: the root of the sum of squares, NaN where a cause is unknown."""
    parts = [np.sqrt(sum(getattr(bar, name) ** 2 for bar in causes.values())) for name in _NAMES]
    return Bars(*parts)
