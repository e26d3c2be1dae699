"""Chooses the next settings: those predicted to meet the target at the lowest cost.

Starts from a trial's errors by cause, each with a known order in its size
(contact.results.error_bars.orders), and its measured seconds by stage, scaled with the sizes of the
stages (scene.extent.estimate). Rungs are climbed one at a time, each time the one that removes most
squared error per cost, until the target is predicted to be met; then those that it is clearly met
without are left again, the most expensive first.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from tireroad.contact.results.error_bars import orders
from tireroad.runs.process.memory import available_memory
from tireroad.runs.scene.extent.demand import DOUBTFUL
from tireroad.runs.scene.extent.estimate import estimate
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.search.journal import Trial
from tireroad.runs.search.settings import CAUSES, MARGIN, Ladders, Settings, applied, size_ratio
from tireroad.runs.search.shares import worst

AIM = 0.9 / MARGIN  # of the target; 0.9: the orders hold only asymptotically
AT_ONCE = {"mesh": 2, "modes": 2, "points": 1, "step": 1}  # most rungs per plan: same reason
# Of the aim: a cause is refined only above it. If another cause misses the aim alone and has no more
# rungs, or no more per plan, only a cause that does so too is: the next trial cannot meet the target,
# and shows whether the others are needed (cobblestones under a soft torus: they were not).
SMALL = 0.25
# Of the aim: rungs are left again only where the rest is predicted this far below it. Left at the aim
# itself, a radial tire needed a third trial (bench accuracy_on_demand, sine).
_CLEAR = 0.85
_STAGE = {"contact": "contact loop"}  # name in the estimate
_LEAST = 1e-3  # s


def planned(ladders: Ladders, trial: Trial, processes: int) -> Settings | None:
    """The next settings after a trial that misses its target; None if none are left or fit.

    Reads the road's file; on one process only, as the result depends on the available memory.
    """
    scene = ladders.scene
    if trial.found is None:
        return _after_failure(ladders, trial, processes)
    over, now = trial.found.over(scene.accuracy), trial.settings
    costs, rates = _Costs(scene, trial), orders(now.order, trial.scheme)
    begun = now.rungs
    while worst(over)[0] > AIM:
        choices = [
            (cause, finer)
            for cause, finer in ladders.finer(now)
            if finer.rungs[cause] - begun[cause] <= AT_ONCE[cause] and fits(scene, finer, processes)
        ]
        choices = _worthwhile(over, choices)
        if not choices:
            break
        cause, finer = max(choices, key=lambda one: _worth(over, one[0], one[1], now, costs, rates))
        over, now = _finer(over, cause, now, finer, rates), finer
    now = _without_excess(ladders, trial, now, costs, rates)
    return now if now != trial.settings else None


def _without_excess(
    ladders: Ladders, trial: Trial, now: Settings, costs: _Costs, rates: Mapping[str, float]
) -> Settings:
    """`now`, without the rungs above the trial's that it is predicted to be clearly met without.

    The rung that removes most error per cost comes first, and is no longer needed if one that
    removes more has to follow.
    """
    assert trial.found is not None
    begun, first = trial.settings, trial.found.over(ladders.scene.accuracy)

    def met(settings: Settings) -> bool:
        over = first
        for cause in CAUSES:
            if settings.rungs[cause] > begun.rungs[cause]:
                over = _finer(over, cause, begun, settings, rates)
        return worst(over)[0] <= _CLEAR * AIM

    while met(now):
        lower = (
            ladders.at(now.rungs | {cause: now.rungs[cause] - 1})
            for cause in CAUSES
            if now.rungs[cause] > begun.rungs[cause]
        )
        enough = [one for one in lower if one is not None and met(one)]
        if not enough:
            break
        now = min(enough, key=costs)
    return now


def _worthwhile(
    over: np.ndarray, choices: list[tuple[str, Settings]]
) -> list[tuple[str, Settings]]:
    """The choices whose cause matters for the error; if any is unknown, only unknown ones."""
    errors = over[:, worst(over)[1]]
    known = dict(zip(CAUSES, errors, strict=True))
    unknown = [one for one in choices if not np.isfinite(known[one[0]])]
    if not np.isfinite(errors).all():
        return unknown  # its companion run fails: the coarse setting behind it is refined first
    climbing = {cause for cause, _ in choices}
    stuck = any(error > AIM for cause, error in known.items() if cause not in climbing)
    return [one for one in choices if known[one[0]] > AIM * (1.0 if stuck else SMALL)]


def fits(scene: Scene, settings: Settings, processes: int) -> bool:
    """Whether the available memory holds a run with these settings."""
    needed = processes * sum(estimate(applied(scene, settings)).memory.values())
    return needed < DOUBTFUL * available_memory()


def _after_failure(ladders: Ladders, trial: Trial, processes: int) -> Settings | None:
    """One rung up for mesh and step: a run that fails altogether is too coarse in one of them."""
    rungs = trial.settings.rungs
    found = ladders.at(rungs | {"mesh": rungs["mesh"] + 1, "step": rungs["step"] + 1})
    return found if found is not None and fits(ladders.scene, found, processes) else None


def _worth(
    over: np.ndarray,
    cause: str,
    finer: Settings,
    now: Settings,
    costs: _Costs,
    rates: Mapping[str, float],
) -> float:
    """Squared error removed by the finer settings per second that they add."""
    row, figure = CAUSES.index(cause), worst(over)[1]
    if not np.isfinite(over[row, figure]):
        return np.inf
    after = _finer(over, cause, now, finer, rates)
    gain = over[row, figure] ** 2 - after[row, figure] ** 2
    return float(gain) / max(costs(finer) - costs(now), _LEAST)


def _finer(
    over: np.ndarray, cause: str, now: Settings, finer: Settings, rates: Mapping[str, float]
) -> np.ndarray:
    """Predicted errors after refining a cause, by the `rates` of all; an unknown one becomes 0."""
    after = over.copy()
    row = CAUSES.index(cause)
    known = np.isfinite(after[row])
    ratio = size_ratio(cause, now, finer) ** rates[cause]
    after[row] = np.where(known, after[row] * ratio, 0.0)
    return after


class _Costs:
    """Seconds of a run with given settings, predicted from a trial's."""

    def __init__(self, scene: Scene, trial: Trial) -> None:
        self._scene, self._measured = scene, trial.seconds
        self._model: dict[str, Mapping[str, float]] = {}
        self._base = self._estimated(trial.settings)

    def __call__(self, settings: Settings) -> float:
        """Seconds of all stages; stages unknown to the model are scaled like the others."""
        wanted, known, before = self._estimated(settings), 0.0, 0.0
        for stage, seconds in self._measured.items():
            part = _STAGE.get(stage, stage)
            if self._base.get(part):
                known += seconds * wanted[part] / self._base[part]
                before += seconds
        rest = sum(self._measured.values()) - before
        return known + rest * (known / before if before else 1.0)

    def _estimated(self, settings: Settings) -> Mapping[str, float]:
        key = str(settings)
        if key not in self._model:
            self._model[key] = estimate(applied(self._scene, settings)).work
        return self._model[key]
