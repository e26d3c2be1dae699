"""Report sections about spectra: lines, densities, third octaves with their errors, and a search's trials."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import FEW, SILENT, heard, nominal
from tireroad.runs.files.trials import CAUSES, MARGIN, NAME, Trial, read_trials, worst
from tireroad.runs.report import figures, live
from tireroad.runs.report.read import (
    Results,
    Section,
    TextTable,
    about,
    quantity,
    without_friction,
)
from tireroad.runs.scene.tables.scene import AccuracyTable

_FILE = "spectra.h5"
_MORE = (  # third octaves, their quantity, reference
    ("contact_level", "contact force", "dB re 1 N"),
    ("hub_moment_level", "moment on the hub", "dB re 1 N m"),
)


def add(results: Results, section: Section) -> None:
    """Add the trials of search.json, if the run began with a search and the file is readable."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        table = _wanted(results.scene)
        trials = [
            trial for trial in read_trials(results.directory / NAME) if trial.found is not None
        ]
        if table is not None and trials:
            _show(section, table, trials)


def _wanted(scene: Mapping[str, Any]) -> AccuracyTable | None:
    table = AccuracyTable(**scene.get("accuracy", {}))
    return None if table.target is None and table.target_db is None else table


def _show(section: Section, table: AccuracyTable, trials: list[Trial]) -> None:
    over = [_errors(trial, table) for trial in trials]
    cost = np.array([sum(trial.seconds.values()) for trial in trials])
    section.facts += [
        ("searched for", table.aim()),
        ("trials of the search", str(len(trials))),
        ("they took", quantity(float(sum(trial.spent for trial in trials)), "s")),
    ]
    section.show(
        trade(cost, np.array([worst(value)[0] for value in over]), np.array([_shares(o) for o in over])),
        "The search: estimated error over the one asked for, against the cost of a run with the settings of each "
        f"trial, in the order tried; marks: the part of each cause. A search continues to 1/{MARGIN:g}.",
    )  # fmt: skip


def _errors(trial: Trial, table: AccuracyTable) -> NDArray:
    assert trial.found is not None
    return trial.found.over(table)


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


def spectra(results: Results) -> Section:
    """Spectra of the varying axle force or, if it is not stored, of the varying contact force."""
    frequency, force = results.array(_FILE, "frequency"), results.optional(_FILE, "axle_force")
    of = "contact force" if force is None else "axle force"
    contact = results.array(_FILE, "contact_force")
    force = contact if force is None else force
    lead = "Of its variation about the mean, by component."
    if without_friction(results):
        lead += " Without friction: x and y come from the road's slope alone."
    section = Section(f"Spectra of the {of}", lead)
    if len(frequency) < 2:
        section.notes.append("A run of one step has no spectrum.")
        return section
    spacing = quantity(float(frequency[1] - frequency[0]), "Hz")
    section.facts.append(("spacing of lines", spacing))
    for name, key, unit in (
        ("valid up to", "limit", "Hz"),
        ("limited by", "limit_cause", ""),
        ("the axle force is the", "axle_force_is", ""),
        ("left out as run-in", "left_out", "s"),
    ):
        value = results.attribute(_FILE, key)
        if value is not None:
            section.facts.append((name, quantity(value, unit)))
    octaves(results, section, of)
    if (results.directory / "search.json").is_file():  # importing search loads all stages
        add(results, section)
    if len(frequency) > 2:
        picture = figures.spectrum(frequency, force, of)
        section.show(picture, "Amplitude spectrum.", _lines(frequency, force, of))
    else:
        section.facts.append(_one_line(frequency[1], force[1], of))
    densities(results, section)
    return section


def _one_line(frequency: float, force: NDArray, of: str) -> tuple[str, str]:
    """The amplitudes (3,) N of a spectrum's only line beside 0 Hz, which would be a chart of a dot."""
    parts = (f"{axis} {quantity(float(abs(v)), 'N')}" for axis, v in zip("xyz", force, strict=True))
    return f"{of}, amplitude at {quantity(float(frequency), 'Hz')}", ", ".join(parts)


