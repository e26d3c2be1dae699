"""Accuracy on demand: is the target met, and at what cost compared with the best settings?"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.timing import by_processor
from tireroad.runs.files.cache import Cache
from tireroad.runs.files.trials import Settings, Trial, worst
from tireroad.runs.process import console
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.search.journal import SearchJournal
from tireroad.runs.search.search import Search, seconds
from tireroad.runs.search.settings import Ladders, applied
from tireroad.runs.stages.rolling import run_in
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.kept import Records, every_case
from tireroad.tests.bench.parts.rolling_cases import (
    CASES,
    DURATION,
    FINE,
    TIRES,
    Case,
    Driven,
    by_wheel,
    chosen,
    driven,
    recorded,
    sets,
    told_settings,
)
from tireroad.tests.bench.parts.truth import Truth

ABOUT = "a search for settings beside an exhaustive one: 3 tires, 4 roads, 2 speeds"
TARGET, UP_TO = 0.15, 100.0  # -, Hz
WANTED = (f"accuracy.target={TARGET}", f"accuracy.up_to={UP_TO}")
# Rungs of the exhaustive search, none finer than the reference.
GRID = {"mesh": (0, 1, 2), "modes": (0, 2), "points": (0, 1), "step": (0, 1, 2)}
# Causes that a stage's cost depends on: a stage equal in all of them is computed once in a search.
DEPENDS = {
    "static": ("mesh",),
    "modes": ("mesh", "modes"),
    "rotating": ("mesh", "modes"),
    "greens": ("mesh", "modes", "points"),
}
ASKED = {"met": 90.0, "cost": 2.0, "search": 3.0}  # % of the cases; times the least cost


@dataclass(frozen=True)
class Outcome:
    """Result of a case: whether the search ended within its target by its own `estimated` error;
    the `true` error of the chosen settings; seconds of a run with these, of the `best` one of
    the exhaustive search (None: none met the target), and of the whole `search`."""

    case: str
    ended: bool
    estimated: float
    true: float
    cost: float
    best: float | None
    search: float

    @property
    def met(self) -> bool:
        """Whether the true error meets the target."""
        return self.ended and self.true <= TARGET


def run(kept: Path | None = None, only: Sequence[str] = ()) -> list[Table]:
    """Run all cases, or those that `only` names, except those whose results are in the folder `kept`. On one process."""
    cases = chosen(CASES, only)
    with tempfile.TemporaryDirectory() as folder:
        return tables(Path(folder), cases, GRID, kept or Path(folder) / "kept")


def tables(folder: Path, cases: Iterable[Case], grid: Mapping, kept: Path) -> list[Table]:
    """Tables of the cases; `grid`: rungs of the exhaustive search. On one process."""

    def settings(_: Case) -> tuple:
        return TARGET, UP_TO, DURATION, FINE, dict(grid)

    records, failed = every_case(by_wheel(cases), folder, kept, judged, settings, str)
    found = [Outcome(**one) for some in records.values() for one in some]
    return [_summary(found, failed), _every(found)]


def judged(case: Case, folder: Path, kept: Path, *settings) -> Records:
    """The outcome of one case with the settings of this module. On one process."""
    *_, grid = settings
    with by_processor():
        return [asdict(_outcome(folder, case, grid, kept / "forces"))]


def _outcome(folder: Path, case: Case, grid: Mapping, forces: Path) -> Outcome:
    """Reference, search and exhaustive search of one case. On one process."""
    fine = case.scene(folder, DURATION, *sets(**{**FINE, **TIRES[case.tire].fine}))
    exact = recorded(fine, folder / "reference", forces, _cache(folder))
    scene = case.scene(folder, DURATION, *WANTED)
    ladders = Ladders.of(scene)
    ended, trials = _searched(folder / case.road, scene)
    last = min(trials, key=lambda trial: worst(trial.found.over(scene.accuracy))[0])
    chosen = _driven(folder, ladders, last.settings)
    truth = Truth(exact, run_in(chosen.done.setup, scene.road), UP_TO)
    true, best = truth.error(chosen), _cheapest(folder, ladders, grid, truth)
    estimated = TARGET * worst(last.found.over(scene.accuracy))[0]
    return Outcome(str(case), ended, estimated, true, _cost(last.seconds), best, _spent(trials))


def _cheapest(folder: Path, ladders: Ladders, grid: Mapping, truth: Truth) -> float | None:
    """Seconds of the cheapest settings in the grid that meet the target, or None.

    Tried in the order of their estimated cost. Cost grows with every rung, so settings are skipped
    that are nowhere below settings known to cost as much as the best.
    """
    tried: dict[tuple[int, ...], float] = {}
    best: float | None = None

    def at(rungs: tuple[int, ...]) -> Settings:
        found = ladders.at(dict(zip(grid, rungs, strict=True)))
        assert found is not None  # all rungs of the grid exist
        return found

    def work(rungs: tuple[int, ...]) -> float:
        return sum(estimate(applied(ladders.scene, at(rungs))).work.values())

    for rungs in sorted(product(*grid.values()), key=work):
        dear = [one for one, cost in tried.items() if best is not None and cost >= best]
        if any(np.greater_equal(rungs, one).all() for one in dear):
            continue
        run = _driven(folder, ladders, at(rungs))
        tried[rungs] = _cost(seconds(folder / "grid"))
        if truth.error(run) <= TARGET:
            best = min(best or np.inf, tried[rungs])
    return best


def _searched(folder: Path, scene) -> tuple[bool, list[Trial]]:
    """Whether a search met its target, and its successful trials. Collective."""
    folder.mkdir(parents=True, exist_ok=True)
    ended = True
    try:
        with console.quiet():
            Search(scene, folder, MPI.COMM_WORLD, [], _cache(folder.parent)).run()
    except ConvergenceError:
        ended = False
    return ended, [
        trial for trial in SearchJournal(folder, scene).trials if trial.found is not None
    ]


def _driven(folder: Path, ladders: Ladders, settings: Settings) -> Driven:
    """A run with these settings; stages are shared with runs of the same wheel. Collective."""
    scene = applied(ladders.scene, settings)
    return driven(scene, folder / "grid", "contact", _cache(folder))


def _cache(folder: Path) -> Cache:
    """The cache shared by all roads of a wheel, in the wheel's folder."""
    return Cache(folder / "cache")


