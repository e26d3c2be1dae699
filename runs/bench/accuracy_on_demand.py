"""Accuracy on demand: is the target met, and at what cost beside the best settings that there are."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tireroad.contact.error_bars import Told, bars, told
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.timing import by_processor
from tireroad.runs.bench.parts.rolling_cases import CASES, Case, Driven, driven
from tireroad.runs.files.cache import Cache
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe
from tireroad.runs.search.journal import Journal, Trial
from tireroad.runs.search.search import Search, seconds
from tireroad.runs.search.settings import Ladders, Settings, applied
from tireroad.runs.search.shares import worst

ABOUT = "a search for settings beside an exhaustive one: 3 tires, 4 roads, 2 speeds"
TARGET, UP_TO, DURATION = 0.15, 100.0, 0.12  # -, Hz, s
WANTED = (f"accuracy.target={TARGET}", f"accuracy.up_to={UP_TO}")
# Rungs of the exhaustive search, and those of the reference.
GRID = {"mesh": (0, 1, 2), "modes": (0, 2), "points": (0, 2, 3), "step": (0, 1, 2)}
REFERENCE = {"mesh": 3, "modes": 3, "points": 5, "step": 3}
# On what a stage's cost depends: what differs in none of it is computed once in a search.
DEPENDS = {
    "static": ("mesh",),
    "modes": ("mesh", "modes"),
    "rotating": ("mesh", "modes"),
    "greens": ("mesh", "modes", "points"),
}
ASKED = {"met": 90.0, "cost": 2.0, "search": 3.0}  # % of the cases; times the least cost


@dataclass(frozen=True)
class Outcome:
    """Of a case: whether the search ended within its target by its own `estimated` error, the `true` one of
    what it chose; seconds of a run with that, of the `best` of the exhaustive search (None: nothing met the
    target) and of the whole `search`; `sure`: the estimated error of the reference itself."""

    case: str
    ended: bool
    estimated: float
    true: float
    cost: float
    best: float | None
    search: float
    sure: float

    @property
    def met(self) -> bool:
        """Whether the true error is as asked for."""
        return self.ended and self.true <= TARGET


def run() -> list[Table]:
    """All cases. Collective."""
    with tempfile.TemporaryDirectory() as folder:
        return tables(Path(folder), CASES, GRID, REFERENCE)


def tables(folder: Path, cases: Iterable[Case], grid: Mapping, reference: Mapping) -> list[Table]:
    """Of the cases, with the rungs of the exhaustive search and of the reference. Collective."""
    found = []
    for case in cases:
        observe.say(f"  {case} ...")
        with by_processor():
            found.append(_outcome(folder / case.wheel, case, grid, reference))
        observe.say(f"    {found[-1]}")
    return [_summary(found, reference), _every(found)]


def _outcome(folder: Path, case: Case, grid: Mapping, reference: Mapping) -> Outcome:
    """Reference, search and exhaustive search of a case. Collective."""
    scene = case.scene(folder, DURATION, *WANTED)
    ladders = Ladders.of(scene)
    exact, sure = _reference(folder, ladders, reference)
    ended, trials = _searched(folder / case.road, scene)
    last = min(trials, key=lambda trial: worst(trial.found.over(scene.accuracy))[0])
    chosen = _driven(folder, ladders, last.settings)
    best = None
    for rungs in product(*grid.values()):
        settings = ladders.at(dict(zip(grid, rungs, strict=True)))
        tried = _driven(folder, ladders, settings)
        cost = _cost(seconds(folder / "grid"))
        if _true(exact, tried) <= TARGET and cost < (best or np.inf):
            best = cost
    estimated = TARGET * worst(last.found.over(scene.accuracy))[0]
    true, cost = _true(exact, chosen), _cost(last.seconds)
    return Outcome(str(case), ended, estimated, true, cost, best, _spent(trials), sure)


def _searched(folder: Path, scene) -> tuple[bool, list[Trial]]:
    """Whether a search met its target, and its trials that came to an end. Collective."""
    folder.mkdir(parents=True, exist_ok=True)
    ended = True
    try:
        with observe.quiet():
            Search(scene, folder, MPI.COMM_WORLD, [], _cache(folder.parent)).run()
    except ConvergenceError:
        ended = False
    return ended, [trial for trial in Journal(folder, scene).trials if trial.found is not None]


def _reference(folder: Path, ladders: Ladders, rungs: Mapping) -> tuple[Driven, float]:
    """The reference, and its own error as its companions estimate it. Collective."""
    settings = ladders.at(dict(rungs))
    scene = applied(ladders.scene, settings)
    run = driven(scene, folder / "reference", "accuracy", _cache(folder))
    bar = run.done.done["accuracy"].product.total(scene.accuracy.of)
    return run, float(bar.history[2])


def _driven(folder: Path, ladders: Ladders, settings: Settings) -> Driven:
    """A run with settings, from stages that those of the same wheel share. Collective."""
    scene = applied(ladders.scene, settings)
    return driven(scene, folder / "grid", "contact", _cache(folder))


def _cache(folder: Path) -> Cache:
    """Of all that a wheel's roads share, in the wheel's folder."""
    return Cache(folder / "cache")


def _cost(spent: Mapping[str, float]) -> float:
    """Seconds of a run up to its forces."""
    return sum(value for stage, value in spent.items() if stage != "accuracy")


def _spent(trials: list[Trial]) -> float:
    """Seconds of all trials, their error bars too, each stage once where its inputs are the same."""
    once = {}
    for trial in trials:
        for stage, value in trial.seconds.items():
            rungs = trial.settings.rungs
            once[stage, *(rungs[cause] for cause in DEPENDS.get(stage, rungs))] = value
    return sum(once.values())


def _true(exact: Driven, run: Driven) -> float:
    """The error that is asked for: of the history and of the mean, relative, the larger one."""
    one, other = _told(exact), _told(run)
    far = bars(one, other, 1.0)
    return float(max(far.history[2], far.mean[2] / abs(one.mean[2])))


def _told(run: Driven) -> Told:
    """Of the axle force after the first quarter, in which all roads have begun."""
    force = run.forces["axle_force"]
    return told(force[len(force) // 4 :], run.step, UP_TO, UP_TO)


def _summary(found: list[Outcome], reference: Mapping) -> Table:
    solved = [one for one in found if one.best is not None]
    ratio = [one.cost / one.best for one in solved if one.best]
    whole = [one.search / one.best for one in solved if one.best]
    met = 100 * float(np.mean([one.met for one in found]))
    rows = (
        [
            ["target met, of the cases", met, ASKED["met"], "%"],
            ["cost over the least, median", float(np.median(ratio)), ASKED["cost"], "-"],
            ["cost over the least, largest", float(np.max(ratio)), ASKED["cost"], "-"],
            [
                "with the search over the least, median",
                float(np.median(whole)),
                ASKED["search"],
                "-",
            ],
            ["with the search over the least, largest", float(np.max(whole)), ASKED["search"], "-"],
        ]
        if ratio
        else [["target met, of the cases", met, ASKED["met"], "%"]]
    )
    notes = [
        f"{len(found)} cases; {100 * TARGET:g} % of the axle force up to {UP_TO:g} Hz, {DURATION:g} s. True error: against "
        f"rungs {dict(reference)} of the ladders, whose own error is estimated as "
        f"{100 * max(one.sure for one in found):.2g} % at most. The exhaustive search takes rungs of the same "
        "ladders. Costs are processor seconds; without error bars, but for the search."
    ]
    return Table(
        "Accuracy on demand",
        [("what", ""), ("found", ""), ("asked", ""), ("unit", "")],
        rows,
        notes,
    )


def _every(found: list[Outcome]) -> Table:
    rows = [
        [
            one.case,
            100 * one.estimated,
            100 * one.true,
            one.met,
            one.cost,
            one.best if one.best is not None else "none",
            one.search,
            100 * one.sure,
        ]
        for one in found
    ]
    columns = [
        ("case", ""),
        ("estimated error", "%"),
        ("true error", "%"),
        ("met", ""),
        ("cost of the chosen run", "s"),
        ("least cost", "s"),
        ("cost of the search", "s"),
        ("estimated error of the reference", "%"),
    ]
    return Table("Every case", columns, rows)