def _lines(frequency: NDArray, force: NDArray, of: str) -> dict:
    above_zero = frequency > 0
    level = figures.decibels(force[above_zero])
    level = np.where(level < level.max(initial=-1e3) - figures.RANGE_DB, np.nan, level)
    curves = dict(zip(figures.COMPONENTS, level.T, strict=True))
    labels = "frequency in Hz", f"{of} in dB re 1 N"
    return live.charts(
        live.chart(frequency[above_zero], curves, labels, figures.COLOURS, log=True, height=300)
    )


def octaves(results: Results, section: Section, of: str) -> None:
    """Add third octaves: with a table for the axle force, as figures for the other quantities."""
    centre = results.optional(_FILE, "third_octave/centre")
    level = results.optional(_FILE, "third_octave/level")
    name, level = ("level", level) if level is not None else ("contact_level", None)
    if level is None:
        level = results.optional(_FILE, "third_octave/contact_level")
    narrow = results.optional(_FILE, "third_octave/too_narrow")
    if narrow is not None and len(narrow):
        first, last = nominal(narrow[[0, -1]])
        bands = f"The bands from {first:g} to {last:g} Hz contain"
        bands = f"The band of {first:g} Hz contains" if first == last else bands
        section.notes.append(
            f"{bands} fewer than three spectral lines, so they have no level: lengthen time.duration."
        )
    if centre is None or level is None or not len(centre):
        section.notes.append("The run has no third-octave band.")
        return
    error = results.optional(_FILE, f"third_octave/{name}_error")
    weighted = results.optional(_FILE, f"third_octave/{name}_a_weighted")
    few = few_lines(results, len(centre))
    if unknown := results.attribute(_FILE, "unknown_error"):
        section.facts.append(("numerical error of the third octaves", str(unknown)))
    sure = results.optional(_FILE, "third_octave/confidence")
    held = results.optional(_FILE, "third_octave/windows")
    if held is not None and len(held) > 1:
        section.facts.append(("levels are of", _windows(held)))
    _show_bands(section, centre, level, error, of, "dB re 1 N", few, sure)
    section.table = _table(results, name, weighted, error, sure)
    for key, what, reference in _MORE:
        more = results.optional(_FILE, f"third_octave/{key}")
        if more is None or key == name:
            continue
        error = results.optional(_FILE, f"third_octave/{key}_error")
        _show_bands(section, centre, more, error, what, reference, few, sure)


def _windows(held: NDArray) -> str:
    """In words: the windows of the run's own record and of each further stretch, whose powers are averaged."""
    return (
        f"{held.sum():g} half-overlapping windows of road: the run's own, and {held[1]:g} on each of {len(held) - 1} further "
        "stretches"
    )


def _show_bands(
    section: Section,
    centre: NDArray,
    level: NDArray,
    error: NDArray | None,
    of: str,
    reference: str,
    few: NDArray,
    sure: NDArray | None,
) -> None:
    """Add levels (b, 3) dB over band centres (b,) Hz, with their errors (b, 3) dB and bounds (b, 2) dB by chance."""
    if len(centre) < figures.FEWEST_BANDS:
        section.facts += _in_numbers(centre, level, error, of, reference)
        return
    label = f"{of}, rms, in {reference}"
    shown = heard(level)
    series = {
        name: (shown[:, n], None if error is None else error[:, n])
        for n, name in enumerate(figures.COMPONENTS)
    }
    drawn = live.bars(
        [f"{c:g}" for c in nominal(centre)],
        series,
        ("third-octave band in Hz", label),
        figures.COLOURS,
        ends=figures.level_range(level),
        few=few,
        chance=sure,
    )
    picture = figures.third_octaves(centre, level, error, label, few, chance=sure)
    section.show(picture, _caption(of, level, error, few, sure), drawn)


def _in_numbers(
    centre: NDArray, level: NDArray, error: NDArray | None, of: str, reference: str
) -> list[tuple[str, str]]:
    """Facts of bands too few for a chart: levels (b, 3) by component, and errors where known."""
    about = np.full_like(level, np.nan) if error is None else error
    return [
        (
            f"{of}, third octave {name:g} Hz, {reference}",
            ", ".join(f"{axis} {_bounded(v, e)}" for axis, v, e in zip("xyz", *both, strict=True)),
        )
        for name, *both in zip(nominal(centre), level, about, strict=True)
    ]


