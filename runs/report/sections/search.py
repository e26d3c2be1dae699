"""Report section part about the search for settings: error against cost of each trial."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.runs.files.read import Results, Section
from tireroad.runs.report import figures
from tireroad.runs.report.quantities import quantity
from tireroad.runs.scene.tables.accuracy import Accuracy
from tireroad.runs.search.journal import NAME, Trial, read_trials
from tireroad.runs.search.settings import MARGIN, aim
from tireroad.runs.search.shares import CAUSES, worst


def add(results: Results, section: Section) -> None:
    """Add the trials of search.json, if the run began with a search and the file is readable."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        wanted = _wanted(results.scene)
        trials = [one for one in read_trials(results.directory / NAME) if one.found is not None]
        if wanted is not None and trials:
            _show(section, wanted, trials)


def _wanted(scene: Mapping[str, Any]) -> Accuracy | None:
    wanted = Accuracy(**scene.get("accuracy", {}))
    return None if wanted.target is None and wanted.target_db is None else wanted


def _show(section: Section, wanted: Accuracy, trials: list[Trial]) -> None:
    over = [_errors(trial, wanted) for trial in trials]
    cost = np.array([sum(trial.seconds.values()) for trial in trials])
    section.facts += [
        ("searched for", aim(wanted)),
        ("trials of the search", str(len(trials))),
        ("they took", quantity(float(sum(trial.spent for trial in trials)), "s")),
    ]
    section.show(
        trade(cost, np.array([worst(one)[0] for one in over]), np.array([_shares(o) for o in over])),
        "The search: estimated error over the one asked for, against the cost of a run with the settings of each "
        f"trial, in the order tried; marks: the part of each cause. A search goes on to 1/{MARGIN:g}.",
    )  # fmt: skip


def _errors(trial: Trial, wanted: Accuracy) -> NDArray:
    assert trial.found is not None
    return trial.found.over(wanted)


def _shares(over: NDArray) -> NDArray:
    """Shares by cause, for the figure furthest from its target."""
    return over[:, worst(over)[1]]


@figures.styled
def trade(cost: NDArray, error: NDArray, parts: NDArray) -> str:
    """Errors (n,) over their target, and their `parts` (n, causes), over a run's `cost` (n,) s."""
    figure, axes = figures.line_canvas(6.0, 3.0)
    here = axes[0, 0]
    here.plot(cost, error, "-o", color="#52606d", ms=4, label="all")
    for cause, values, colour in zip(CAUSES, parts.T, figures.CYCLE, strict=False):
        here.plot(cost, values, "x", color=colour, ms=4, label=cause)
    for number, (x, y) in enumerate(zip(cost, error, strict=True), 1):
        if np.isfinite(y):
            here.annotate(str(number), (x, y), (4, 4), textcoords="offset points")
    here.axhline(1.0, color=figures.MUTED, dashes=(4, 3))
    shown = np.concatenate([error, parts.ravel(), [1.0]])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    here.set(yscale="log", ylim=(max(shown.min() / 2, 1e-3), 2 * shown.max()))
    here.set(xlabel="cost of a run in s", ylabel="error over that asked for")
    here.legend(ncols=5, loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
    return figures.encode(figure)
