"""Error bars of a run, from companion runs whose error is larger or smaller by a known ratio.

For a quantity Q with an error proportional to h^r, of a run at h and a companion at q h:

    Q_h - Q_0 = (Q_qh - Q_h) / (q^r - 1),

the share 1 / |q^r - 1| of their difference. For a history the difference is taken line by line of
its spectrum, with phase. Errors of several causes add as squares.

The error due to the points depends on where the edge of the contact falls between them, which
differs from grid to grid. The errors of the two runs are therefore nearly independent, their mean
squares add, and the share of the root mean square is 1 / (1 + q^2r)^(1/2) (`random_share`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tireroad.contact.results.spectra import deviation, low_part, third_octaves

_NAMES = ("mean", "deviation", "level", "history")
CAUSES = ("step", "points", "modes", "mesh")


def orders(elements: int, scheme: str = "linear") -> dict[str, float]:
    """Order of the error in the size that causes it, by cause.

    `elements`: order of the mesh; `scheme`: the force's course within a step. Step: second order
    with linear forces, first with constant ones (half a step of delay). Points: a footprint's
    pressure ends as the square root of the distance to its edge. Modes: the error of static
    responses falls as the cube of the highest frequency. Mesh: displacements of order p have order
    p + 1 in the mean (Nitsche), observed between 3.7 and 4.7 for order 3 (histories of 18 x 8
    elements beside 9 x 4 and 30 x 12; bench error_bars).
    """
    step = 1.0 if scheme == "constant" else 2.0
    return {"step": step, "points": 1.5, "modes": 3.0, "mesh": elements + 1.0}


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
    `centre` (b,) Hz; `low` (f, 3) N: Fourier coefficients of the variable part up to a frequency
    (contact.results.spectra.low_part).
    """

    mean: np.ndarray
    deviation: np.ndarray
    centre: np.ndarray
    level: np.ndarray
    low: np.ndarray


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


def measured(force: np.ndarray, step: float, limit: float, up_to: float = np.inf) -> Measured:
    """The quantities of a force (n, 3) N in steps of `step` s.

    Deviation and bands below `limit` Hz; the history up to `up_to` Hz, if that is lower.
    """
    centre, level = third_octaves(force, step, limit)
    mean = force.mean(axis=0)
    low = low_part(force - mean, len(force) * step, min(limit, up_to))
    return Measured(mean, deviation(force, step, limit), centre, level, low)


def bars(run: Measured, companion: Measured, share: float) -> Bars:
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
        share * _apart(run.low, companion.low),
    )


def _apart(run: np.ndarray, companion: np.ndarray) -> np.ndarray:
    """Relative L2 distance (3,) of two spectra (f, 3) on the same lines."""
    count = min(len(run), len(companion))
    size = np.linalg.norm(run, axis=0)
    off = np.linalg.norm(companion[:count] - run[:count], axis=0)
    return np.divide(off, size, out=np.full(size.shape, np.nan), where=size > 0)


def total(causes: Mapping[Any, Bars]) -> Bars:
    """The error from all causes: the root of the sum of squares, NaN if a cause is unknown."""
    parts = [np.sqrt(sum(getattr(bar, name) ** 2 for bar in causes.values())) for name in _NAMES]
    return Bars(*parts)
