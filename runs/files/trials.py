"""search.json: the trials of a search for an accuracy, their settings and their errors by cause."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from tireroad.contact.results.error_bars import CAUSES

VERTICAL = 2
NAME = "search.json"
# An estimate can be smaller than the true error by this factor, and seldom by more
# (docs/verification/accuracy-on-demand.md): searches aim at the target over it.
MARGIN = 1.2


@dataclass(frozen=True)
class Settings:
    """One choice of settings.

    `mesh`: elements around and from bead to bead, of an `order`; modes `up_to` Hz; `residual`;
    `pitch` m of the points; `step` s; `rungs`: position on the ladder of each cause.
    """

    mesh: tuple[int, int]
    order: int
    up_to: float
    residual: str
    pitch: float
    step: float
    rungs: dict[str, int]

    def __str__(self) -> str:
        around, along = self.mesh
        return (
            f"{around} x {along} elements of order {self.order}, modes up to {self.up_to:.4g} Hz, residual "
            f"{self.residual}, points {1e3 * self.pitch:.3g} mm, step {1e3 * self.step:.3g} ms"
        )


class Target(Protocol):
    """Largest error asked for: relative, and in dB; None where it is not asked for."""

    @property
    def target(self) -> float | None: ...

    @property
    def target_db(self) -> float | None: ...


@dataclass(frozen=True)
class ErrorsByCause:
    """Estimated errors of a run's vertical force by cause; NaN where unknown.

    `history` and `mean`: relative; `level` dB of each third octave at `centre` Hz, up to the
    highest frequency of interest.
    """

    history: Mapping[str, float]
    mean: Mapping[str, float]
    centre: tuple[float, ...]
    level: Mapping[str, tuple[float, ...]]

    def over(self, target: Target) -> np.ndarray:
        """Errors (causes, figures) over their targets; infinite where unknown."""
        columns = []
        if target.target is not None:
            for values in (self.history, self.mean):
                columns.append([values.get(cause, np.nan) / target.target for cause in CAUSES])
        if target.target_db is not None:
            levels = np.array([self.level[cause] for cause in CAUSES]).reshape(len(CAUSES), -1)
            # Without a band below that frequency, nothing is known.
            columns += list((levels / target.target_db).T) or [[np.nan] * len(CAUSES)]
        return np.nan_to_num(np.array(columns, float).T, nan=np.inf)


def worst(over: np.ndarray) -> tuple[float, int]:
    """The largest total error over its target, and the index of that figure; 1 or less meets it."""
    totals = np.sqrt((over**2).sum(axis=0))
    figure = int(totals.argmax())
    return float(totals[figure]), figure


@dataclass(frozen=True)
class Trial:
    """Settings and their result: `found` errors, or the reason (`failed`) why there are none.

    `seconds` by stage of a run with these settings, reused stages at their original cost; `spent` s
    by this trial alone; `scheme` of its time loop.
    """

    settings: Settings
    seconds: Mapping[str, float]
    spent: float
    found: ErrorsByCause | None = None
    scheme: str = ""
    failed: str = ""


def read_trials(path: Path) -> list[Trial]:
    """All trials in a file, of any scene. Raises OSError, ValueError or KeyError without any."""
    return [trial_of(trial) for trial in json.loads(path.read_text(encoding="utf-8"))["trials"]]


def trial_of(data: dict[str, Any]) -> Trial:
    settings = data["settings"] | {"mesh": tuple(data["settings"]["mesh"])}
    best = data["found"]
    if best is not None:
        level = {cause: tuple(values) for cause, values in best["level"].items()}
        best = ErrorsByCause(best["history"], best["mean"], tuple(best["centre"]), level)
    return Trial(**data | {"settings": Settings(**settings), "found": best})
