"""Estimated over true error of the figures of rolling: what the error bars of a run are worth."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tireroad.contact.error_bars import bars, told
from tireroad.runs.bench.parts.rolling_cases import CASES, Driven, driven, sets
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe

ABOUT = "estimated over true error of mean, deviation and third octaves: 3 tires, 4 roads, 2 speeds"
DURATION = 0.16  # s
RUN = {"segments": 24, "arc": 10, "order": 3, "modes": 120, "pitch": 0.008, "step": 2e-4}
FINE = {"segments": 44, "arc": 18, "order": 3, "modes": 300, "pitch": 0.004, "step": 5e-5}
RANGE, ASKED = (0.5, 2.0), 80.0  # effectivity; % of the cases in it
SMALL = {
    "mean": 1e-4,
    "deviation": 1e-3,
    "history": 0.1,
    "level": 0.02,
}  # of the load, of the deviation, %, dB: below, no error


@dataclass(frozen=True)
class Effectivity:
    """A figure of a case with its true and its estimated error (N, % or dB)."""

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
        return tables(Path(folder), CASES, RUN, FINE, DURATION)


def tables(folder: Path, cases, coarse: dict, fine: dict, duration: float) -> list[Table]:
    """Of the `cases`; settings of the run and of the far finer one. Collective."""
    found: list[Effectivity] = []
    for case in sorted(cases, key=lambda case: (case.tire, case.speed)):
        observe.say(f"  {case} ...")
        where = folder / case.wheel
        own = driven(case.scene(where, duration, *sets(**coarse)), where / "run", "spectra")
        plain = (*sets(**fine), "accuracy.estimate=false")
        exact = driven(case.scene(where, duration, *plain), where / "fine", "contact")
        found += _compared(str(case), own, exact)
    return [_shares(found), _every(found)]


def _compared(name: str, own: Driven, exact: Driven) -> Iterator[Effectivity]:
    """Every figure of both forces, vertical, after the run-in."""
    spectra, accuracy = (own.done.done[stage].product for stage in ("spectra", "accuracy"))
    for force, key in (("contact_force", "total_force"), ("axle_force", "axle_force")):
        bar = accuracy.total(force)
        if bar is None:
            continue
        one, other = (
            told(
                run.forces[key][round(spectra.left_out / run.step) :],
                run.step,
                spectra.limit.frequency,
                accuracy.up_to,
            )
            for run in (own, exact)
        )
        true, load = bars(one, other, 1.0), abs(one.mean[2])
        figures = [
            ("mean", true.mean[2], bar.mean[2], SMALL["mean"] * load),
            (
                "deviation",
                true.deviation[2],
                bar.deviation[2],
                SMALL["deviation"] * one.deviation[2],
            ),
            ("history", 100 * true.history[2], 100 * bar.history[2], SMALL["history"]),
        ]
        level = accuracy.levels(force, one.centre)[:, 2]
        for k in np.flatnonzero(np.isfinite(level) & np.isfinite(true.level[:, 2])):
            figures.append((f"{one.centre[k]:.4g} Hz", true.level[k, 2], level[k], SMALL["level"]))
        for figure, far, estimated, small in figures:
            yield Effectivity(name, force, figure, float(far), float(estimated), small)


def _shares(found: list[Effectivity]) -> Table:
    kinds: dict[str, list[Effectivity]] = {
        "mean": [],
        "deviation": [],
        "history": [],
        "third octaves": [],
    }
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
            f"of the deviation, {SMALL['history']:g} % of the history or {SMALL['level']:g} dB a case counts as good.",
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
        ("true", "N, % or dB"),
        ("estimated", "N, % or dB"),
        ("good", ""),
    ]
    return Table("Every figure", columns, rows)