def _cost(spent: Mapping[str, float]) -> float:
    """Seconds of a run up to its forces."""
    return sum(value for stage, value in spent.items() if stage != "accuracy")


def _spent(trials: list[Trial]) -> float:
    """Seconds of all trials with error bars, counting each stage once per set of inputs."""
    once = {}
    for trial in trials:
        for stage, value in trial.seconds.items():
            rungs = trial.settings.rungs
            once[stage, *(rungs[cause] for cause in DEPENDS.get(stage, rungs))] = value
    return sum(once.values())


def _summary(found: list[Outcome], failed: Sequence[str] = ()) -> Table:
    solved = [one for one in found if one.best is not None]
    ratio = [one.cost / one.best for one in solved if one.best]
    whole = [one.search / one.best for one in solved if one.best]
    met = 100 * float(np.mean([float(one.met) for one in found] or [np.nan]))
    rows = [["target met, of the cases", met, ASKED["met"], "%"]]
    for what, values, asked in (("cost", ratio, "cost"), ("with the search", whole, "search")):
        for kind, figure in (("median", np.median), ("largest", np.max)) if values else ():
            rows.append(
                [f"{what} over the least, {kind}", float(figure(values)), ASKED[asked], "-"]
            )
    notes = [
        f"{len(found)} cases; {100 * TARGET:g} % of the axle force up to {UP_TO:g} Hz, {DURATION:g} s. True error: against "
        f"{told_settings(FINE, 'fine')}. The exhaustive search takes rungs of the same ladders. Costs are processor seconds; "
        "without error bars, but for the search."
    ]
    return Table(
        "Accuracy on demand",
        [("what", ""), ("found", ""), ("target", ""), ("unit", "")],
        rows,
        notes,
        failed=list(failed),
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
    ]
    return Table("Every case", columns, rows)
