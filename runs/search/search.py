"""The search for settings: trials from coarse to fine until the estimated error meets the target.

The next settings are those predicted to meet the target at the lowest cost. The prediction starts from a trial's errors by cause, each with a known order in its size
(contact.results.error_bars.orders), and its measured seconds by stage, scaled with the sizes of the
stages (scene.estimate). Rungs are climbed one at a time, each time the one that removes most
squared error per cost, until the target is predicted to be met; then those that it is clearly met
without are left again, the most expensive first.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tireroad.contact.results.error_bars import CAUSES, orders
from tireroad.fem.errors import ConvergenceError, InputError, UnsuitedSettings
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.disk import signed, write_text
from tireroad.runs.files.folder import CHOSEN
from tireroad.runs.files.names import STAGES
from tireroad.runs.files.trials import MARGIN, Settings, Trial, worst
from tireroad.runs.pipeline import Finished, run_scene
from tireroad.runs.process import console
from tireroad.runs.process.demand import DOUBTFUL
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.surroundings import available_memory
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.physics import compounds
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.search import journal
from tireroad.runs.search.journal import SearchJournal, errors_of, shown
from tireroad.runs.search.settings import MARGINAL, Ladders, applied, size_ratio

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
    wall = len(compounds(scene.tire, scene.temperature))
    rates = orders(now.order, trial.scheme, scene.contact.has_friction, wall)
    costs = _Costs(scene, trial)
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
        cause, finer = max(
            choices, key=lambda choice: _worth(over, choice[0], choice[1], now, costs, rates)
        )
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
        enough = [rung for rung in lower if rung is not None and met(rung)]
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
    unknown = [choice for choice in choices if not np.isfinite(known[choice[0]])]
    if not np.isfinite(errors).all():
        return unknown  # its companion run fails: the coarse setting behind it is refined first
    climbing = {cause for cause, _ in choices}
    stuck = any(error > AIM for cause, error in known.items() if cause not in climbing)
    return [choice for choice in choices if known[choice[0]] > AIM * (1.0 if stuck else SMALL)]


def fits(scene: Scene, settings: Settings, processes: int) -> bool:
    """Whether the available memory holds a run with these settings."""
    needed = processes * sum(estimate(applied(scene, settings)).memory.values())
    return needed < DOUBTFUL * available_memory()


def _after_failure(ladders: Ladders, trial: Trial, processes: int) -> Settings | None:
    """One rung up for mesh and step: a run that fails altogether is too coarse in one of them."""
    rungs = trial.settings.rungs
    settings = ladders.at(rungs | {"mesh": rungs["mesh"] + 1, "step": rungs["step"] + 1})
    return settings if settings is not None and fits(ladders.scene, settings, processes) else None


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
        estimated, known, before = self._estimated(settings), 0.0, 0.0
        for stage, seconds in self._measured.items():
            part = _STAGE.get(stage, stage)
            if self._base.get(part):
                known += seconds * estimated[part] / self._base[part]
                before += seconds
        rest = sum(self._measured.values()) - before
        return known + rest * (known / before if before else 1.0)

    def _estimated(self, settings: Settings) -> Mapping[str, float]:
        key = str(settings)
        if key not in self._model:
            self._model[key] = estimate(applied(self._scene, settings)).work
        return self._model[key]


@dataclass(frozen=True)
class Search:
    """A search for a scene's settings, with results in `directory`; `cache`: the user's."""

    scene: Scene
    directory: Path
    comm: MPI.Comm
    petsc_options: list[str]
    cache: Cache = NO_CACHE

    def run(self) -> None:
        """Run trials until one surely meets the target, then the run with its settings and stages.

        Within the limits, the closest trial has to do if its estimate meets the target. Raises
        ConvergenceError if not; the results are then those of that trial. Collective.
        """
        on_root(self.comm, lambda: self._begin())
        console.say(f"search    for {self.scene.accuracy.aim()}, {MARGINAL}")
        tried: list[Trial] = []
        why = ""
        settings: Settings | None = self._ladders.first()
        while settings is not None:
            tried.append(self._trial(settings, len(tried) + 1))
            if self._over(tried[-1]) <= 1 / MARGIN:
                self._keep(tried[-1])
                return
            why = self._limit(tried)
            settings = None if why else on_root(self.comm, lambda: self._next(tried[-1]))
        why = why or "no finer settings are left, or the memory that is free does not hold them"
        best = min(tried, key=lambda trial: (self._over(trial), trial.found is None))
        if self._over(best) <= 1:
            console.say(
                f"  {why}; the target is met without the margin of {MARGIN:g} for estimates too small"
            )
            self._keep(best)
        else:
            self._give_up(tried, best, why)

    @cached_property
    def _ladders(self) -> Ladders:
        return Ladders.of(self.scene)

    @cached_property
    def _journal(self) -> SearchJournal:
        """The trials so far. Root process only."""
        return SearchJournal(self.directory, self.scene)

    @property
    def _cache(self) -> Cache:
        """The cache of the trials' stages."""
        return self.cache.of_family(self.directory / journal.FOLDER / "cache")

    def _begin(self) -> None:
        """Keep the scene as given, until settings are found. Root process only."""
        journal.begin(self.directory, dumps(self.scene))
        _ = self._journal

    def _next(self, last: Trial) -> Settings | None:
        return planned(self._ladders, last, self.comm.size)

    def _trial(self, settings: Settings, number: int) -> Trial:
        """Run a trial, or take it from an earlier search; reports its result. Collective."""
        before = on_root(self.comm, lambda: self._journal.known(settings))
        console.say(f"  trial {number}: {settings}{' (from before)' if before else ''}")
        trial = before or self._tried(settings)
        if not before:
            on_root(self.comm, lambda: self._journal.add(trial))
        console.say(f"    {self._line(trial)}")
        return trial

    def _line(self, trial: Trial) -> str:
        cost = f"{sum(trial.seconds.values()):.3g} s a run, {trial.spent:.3g} s of them new"
        if trial.found is None:
            return f"failed: {trial.failed}"
        return f"error {shown(trial.found.over(self.scene.accuracy), self.scene.accuracy)}; scheme {trial.scheme}; {cost}"

    def _tried(self, settings: Settings) -> Trial:
        """Run the scene with these settings up to its error bars, in its own folder. Collective.

        A failure that other settings may avoid is a result. Any other, such as a full disk, is
        raised: it says nothing of the settings, and must not be kept as if it did.
        """
        began = time.perf_counter()
        folder = self.directory / journal.FOLDER / "trial"
        on_root(self.comm, lambda: folder.mkdir(parents=True, exist_ok=True))
        try:
            with console.only_log():
                done = run_scene(
                    applied(self.scene, settings),
                    folder,
                    self.comm,
                    until="accuracy",
                    fresh=False,
                    petsc_options=self.petsc_options,
                    cache=self._cache,
                )
                product, scheme = done.done["accuracy"].product, done.done["contact"].product.scheme
        except (ConvergenceError, UnsuitedSettings) as error:
            spent = self.comm.bcast(time.perf_counter() - began)
            return Trial(settings, {}, spent, failed=str(error))
        except InputError:
            console.say("    not finished; the trials before it are kept: run again, or resume")
            raise
        cost = on_root(self.comm, lambda: seconds(folder))
        spent = self.comm.bcast(time.perf_counter() - began)
        return Trial(settings, cost, spent, errors_of(product, self.scene.accuracy), scheme)

    def _over(self, trial: Trial) -> float:
        """The estimated error over the target; infinite for a failed trial."""
        return worst(trial.found.over(self.scene.accuracy))[0] if trial.found else float("inf")

    def _limit(self, tried: list[Trial]) -> str:
        """The limit of the search that is reached; "" if none."""
        accuracy = self.scene.accuracy
        spent = sum(trial.spent for trial in tried)
        if len(tried) >= accuracy.trials:
            return f"accuracy.trials = {accuracy.trials} are done"
        if accuracy.budget is not None and spent >= accuracy.budget:
            return f"accuracy.budget = {accuracy.budget:g} s is spent ({spent:.0f} s)"
        return ""

    def _keep(self, trial: Trial) -> None:
        """Complete the run with a trial's settings from its stages; write its scene. Collective."""
        chosen = applied(self.scene, trial.settings)
        on_root(self.comm, lambda: write_text(self.directory / CHOSEN, signed(dumps(chosen))))
        console.say(f"  chosen: {trial.settings}; {self.directory / CHOSEN} needs no search")
        tell_error(chosen, self._final(chosen))
        on_root(self.comm, lambda: journal.forget(self.directory))

    def _final(self, scene: Scene) -> Finished:
        """Compute the results of tried settings in the result folder. Collective."""
        return run_scene(
            scene,
            self.directory,
            self.comm,
            until=None,
            fresh=False,
            petsc_options=self.petsc_options,
            cache=self._cache,
        )

    def _give_up(self, tried: list[Trial], best: Trial, why: str) -> None:
        """Compute the best trial's results, then raise ConvergenceError. Collective."""
        accuracy = self.scene.accuracy
        if best.found is None:
            raise ConvergenceError(
                f"accuracy: no trial finished ({why}); the last: {tried[-1].failed}"
            )
        over = best.found.over(accuracy)
        largest = CAUSES[int(over[:, worst(over)[1]].argmax())]
        self._final(applied(self.scene, best.settings))
        raise ConvergenceError(
            f"accuracy: the target is not met: {why}. Reached {shown(over, accuracy)} with {best.settings}; largest part: "
            f"{largest}. Its results are in {self.directory}; take a larger target, or raise accuracy.trials or "
            "accuracy.budget and run again: what was tried is kept"
        )


