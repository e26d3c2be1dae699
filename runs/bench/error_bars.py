"""Estimated over true error of the figures of rolling: what the error bars of a run are worth."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import h5py
import numpy as np
from mpi4py import MPI

from tireroad.contact.error_bars import told
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe

ABOUT = "estimated over true error of mean, deviation and third octaves: 3 tires, 4 roads, 2 speeds"
TIRES = {
    "soft": "",
    "thick": "thickness = 0.016\n",
    "belted": "",
}
BELTS = """
[[tire.cords]]
name = "belt"
depth = 0.006
arc = [-30.0, 30.0]
angle = 0.0
youngs_modulus = 2e9
"""
ROADS = {
    "sine": 'kind = "sine"\namplitude = 2e-4\nwavelength = 0.15',
    "cleat": 'kind = "cleat"\nheight = 0.003\nlength = 0.02\nposition = 0.3',
    "texture": 'kind = "texture"\nrms = 2e-4\nroll_off = 0.2\ncut_off = 0.03',
    "cobblestones": 'kind = "cobblestones"\njoint_depth = 0.003\nheight_scatter = 0.0002',
}
SPEEDS = (30.0, 60.0)  # rad/s
DURATION = 0.16  # s
REACH = (
    0.012  # m, of the patch: the same on every road, so that what comes before the loop is shared
)
SCENE = """
name = "bars"
[tire]
segments = {segments}
elements_arc = {arc}
order = {order}
footprint_size = 0.25
{tire}[tire.material]
youngs_modulus = 48e6
{cords}
[static]
load = 500.0
error_estimate = false
[damping]
mass = 300.0
[rotation]
speed = {speed}
[modal]
count = {modes}
[contact]
points = {{ dx = {pitch}, dy = {pitch} }}
youngs_modulus = 1e7
reach = {reach}
[road]
{road}
[time]
duration = {duration}
step = {step}
[accuracy]
estimate = {estimate}
"""
RUN = {"segments": 24, "arc": 10, "order": 3, "modes": 120, "pitch": 0.008, "step": 2e-4}
FINE = {"segments": 44, "arc": 18, "order": 3, "modes": 300, "pitch": 0.004, "step": 5e-5}
RANGE, ASKED = (0.5, 2.0), 80.0  # effectivity; % of the cases in it
SMALL = {
    "mean": 1e-4,
    "deviation": 1e-3,
    "level": 0.02,
}  # of the load, of the deviation, dB: below, no error


@dataclass(frozen=True)
class Effectivity:
    """A figure of a case with its true and its estimated error (N or dB)."""

    case: str
    force: str
    figure: str
    true: float
    estimated: float
    small: float

    @property
    def good(self) -> bool:
        """Within `RANGE`, or both too small to matter."""
        if max(self.true, self.estimated) <= self.small:
            return True
        return RANGE[0] * self.true <= self.estimated <= RANGE[1] * self.true


def run() -> list[Table]:
    """All cases. Collective."""
    with tempfile.TemporaryDirectory() as folder:
        return tables(Path(folder), tuple(product(TIRES, ROADS, SPEEDS)), RUN, FINE, DURATION)


def tables(folder: Path, cases, coarse: dict, fine: dict, duration: float) -> list[Table]:
    """Of the `cases` (tire, road, speed); settings of the run and of the far finer one. Collective."""
    found: list[Effectivity] = []
    for tire, road, speed in sorted(cases, key=lambda case: (case[0], case[2])):
        name = f"{tire}, {road}, {speed:g} rad/s"
        observe.say(f"  {name} ...")
        where = folder / f"{tire}-{speed:g}"
        own = _run(where / "run", tire, road, speed, coarse, duration, True)
        exact = _run(where / "fine", tire, road, speed, fine, duration, False)
        found += _compared(name, own, exact)
    return [_shares(found), _every(found)]


def _run(folder: Path, tire: str, road: str, speed: float, keys: dict, duration: float, bars: bool):
    """Forces (n, 3) N by name, the step, the limit, and the bars, of one run. Collective."""
    from tireroad.runs.scene.load import load
    from tireroad.runs.stages.pipeline import run_scene

    folder.mkdir(parents=True, exist_ok=True)
    given = keys | {"speed": speed, "reach": REACH, "duration": duration}
    parts = {
        "tire": TIRES[tire],
        "cords": BELTS if tire == "belted" else "",
        "road": ROADS[road],
        "estimate": str(bars).lower(),
    }
    (folder / "given.toml").write_text(SCENE.format(**given, **parts))
    scene = load(folder / "given.toml", [])
    with observe.quiet():
        done = run_scene(
            scene, folder, MPI.COMM_WORLD, until="spectra", fresh=False, petsc_options=[]
        )
    with h5py.File(folder / "contact.h5") as file:
        forces = {name: file[name][:] for name in ("total_force", "axle_force")}
    return forces, keys["step"], done.done["spectra"].product, done.done.get("accuracy")


def _compared(name: str, own, exact) -> Iterator[Effectivity]:
    """Every figure of both forces, vertical, after the run-in."""
    forces, step, spectra, accuracy = own
    true_forces, fine_step, _, _ = exact
    for force, key in (("contact_force", "total_force"), ("axle_force", "axle_force")):
        bar = accuracy.product.total(force)
        if bar is None:
            continue
        start = spectra.left_out
        one = told(forces[key][round(start / step) :], step, spectra.limit.frequency)
        other = told(
            true_forces[key][round(start / fine_step) :], fine_step, spectra.limit.frequency
        )
        load = abs(one.mean[2])
        yield Effectivity(
            name, force, "mean", abs(one.mean[2] - other.mean[2]), bar.mean[2], SMALL["mean"] * load
        )
        yield Effectivity(
            name,
            force,
            "deviation",
            abs(one.deviation[2] - other.deviation[2]),
            bar.deviation[2],
            SMALL["deviation"] * one.deviation[2],
        )
        level = accuracy.product.levels(force, one.centre)[:, 2]
        for k in np.flatnonzero(np.isfinite(level)):
            same = np.flatnonzero(np.isclose(other.centre, one.centre[k]))
            if len(same):
                true = abs(one.level[k, 2] - other.level[same[0], 2])
                figure = f"{one.centre[k]:.4g} Hz"
                yield Effectivity(name, force, figure, true, level[k], SMALL["level"])


def _shares(found: list[Effectivity]) -> Table:
    kinds: dict[str, list[Effectivity]] = {"mean": [], "deviation": [], "third octaves": []}
    for one in found:
        kinds.get(one.figure, kinds["third octaves"]).append(one)
    rows = []
    for kind, some in (*kinds.items(), ("all", found)):
        if not some:
            continue
        ratio = [one.estimated / one.true for one in some if one.true > one.small]
        middle = float(np.median(ratio)) if ratio else float("nan")
        good = 100 * float(np.mean([one.good for one in some]))
        rows.append([kind, len(some), good, middle])
    return Table(
        "Error bars: estimated over true error",
        [
            ("figure", ""),
            ("cases", "-"),
            (f"within {RANGE[0]:g} to {RANGE[1]:g}", "%"),
            ("median", "-"),
        ],
        rows,
        [
            f"Asked: {ASKED:g} % of the cases. True: against {FINE['segments']} x {FINE['arc']} elements of order "
            f"{FINE['order']}, {FINE['modes']} modes, points {1e3 * FINE['pitch']:g} mm apart, steps of "
            f"{1e3 * FINE['step']:g} ms. Where both are below {SMALL['mean']:g} of the load, {SMALL['deviation']:g} "
            f"of the deviation or {SMALL['level']:g} dB a case counts as good.",
        ],
    )


def _every(found: list[Effectivity]) -> Table:
    rows = [
        [
            one.case,
            one.force.replace("_", " "),
            one.figure,
            float(one.true),
            float(one.estimated),
            one.good,
        ]
        for one in found
    ]
    columns = [
        ("case", ""),
        ("force", ""),
        ("figure", ""),
        ("true", "N or dB"),
        ("estimated", "N or dB"),
        ("good", ""),
    ]
    return Table("Every figure", columns, rows)
