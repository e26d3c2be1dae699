"""The search: trials from coarse to fine until the estimated error meets the target."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError, UnsuitedSettings
from tireroad.runs.files.cache import NO_CACHE, Cache
from tireroad.runs.files.checksum import signed
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.present import CHOSEN
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.plan import STAGES
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.search import kept
from tireroad.runs.search.journal import Journal, Trial
from tireroad.runs.search.planning import planned
from tireroad.runs.search.settings import MARGIN, MARGINAL, Ladders, Settings, aim, applied
from tireroad.runs.search.shares import CAUSES, Found, shown, worst
from tireroad.runs.stages.pipeline import Finished, run_scene


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
        observe.say(f"search    for {aim(self.scene.accuracy)}, {MARGINAL}")
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
            observe.say(
                f"  {why}; the target is met without the margin of {MARGIN:g} for estimates too small"
            )
            self._keep(best)
        else:
            self._give_up(tried, best, why)

    @cached_property
    def _ladders(self) -> Ladders:
        return Ladders.of(self.scene)

    @cached_property
    def _journal(self) -> Journal:
        """The trials so far. Root process only."""
        return Journal(self.directory, self.scene)

    @property
    def _cache(self) -> Cache:
        """The cache of the trials' stages."""
        return self.cache.of_family(self.directory / kept.FOLDER / "cache")

    def _begin(self) -> None:
        """Keep the scene as given, until settings are found. Root process only."""
        kept.begin(self.directory, dumps(self.scene))
        _ = self._journal

    def _next(self, last: Trial) -> Settings | None:
        return planned(self._ladders, last, self.comm.size)

    def _trial(self, settings: Settings, number: int) -> Trial:
        """Run a trial, or take it from an earlier search; reports its result. Collective."""
        before = on_root(self.comm, lambda: self._journal.known(settings))
        observe.say(f"  trial {number}: {settings}{' (from before)' if before else ''}")
        trial = before or self._tried(settings)
        if not before:
            on_root(self.comm, lambda: self._journal.add(trial))
        observe.say(f"    {self._line(trial)}")
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
        folder = self.directory / kept.FOLDER / "trial"
        on_root(self.comm, lambda: folder.mkdir(parents=True, exist_ok=True))
        try:
            with observe.only_log():
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
            observe.say("    not finished; the trials before it are kept: run again, or resume")
            raise
        cost = on_root(self.comm, lambda: seconds(folder))
        spent = self.comm.bcast(time.perf_counter() - began)
        return Trial(settings, cost, spent, Found.of(product, self.scene.accuracy), scheme)

    def _over(self, trial: Trial) -> float:
        """The estimated error over the target; infinite for a failed trial."""
        return worst(trial.found.over(self.scene.accuracy))[0] if trial.found else float("inf")

    def _limit(self, tried: list[Trial]) -> str:
        """The limit of the search that is reached; "" if none."""
        wanted = self.scene.accuracy
        spent = sum(trial.spent for trial in tried)
        if len(tried) >= wanted.trials:
            return f"accuracy.trials = {wanted.trials} are done"
        if wanted.budget is not None and spent >= wanted.budget:
            return f"accuracy.budget = {wanted.budget:g} s is spent ({spent:.0f} s)"
        return ""

    def _keep(self, trial: Trial) -> None:
        """Complete the run with a trial's settings from its stages; write its scene. Collective."""
        chosen = applied(self.scene, trial.settings)
        on_root(self.comm, lambda: write_text(self.directory / CHOSEN, signed(dumps(chosen))))
        observe.say(f"  chosen: {trial.settings}; {self.directory / CHOSEN} needs no search")
        _tell(chosen, self._final(chosen))
        on_root(self.comm, lambda: kept.forget(self.directory))

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
        wanted = self.scene.accuracy
        if best.found is None:
            raise ConvergenceError(
                f"accuracy: no trial finished ({why}); the last: {tried[-1].failed}"
            )
        over = best.found.over(wanted)
        largest = CAUSES[int(over[:, worst(over)[1]].argmax())]
        self._final(applied(self.scene, best.settings))
        raise ConvergenceError(
            f"accuracy: the target is not met: {why}. Reached {shown(over, wanted)} with {best.settings}; largest part: "
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


def run(
    scene: Scene,
    directory: Path,
    comm: MPI.Comm,
    *,
    until: str | None,
    fresh: bool,
    petsc_options: list[str],
    cache: Cache = NO_CACHE,
) -> None:
    """A run as the user starts it, with a search if the scene has a target and `until` allows.

    `fresh`: reuse nothing of earlier runs and trials. Collective.
    """
    if not scene.accuracy.searches or (until and STAGES.index(until) < STAGES.index("accuracy")):
        on_root(comm, lambda: kept.leave(directory))
        done = run_scene(
            scene,
            directory,
            comm,
            until=until,
            fresh=fresh,
            petsc_options=petsc_options,
            cache=cache,
        )
        _tell(scene, done)
        return
    if fresh:
        on_root(comm, lambda: _forget(directory))
    Search(scene, directory, comm, petsc_options, cache).run()


def _tell(scene: Scene, done: Finished) -> None:
    """Report whether the target error is met, if it was estimated. Collective."""
    if not scene.accuracy.aimed or "accuracy" not in done.done:
        return
    over = Found.of(done.done["accuracy"].product, scene.accuracy).over(scene.accuracy)
    text = f"estimated error of the {scene.accuracy.of.replace('_', ' ')}: {shown(over, scene.accuracy)}"
    if worst(over)[0] <= 1:
        observe.say(f"{text}, within the target")
    else:
        observe.warn(
            f"{text}, more than the target: accuracy.search = true looks for better settings"
        )


def _forget(directory: Path) -> None:
    """Remove the trials and their stages. Root process only."""
    kept.forget(directory)
    Journal.forget(directory)