def _bounded(level: float, error: float) -> str:
    if level <= SILENT:
        return _texts(np.array([level]))[0]
    known = about(error) if np.isfinite(error) else "(error unknown)"
    return f"{_texts(np.array([level]))[0]} {known}"


def few_lines(results: Results, count: int) -> NDArray:
    """Mask (b,) of bands with too few lines, in all windows together, for a reliable level."""
    held = results.optional(_FILE, "third_octave/lines")
    windows = results.optional(_FILE, "third_octave/windows")
    times = 1 if windows is None else windows.sum()
    return np.zeros(count, bool) if held is None else times * held < FEW


def _caption(
    of: str, level: NDArray, error: NDArray | None, few: NDArray, sure: NDArray | None
) -> str:
    caption = f"Third-octave bands of the {of}, rms."
    if sure is not None:
        caption += " Boxes: chance of the stretch of road, 95 %, by the number of lines."
    if error is not None and np.isfinite(error).any():
        caption += " Lines on the bars: estimated numerical error, by mesh, modes, step and points."
        if np.isnan(error[level > SILENT]).any():
            caption += " Of bars without a line it is unknown."
    else:
        caption += " Their numerical error is unknown."
    if few.any():
        caption += f" Pale: fewer than {FEW} lines in the band, so its level may be off by more than 3 dB by chance."
    return caption


def _table(
    results: Results,
    name: str,
    weighted: NDArray | None,
    error: NDArray | None,
    sure: NDArray | None,
) -> TextTable:
    """The vertical levels of the dataset `name`, their numerical errors, and their bounds by chance."""
    centre, level, spread = (
        results.optional(_FILE, f"third_octave/{key}") for key in ("centre", name, f"{name}_spread")
    )
    assert centre is not None and level is not None
    head = ["band, Hz", "z, dB re 1 N"]
    columns = [[f"{c:g}" for c in nominal(centre)], _texts(level[:, 2])]
    if error is not None:
        head.append("numerical error, dB")
        columns.append([about(e) for e in error[:, 2]])
    if weighted is not None:
        head.append("z, dB(A)")
        columns.append(_texts(weighted[:, 2]))
    for what, bounds in (("lines", sure), ("spread", None if spread is None else spread[:, 2])):
        if bounds is not None:
            head.append(f"chance, 95 %, by {what}, dB")
            columns.append([_between(*ends) for ends in bounds])
    return TextTable(tuple(head), list(zip(*columns, strict=True)))


def _between(low: float, high: float) -> str:
    return f"{low:+.1f} to {high:+.1f}".replace("-", "−") if np.isfinite(high) else "unknown"


def _texts(level: NDArray) -> list[str]:
    return [f"{v:.1f}".replace("-", "−") if v > SILENT else "none" for v in level]


def densities(results: Results, section: Section) -> None:
    """Add the power spectral densities of the vertical forces."""
    frequency = results.optional(_FILE, "density/frequency")
    if frequency is None or len(frequency) < 3:
        return
    found = {
        what: results.optional(_FILE, f"density/{key}")
        for what, key in (("contact force z", "contact_force"), ("axle force z", "axle_force"))
    }
    curves = {
        what: figures.decibels(values[1:, 2]) / 2
        for what, values in found.items()
        if values is not None
    }
    segment, averages = (results.array(_FILE, f"density/{k}") for k in ("segment", "averages"))
    low, high = results.array(_FILE, "density/confidence")
    labels = "frequency in Hz", "density in dB re 1 N²/Hz"
    drawn = live.charts(
        live.chart(frequency[1:], curves, labels, figures.COLOURS[::2], log=True, height=280)
    )
    section.show(
        figures.lines(frequency[1:], curves, labels, figures.COLOURS[::2]),
        f"Power spectral density by Welch: Hann windows of {quantity(float(segment), 's')}, half overlapping, "
        f"{int(averages)} averages. That of the stationary process lies between {low:.1f} and +{high:.1f} dB of it "
        "in 95 % of all cases.".replace("-", "−"),
        drawn,
    )