def seconds(folder: Path) -> dict[str, float]:
    """Seconds by stage of the run in a folder, as when each was computed. Not collective."""
    stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
    return {
        name: sum(entry["cost"].values()) or entry["seconds"]
        for name, entry in stages.items()
        if entry["status"] != "skipped"
    }


def searches(scene: Scene, until: str | None) -> bool:
    """Whether a run up to the stage `until` (None: all) searches for its settings."""
    return scene.accuracy.searches and not (
        until and STAGES.index(until) < STAGES.index("accuracy")
    )


def search(
    scene: Scene,
    directory: Path,
    comm: MPI.Comm,
    *,
    fresh: bool,
    petsc_options: list[str],
    cache: Cache = NO_CACHE,
) -> None:
    """Search for the settings that meet the scene's target. Collective.

    `fresh`: reuse nothing of earlier runs and trials.
    """
    if fresh:
        on_root(comm, lambda: _forget(directory))
    Search(scene, directory, comm, petsc_options, cache).run()


def tell_error(scene: Scene, done: Finished) -> None:
    """Report whether the target error is met, if it was estimated. Collective."""
    if not scene.accuracy.aimed or "accuracy" not in done.done:
        return
    over = errors_of(done.done["accuracy"].product, scene.accuracy).over(scene.accuracy)
    text = f"estimated error of the {scene.accuracy.of.replace('_', ' ')}: {shown(over, scene.accuracy)}"
    if worst(over)[0] <= 1:
        console.say(f"{text}, within the target")
    else:
        console.warn(
            f"{text}, more than the target: accuracy.search = true looks for better settings"
        )


def _forget(directory: Path) -> None:
    """Remove the trials and their stages. Root process only."""
    journal.forget(directory)
    SearchJournal.forget(directory)
