"""What makes the forces of a rolling tire converge: mesh, points, modes, step and residual, one by one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tireroad.contact.results.error_bars import measured
from tireroad.contact.results.spectra import distance
from tireroad.runs.bench.accuracy.rough_road import Mesh, Rolled, rolled
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe

ABOUT = "contact and axle force over mesh, points, modes, step and residual, on three roads"
ROADS = {
    "smooth": ("road.kind=sine", "road.amplitude=2e-4", "road.wavelength=0.15"),
    "cleat": ("road.kind=cleat", "road.height=0.004", "road.length=0.02", "road.position=0.35"),
    "rough": (),
}
SPEED, DURATION = 50.0, 0.16  # rad/s, s
BANDS = (20.0, 1000.0)  # Hz
FINEST = {"segments": 36, "arc": 14, "order": 3, "footprint": 0.2}
BASE = {"modes": 300, "residual": "static", "pitch": 0.004, "step": 5e-5}
"""The converged run, from which one thing at a time is made coarser."""
COARSER: dict[str, tuple[dict, ...]] = {
    "mesh": (
        {"segments": 18, "arc": 7, "order": 3},
        {"segments": 24, "arc": 10, "order": 3},
        {"segments": 30, "arc": 14, "order": 3},
        {"segments": 36, "arc": 12, "order": 2, "footprint": 0.25},
        {"segments": 50, "arc": 16, "order": 2, "footprint": 0.25},
    ),
    "points": ({"pitch": 0.008}, {"pitch": 0.006}),
    "modes": ({"modes": 75}, {"modes": 150}, {"modes": 212}),
    "step": ({"step": 4e-4}, {"step": 2e-4}, {"step": 1e-4}),
    "residual": ({"residual": "none"}, {"residual": "second-order"}, {"residual": "attachment"}),
}


@dataclass(frozen=True)
class Apart:
    """How far a run is from the converged one: relative L2 of the `history` up to the band's end, of `mean` and
    `deviation`, %; the largest difference of a third octave, dB, and where, Hz."""

    history: float
    mean: float
    deviation: float
    level: float
    at: float


def apart(exact: Rolled, found: Rolled, force: str, duration: float) -> Apart:
    """The vertical part of a force in two runs over the same road; bands up to half the lower highest mode."""
    steps = [run.figure("contact", "step") for run in (exact, found)]
    top = 0.5 * min(run.figure("modes", "highest") for run in (exact, found))
    values = [run.forces[force][:, 2:] for run in (exact, found)]
    one, other = (measured(v, step, top) for v, step in zip(values, steps, strict=True))
    same = [k for k, centre in enumerate(one.centre) if np.isclose(other.centre, centre).any()]
    same = [k for k in same if BANDS[0] <= one.centre[k] <= BANDS[1]]
    off = [
        abs(one.level[k, 0] - other.level[np.isclose(other.centre, one.centre[k]).argmax(), 0])
        for k in same
    ]
    worst = int(np.argmax(off)) if off else 0
    return Apart(
        100 * distance(values[0], values[1], duration, top).mean,
        100 * abs(float(other.mean[0] / one.mean[0]) - 1),
        100 * abs(float(other.deviation[0] / one.deviation[0]) - 1),
        float(off[worst]) if off else float("nan"),
        float(one.centre[same[worst]]) if off else float("nan"),
    )


def run() -> list[Table]:
    """A table a road: what one step coarser costs in accuracy. Collective."""
    with tempfile.TemporaryDirectory() as folder:
        return [table(Path(folder), road, FINEST, BASE, COARSER) for road in ROADS]


def table(folder: Path, road: str, finest: dict, base: dict, coarser: dict) -> Table:
    """Of one road; `finest` mesh and `base` keys of the converged run, `coarser` by what is changed."""
    observe.say(f"  {road}: the converged run ...")
    exact = _rolled(folder, road, finest, base, {})
    rows = []
    for what, changed in _changes(coarser):
        observe.say(f"  {road}: {what} {_named(changed)}")
        found = _rolled(folder, road, finest, base, changed)
        for force in ("total_force", "axle_force"):
            off = apart(exact, found, force, DURATION)
            name = "contact" if force == "total_force" else "axle"
            rows.append([what, _named(changed), name, *vars(off).values()])
    return Table(
        f"Convergence of rolling on a {road} road",
        [
            ("what", ""),
            ("value", ""),
            ("force", ""),
            ("history", "%"),
            ("mean", "%"),
            ("deviation", "%"),
            ("largest of the third octaves", "dB"),
            ("at", "Hz"),
        ],
        rows,
        [
            f"Soft torus at {SPEED:g} rad/s under 500 N, {DURATION:g} s. Against {_named(finest | base)}. Third "
            f"octaves between {BANDS[0]:g} and {BANDS[1]:g} Hz, below half the highest mode of both.",
        ],
    )


def _changes(coarser: dict) -> Iterator[tuple[str, dict]]:
    for what, choices in coarser.items():
        for changed in choices:
            yield what, changed


def _named(keys: dict) -> str:
    return ", ".join(
        f"{key} {value:g}" if not isinstance(value, str) else value for key, value in keys.items()
    )


def _rolled(folder: Path, road: str, finest: dict, base: dict, changed: dict) -> Rolled:
    """A run with keys changed, in a folder of its mesh, so that what stays is reused. Collective."""
    mesh = finest | {key: value for key, value in changed.items() if key in finest}
    keys = base | {key: value for key, value in changed.items() if key in base}
    name = "-".join(f"{value:g}" for value in mesh.values())
    sets = (f"tire.order={mesh['order']}", "static.error_estimate=false", *ROADS[road])
    given = Mesh(mesh["segments"], mesh["arc"], mesh["footprint"])
    return rolled(folder / name, given, *sets, speed=SPEED, duration=DURATION, **keys)
