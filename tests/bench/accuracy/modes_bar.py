"""Estimated over true error by truncated modes, of all three directions: the companion of fewer modes beside twice as many."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tireroad.contact.results.error_bars import bars
from tireroad.runs.files.cache import Cache
from tireroad.runs.stages.accuracy import ReferenceRun, companions, figures, model_limit
from tireroad.runs.stages.rolling import ContactForces, first_step, recursive
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.effectivity import JUDGED, SMALL, Effectivity, by_kind
from tireroad.tests.bench.parts.rolling_cases import Case, Driven, driven, sets

ABOUT = "estimated over true error by truncated modes: 2 tires, 2 residuals, 4 roads, friction"
DURATION, UP_TO = 0.16, 300.0  # s, Hz
MODES = 100
TIRES: dict[str, dict[str, Any]] = {
    "soft": {"segments": 18, "arc": 8, "order": 3, "pitch": 0.008},
    "radial": {"segments": 16, "arc": 10, "order": 2, "pitch": 0.010},
}
WHEELS = (
    ("soft", "attachment", 30.0),
    ("soft", "static", 30.0),
    ("radial", "attachment", 60.0),
    ("radial", "static", 60.0),
    ("radial", "attachment", 30.0),
)
ROADS = ("texture", "cobblestones", "cleat", "sine")


def run(wheels: Iterable[tuple[str, str, float]] = WHEELS) -> list[Table]:
    """Run all wheels on all roads. On one process."""
    tables = []
    with tempfile.TemporaryDirectory() as folder:
        for wheel in wheels:
            found = [one for road in ROADS for one in judged(Path(folder), *wheel, road)]
            tables.append(_table(f"{wheel[0]} tire, {wheel[1]}, {wheel[2]:g} rad/s", found))
    return tables


def judged(
    folder: Path, tire: str, residual: str, speed: float, road: str
) -> Iterator[Effectivity]:
    """The figures of a wheel on a road in x, y and z."""
    cache, case = Cache(folder / "cache"), Case(tire, road, speed)

    def rolled(name: str, modes: int) -> Driven:
        keys = sets(step=2e-4, modes=modes, residual=residual, **TIRES[tire])
        scene = case.scene(folder, DURATION, *keys, "accuracy.estimate=false")
        return driven(scene, folder / name, "contact", cache)

    own, fine = rolled("run", MODES), rolled("fine", 2 * MODES)
    given, since, limit = _given(own)
    (companion,) = companions("modes", given)
    runs = [
        ContactForces(one.forces["total_force"], one.forces["axle_force"], one.step)
        for one in (own, fine)
    ]
    one, other = (figures(forces, since, limit, UP_TO) for forces in runs)
    estimated = companion.bars(runs[0], since, limit, UP_TO)
    load = float(given.static.product.normal_force.sum())
    for force, measured in one.items():
        true, bar = bars(measured, other[force], 1.0), estimated[force]
        for axis, direction in enumerate("xyz"):
            where = {"case": str(case), "force": f"{force} {direction}", "cause": "modes"}
            varies = measured.deviation[axis]
            for name, least in (("mean", load), ("deviation", varies), ("history", 0.01)):
                far, told = (float(getattr(one, name)[axis]) for one in (true, bar))
                yield _figure(where, name, far, told, SMALL[name] * least)
            for k, centre in enumerate(measured.centre):
                far, told = (float(one.level[k, axis]) for one in (true, bar))
                yield _figure(where, f"{centre:.4g} Hz", far, told, SMALL["level"])


def _figure(
    where: dict[str, str], name: str, true: float, estimated: float, small: float
) -> Effectivity:
    return Effectivity(**where, figure=name, true=true, estimated=estimated, small=small)


def _given(own: Driven) -> tuple[ReferenceRun, float, float]:
    """What the companion repeats, the time (s) from which runs are compared, and the limit (Hz)."""
    done = own.done
    history = done.done["contact"].product
    given = ReferenceRun(
        job=done.job,
        static=done.done["static"],
        setup=done.setup,
        response=done.greens.contact,
        rolling=done.rolling,
        step=history.step,
        steps=len(history.time) // 2 * 2,
        scheme=recursive(history.scheme),
        attached=done.greens.attached,
        comm=MPI.COMM_SELF,
    )
    start = first_step(done.setup, done.job.scene.road, history.time)
    limit = model_limit(done.setup, done.rolling, history.step).frequency
    return given, (start + start % 2) * history.step, limit


def _table(title: str, found: list[Effectivity]) -> Table:
    told = f"{MODES} modes against {2 * MODES}; contact and axle force on {', '.join(ROADS)}, friction 1."
    return Table(title, [("force", ""), ("figure", ""), *JUDGED], by_kind(found), [told])
