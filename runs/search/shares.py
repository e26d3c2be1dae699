"""The estimated error of a run relative to its target, by cause and figure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tireroad.contact.results.error_bars import CAUSES
from tireroad.runs.scene.tables.accuracy import Accuracy as Wanted
from tireroad.runs.stages.accuracy import Accuracy

VERTICAL = 2


@dataclass(frozen=True)
class Found:
    """Estimated errors of a run's vertical force by cause; NaN where unknown.

    `history` and `mean`: relative; `level` dB of each third octave at `centre` Hz, up to the
    highest frequency of interest.
    """

    history: Mapping[str, float]
    mean: Mapping[str, float]
    centre: tuple[float, ...]
    level: Mapping[str, tuple[float, ...]]

    @classmethod
    def of(cls, product: Accuracy, wanted: Wanted) -> Found:
        """Errors of the force that the target applies to."""
        bars = product.by_cause.get(wanted.of, {})
        below = np.flatnonzero(product.centre <= product.up_to)
        unknown = (float("nan"),) * len(below)
        mean = abs(float(product.mean[wanted.of][VERTICAL])) if wanted.of in product.mean else 0.0
        return cls(
            {c: float(bar.history[VERTICAL]) for c, bar in bars.items()},
            {c: float(bar.mean[VERTICAL]) / mean if mean else 0.0 for c, bar in bars.items()},
            tuple(map(float, product.centre[below])),
            {
                c: tuple(map(float, bars[c].level[below, VERTICAL])) if c in bars else unknown
                for c in CAUSES
            },
        )

    def over(self, wanted: Wanted) -> np.ndarray:
        """Errors (causes, figures) over their targets; infinite where unknown."""
        columns = []
        if wanted.target is not None:
            for values in (self.history, self.mean):
                columns.append([values.get(cause, np.nan) / wanted.target for cause in CAUSES])
        if wanted.target_db is not None:
            levels = np.array([self.level[cause] for cause in CAUSES]).reshape(len(CAUSES), -1)
            # Without a band below that frequency, nothing is known.
            columns += list((levels / wanted.target_db).T) or [[np.nan] * len(CAUSES)]
        return np.nan_to_num(np.array(columns, float).T, nan=np.inf)


def worst(over: np.ndarray) -> tuple[float, int]:
    """The largest total error over its target, and the index of that figure; 1 or less meets it."""
    totals = np.sqrt((over**2).sum(axis=0))
    figure = int(totals.argmax())
    return float(totals[figure]), figure


def shown(over: np.ndarray, wanted: Wanted) -> str:
    """The error and its shares in words, for the figure that is furthest from its target."""
    total, figure = worst(over)
    relative = 2 if wanted.target is not None else 0
    unit, scale = (
        ("%", 100 * (wanted.target or 0.0)) if figure < relative else ("dB", wanted.target_db)
    )
    parts = ", ".join(
        f"{cause} {_number(scale * value)}"
        for cause, value in zip(CAUSES, over[:, figure], strict=True)
    )
    return f"{_number(scale * total)} {unit} ({parts})"


def _number(value: float) -> str:
    return f"{value:.2g}" if np.isfinite(value) else "unknown"
