"""True and estimated errors of rolling figures, and tables of the estimates' quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from tireroad.runs.validation.tables import Table

RANGE, ASKED = (0.5, 2.0), 80.0  # effectivity; % of the cases within it
SMALL = {
    "mean": 1e-4,
    "deviation": 1e-3,
    "history": 0.1,
    "level": 0.02,
}  # of the load, of the deviation, %, dB: smaller errors count as none
ALL = "all"  # all causes together
FORCES = {"contact_force": "total_force", "axle_force": "axle_force"}
SOUND = "sound"


@dataclass(frozen=True)
class Effectivity:
    """A figure of a case with true and estimated error (N, % or dB), by one `cause` or all.

    `force`: its name, and its direction x, y or z; or "sound" and the microphone.
    """

    case: str
    force: str
    cause: str
    figure: str
    true: float
    estimated: float
    small: float

    @property
    def kind(self) -> str:
        """Kind of figure; all third octaves are one kind."""
        return self.figure if self.figure in SMALL else "third octaves"

    @property
    def vertical(self) -> bool:
        """Whether it is of a vertical force."""
        return self.force.endswith("z")

    @property
    def good(self) -> bool:
        """Whether the estimate is within `RANGE`, or both errors are negligible."""
        if max(self.true, self.estimated) <= self.small:
            return True
        return RANGE[0] * self.true <= self.estimated <= RANGE[1] * self.true


def judgement(some: Sequence[Effectivity]) -> list[float]:
    """Values under `JUDGED` of some figures."""
    counted = [one for one in some if one.true > one.small]
    ratio = [one.estimated / one.true for one in counted] or [float("nan")]
    good = 100 * float(np.mean([float(one.good) for one in some] or [np.nan]))
    under = 100 * sum(one.estimated < RANGE[0] * one.true for one in counted) / max(len(some), 1)
    return [len(some), good, under, *map(float, np.quantile(ratio, [0.5, 0.1, 0.9]))]


JUDGED = [
    ("figures", "-"),
    (f"within {RANGE[0]:g} to {RANGE[1]:g}", "%"),
    (f"below {RANGE[0]:g}", "%"),
    ("median", "-"),
    ("a tenth below", "-"),
    ("a tenth above", "-"),
]
"""Columns of a judgement: of estimated over true error."""


def by_kind(some: Sequence[Effectivity]) -> list[list]:
    """Rows (force, figure, *judgement): of each force along and across the road, and vertical, of all its figures, and of
    the sound."""
    rows: list[list] = []
    for force in FORCES:
        own = [one for one in some if one.force.startswith(force)]
        name = force.replace("_", " ")
        for vertical in (True, False):
            part = [one for one in own if one.vertical is vertical]
            for kind in dict.fromkeys(one.kind for one in part):
                which = f"{name} {'z' if vertical else 'x, y'}"
                rows.append([which, kind, *judgement([one for one in part if one.kind == kind])])
        if own:
            rows.append([name, "all", *judgement(own)])
    heard = [one for one in some if one.force.startswith(SOUND)]
    if heard:
        rows.append([SOUND, "third octaves", *judgement(heard)])
    return [*rows, ["each", "all", *judgement(some)]]


def shares(found: list[Effectivity], note: str, failed: Sequence[str] = ()) -> Table:
    """All causes together; `note`: what was compared, `failed`: cases left out, with the reason."""
    some = [one for one in found if one.cause == ALL]
    return Table(
        "Error bars: estimated over true error",
        [("force", ""), ("figure", ""), *JUDGED],
        by_kind(some),
        [
            f"{len({one.case for one in found})} cases; target: {ASKED:g} % within. {note} Where both are below {SMALL['mean']:g} of the load, {SMALL['deviation']:g} of the "
            f"deviation, {SMALL['history']:g} % of the history or {SMALL['level']:g} dB a figure counts as good.",
        ],
        failed=list(failed),
    )


def by_cause(found: list[Effectivity]) -> Table:
    """Each cause separately."""
    causes = dict.fromkeys(one.cause for one in found if one.cause != ALL)
    rows = [
        [cause, *row]
        for cause in causes
        for row in by_kind([one for one in found if one.cause == cause])
    ]
    return Table(
        "By cause", [("cause", ""), ("force", ""), ("figure", ""), *JUDGED], rows, [_PAIRS]
    )


_PAIRS = (
    "True: of two runs that differ in the cause alone, the finer as fine in it as the reference; of the mesh both "
    "with the modes of the reference."
)


def every(found: list[Effectivity]) -> Table:
    """Each figure of all causes together, and the history by cause."""
    columns = [
        ("case", ""),
        ("force", ""),
        ("cause", ""),
        ("figure", ""),
        ("true", "N, % or dB"),
        ("estimated", "N, % or dB"),
        ("good", ""),
    ]
    rows = [
        [*list(asdict(one).values())[:-1], one.good]
        for one in found
        if one.cause == ALL or one.figure == "history"
    ]
    return Table("Every figure", columns, rows)
