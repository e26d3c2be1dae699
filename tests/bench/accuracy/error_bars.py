"""Estimated over true error of rolling figures: the quality of a run's error bars."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from tireroad.contact.results.error_bars import Bars, bars, measured
from tireroad.runs.files.cache import Cache
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.effectivity import (
    ALL,
    FORCES,
    SMALL,
    SOUND,
    Effectivity,
    by_cause,
    every,
    shares,
)
from tireroad.tests.bench.parts.kept import Records, every_case
from tireroad.tests.bench.parts.rolling_cases import (
    CASES,
    DURATION,
    FINE,
    RADIAL,
    TIRES,
    Case,
    Driven,
    Recorded,
    by_wheel,
    chosen,
    driven,
    recorded,
    sets,
    told_settings,
)

ABOUT = "estimated over true error of mean, deviation, history and third octaves: 3 tires, 4 roads, 2 or 3 speeds"
RUN = {"segments": 18, "arc": 8, "order": 3, "modes": 100, "pitch": 0.008, "step": 2e-4}


def run(kept: Path | None = None, only: Sequence[str] = ()) -> list[Table]:
    """Run all cases, or those that `only` names, except those whose results are in the folder `kept`. On one process."""
    cases = chosen(dict.fromkeys((*CASES, *RADIAL)), only)
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        return tables(where, cases, RUN, FINE, DURATION, kept or where / "kept")


def tables(
    folder: Path, cases: Iterable[Case], coarse: dict, fine: dict, duration: float, kept: Path
) -> list[Table]:
    """Tables of the `cases`, with settings of the run and of the much finer one. On one process."""

    def settings(case: Case) -> tuple:
        tire = TIRES[case.tire]
        return {**coarse, **tire.run}, {**fine, **tire.fine}, duration

    records, failed = every_case(by_wheel(cases), folder, kept, judged, settings, _told)
    found = [Effectivity(**one) for some in records.values() for one in some]
    note = f"{told_settings(coarse, 'run')}; true: against {told_settings(fine, 'fine')}."
    return [shares(found, note, failed), by_cause(found), every(found)]


def judged(
    case: Case, folder: Path, kept: Path, coarse: dict, fine: dict, duration: float
) -> Records:
    """The figures of a case (Effectivity), estimated and against finer runs. On one process."""
    where = _Where(folder, kept, case, duration, coarse, fine)
    return [asdict(one) for one in _judged(where)]


def _told(records: Records) -> str:
    """The message about a completed case."""
    good = [one.good for one in (Effectivity(**record) for record in records) if one.cause == ALL]
    return f"{sum(good)} of {len(good)} figures good"


@dataclass(frozen=True)
class _Where:
    """A case, its settings, and the folders of its runs and their forces."""

    folder: Path
    kept: Path
    case: Case
    duration: float
    coarse: dict
    fine: dict

    def own(self) -> Driven:
        """The run with its error bars."""
        keys, heard = sets(**self.coarse), self.case.radial
        scene = self.case.scene(self.folder, self.duration, *keys, heard=heard)
        return driven(scene, self.folder / "run", "sound" if heard else "spectra", self._cache)

    def finer(self, *names: str, heard: bool = False) -> Recorded:
        """The run with some settings as fine as the reference's, `heard` by microphones or not."""
        keys = self.coarse | {name: self.fine[name] for name in names if name in self.fine}
        scene = self.case.scene(self.folder, self.duration, *sets(**keys), heard=heard)
        folder = self.folder / "-".join(("fine", *names))
        return recorded(scene, folder, self.kept / "forces", self._cache)

    @property
    def _cache(self) -> Cache:
        """The cache of stages shared by roads, settings and residuals."""
        return Cache(self.folder.parent / "cache")


_MESH = ("segments", "arc", "order", "footprint", "modes")


def _judged(where: _Where) -> Iterator[Effectivity]:
    """Effectivities of all causes together, and of each from two runs that differ only in it."""
    own = where.own()
    more = where.finer("modes")
    exact = where.finer(*_MESH, "pitch", "step", "residual", heard=where.case.radial)
    if exact.heard:
        yield from _heard(str(where.case), own, exact)
    pairs: dict[str, tuple[Recorded, Recorded]] = {
        ALL: (own, exact),
        "step": (own, where.finer("step")),
        "points": (own, where.finer("pitch")),
        "modes": (own, more),
        "mesh": (more, where.finer(*_MESH)),
    }
    accuracy = own.done.done["accuracy"].product
    for force in FORCES:
        causes = accuracy.by_cause.get(force, {})
        for cause, pair in pairs.items():
            bar = accuracy.total(force) if cause == ALL else causes.get(cause)
            if bar is not None:
                yield from _compared(str(where.case), force, cause, own, pair, bar)


def _compared(
    case: str, force: str, cause: str, own: Driven, pair: tuple[Recorded, Recorded], bar: Bars
) -> Iterator[Effectivity]:
    """Every figure of a force in x, y and z, after the run-in."""
    spectra, accuracy = (own.done.done[stage].product for stage in ("spectra", "accuracy"))
    one, other = (
        measured(
            run.forces[FORCES[force]][round(spectra.left_out / run.step) :],
            run.step,
            spectra.limit.frequency,
            accuracy.up_to,
            accuracy.centre,
        )
        for run in pair
    )
    true, load = bars(one, other, 1.0), abs(one.mean[2])
    for axis, direction in enumerate("xyz"):
        small = SMALL["deviation"] * one.deviation[axis]
        figures = [
            ("mean", true.mean[axis], bar.mean[axis], SMALL["mean"] * load),
            ("deviation", true.deviation[axis], bar.deviation[axis], small),
            ("history", 100 * true.history[axis], 100 * bar.history[axis], SMALL["history"]),
        ]
        for k, centre in enumerate(accuracy.centre):
            far, level = true.level[k, axis], bar.level[k, axis]
            if np.isfinite([one.level[k, axis], far, level]).all():
                figures.append((f"{centre:.4g} Hz", far, level, SMALL["level"]))
        for figure, *numbers in figures:
            yield Effectivity(case, f"{force} {direction}", cause, figure, *map(float, numbers))


def _heard(case: str, own: Driven, exact: Recorded) -> Iterator[Effectivity]:
    """Every third octave of known error at each microphone, all causes together."""
    sound = own.done.done["sound"].product
    for name, level, error in zip(sound.names, sound.level, sound.error, strict=True):
        middle, truth = exact.heard[name]
        for centre, value, bar in zip(sound.centre, level, error, strict=True):
            far = np.abs(truth[np.isclose(middle, centre)] - value)
            if far.size and np.isfinite([far[0], bar]).all():
                figure = f"{centre:.4g} Hz", float(far[0]), float(bar), SMALL["level"]
                yield Effectivity(case, f"{SOUND} {name}", ALL, *figure)
