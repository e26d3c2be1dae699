"""`compare`: two to twelve runs in one page and one table, from their result folders alone."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tireroad.contact.results.spectra import in_band
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import UNFINISHED
from tireroad.runs.report.figures import (
    CYCLE,
    FEWEST_BANDS,
    WIDE,
    Drawing,
    canvas,
    drawing,
    encode,
    envelope,
    styled,
)
from tireroad.runs.report.kit import page_of
from tireroad.runs.report.levels import BandLevels, band_levels, is_drawn
from tireroad.runs.report.read import shown_unit
from tireroad.runs.report.scene_keys import scene_keys
from tireroad.runs.report.surface_figures import PRESSURE, frame
from tireroad.runs.results.reader import RunResults

Array = NDArray[np.float64]
_ROUNDING = 1e-9  # relative: a load that is given comes out so near
MATCHED = 24  # lowest modes of the first run that are matched in the others
DASHES = ("-", "--")
MOST = 12
_BOX = 0.14  # width of a box of chance, of the distance of bands


@dataclass(frozen=True)
class Row:
    """One quantity in every run; None for a run that does not have it."""

    group: str
    name: str
    unit: str
    values: tuple[Any, ...]

    @property
    def differs(self) -> bool:
        """Whether the runs differ in it by more than rounding."""
        return not all(_same(self.values[0], value) for value in self.values)


def _same(first: Any, other: Any) -> bool:
    """Whether two values are equal, numbers but for rounding."""
    if isinstance(first, float) and isinstance(other, int | float):
        return math.isclose(first, other, rel_tol=_ROUNDING)
    return first == other


def scene_rows(scenes: Sequence[Mapping[str, Any]]) -> list[Row]:
    """The scene keys whose values differ between runs; None for an absent key."""
    flat = [{key.path: key for key in scene_keys(scene)} for scene in scenes]
    keys = sorted({key for by_path in flat for key in by_path} - {"name"})
    rows = []
    for key in keys:
        unit = next(by_path[key].unit for by_path in flat if key in by_path)
        values = tuple(by_path[key].value if key in by_path else None for by_path in flat)
        rows.append(Row("scene", key, unit, values))
    return [row for row in rows if row.differs]


def figure_rows(summaries: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Headline figures of all stages, in the order of the first run that has them."""
    rows: dict[tuple[str, str], Row] = {}
    for summary in summaries:
        for stage, record in summary.items():
            for name, entry in (record.get("headline") or {}).items():
                values = tuple(
                    ((other.get(stage, {}).get("headline") or {}).get(name) or {}).get("value")
                    for other in summaries
                )
                rows.setdefault((stage, name), Row(stage, name, entry.get("unit", ""), values))
    return list(rows.values())


def cost_rows(summaries: Sequence[Mapping[str, Any]]) -> list[Row]:
    """Seconds of each stage; None if it was reused or skipped."""
    stages = list(dict.fromkeys(stage for summary in summaries for stage in summary))
    computed = [
        {stage: record.get("seconds") for stage, record in summary.items()} for summary in summaries
    ]
    return [
        Row("cost", stage, "s", tuple(one.get(stage) or None for one in computed))
        for stage in stages
        if any(one.get(stage) for one in computed)
    ]


def level_rows(runs: Sequence[RunResults]) -> list[Row]:
    """Third-octave levels by quantity and band (runs.report.levels); None where a run has none."""
    every = [{band.name: band for band in band_levels(run)} for run in runs]
    units = {name: level.unit for levels in every for name, level in levels.items()}
    return [row for name in units for row in _bands(name, units[name], every)]


def _bands(name: str, unit: str, every: Sequence[Mapping[str, BandLevels]]) -> list[Row]:
    """Rows of one quantity, ascending, of the bands that any run has."""
    levels: list[dict[float, float]] = []
    for by_name in every:
        level = by_name.get(name)
        pairs = [] if level is None else zip(level.band, level.level, strict=True)
        levels.append({float(band): float(value) for band, value in pairs if np.isfinite(value)})
    return [
        Row(name, f"{band:g} Hz", unit, tuple(own.get(band) for own in levels))
        for band in sorted({band for own in levels for band in own})
    ]


def mode_rows(runs: Sequence[RunResults]) -> list[Row]:
    """Frequencies of the first run's lowest modes, and of the most similar mode in each other run.

    Similarity is the modal assurance criterion (MAC) of the motion of the outer face: nodes of the
    first run against the nearest nodes of the other. The row's name states its least MAC.
    """
    if not all("modes/surface/shape" in run for run in runs):
        return []
    reference = runs[0]
    frequency = reference["modes/frequency"][:MATCHED]
    shape = reference["modes/surface/shape"][:MATCHED]
    points = reference["modes/surface/points"]
    rows = [list(frequency)]
    least = np.ones(len(frequency))
    for run in runs[1:]:
        other = run["modes/surface/shape"]
        _, near = cKDTree(run["modes/surface/points"]).query(points)
        mac = assurance(shape, other[:, near])
        best = mac.argmax(axis=1)
        rows.append(list(run["modes/frequency"][best]))
        least = np.minimum(least, mac.max(axis=1))
    called = reference["modes/name"] if "modes/name" in reference else [""] * len(frequency)
    return [
        Row("modes", f"mode {k + 1}{_called(called[k])}, MAC {least[k]:.2f}", "Hz", values)
        for k, values in enumerate(zip(*([float(f) for f in row] for row in rows), strict=True))
    ]


def _called(name: str) -> str:
    return f" {name}" if name else ""


def assurance(first: Array, second: Array) -> Array:
    """|a . b|^2 / (a . a)(b . b) of shapes (m, s, 3) and (n, s, 3): (m, n), 1 if identical."""
    a, b = first.reshape(len(first), -1), second.reshape(len(second), -1)
    square = np.einsum("ij,ij->i", a, a)[:, None] * np.einsum("ij,ij->i", b, b)[None, :]
    return (a @ b.T) ** 2 / np.maximum(square, 1e-300)


def pen(number: int) -> dict[str, str]:
    """Colour and dashes for the curve of run `number`."""
    return {"color": CYCLE[number % len(CYCLE)], "ls": DASHES[number // len(CYCLE) % 2]}


@dataclass(frozen=True)
class BandMarks:
    """Marks of a run's third octaves: `level` (b,), numerical `error` (b,), bounds `chance` (b, 2), dB; NaN where unknown."""

    level: Array
    error: Array
    chance: Array

    @staticmethod
    def at(bands: Sequence[float], levels: BandLevels | None) -> BandMarks:
        """Marks of one run at bands (b,) Hz; NaN where it has none of them."""
        placed = BandMarks(*(np.full((len(bands), *more), np.nan) for more in ((), (), (2,))))
        if levels is None:
            return placed
        for k, band in enumerate(bands):
            for here in np.flatnonzero(np.isclose(levels.band, band)):
                placed.level[k], placed.error[k] = levels.level[here], levels.error[here]
                placed.chance[k] = levels.chance[here]
        return placed


def marks(axes: Axes, place: Array, bands: BandMarks, **drawn: Any) -> None:
    """Levels joined by a line at places (b,), with a bar for the numerical error and a box for the chance of each."""
    line = axes.plot(place, bands.level, marker="o", ms=3, **drawn)[0]
    colour = line.get_color()
    known = np.isfinite(bands.level) & np.isfinite(bands.error)
    ends = place[known], bands.level[known], bands.error[known]
    axes.errorbar(*ends, fmt="none", ecolor=colour, elinewidth=1.2, capsize=2.5)
    boxed = np.isfinite(bands.level) & np.isfinite(bands.chance).all(axis=1)
    low, high = bands.chance[boxed].T
    bottom = bands.level[boxed] + low
    box = {"color": colour, "alpha": 0.16, "lw": 0}
    axes.bar(place[boxed], high - low, _BOX, bottom=bottom, **box)


@styled
def levels_figure(
    bands: Sequence[float], unit: str, runs: Mapping[str, BandMarks], width: float
) -> str:
    """Third octaves of every run with their marks, and below them the difference from the first, dB."""
    figure, axes = canvas(width, 5.0, 2, sharex=True, gridspec_kw={"height_ratios": (2, 1)})
    names, place = list(runs), np.arange(len(bands), dtype=float)
    first = runs[names[0]].level
    for number, (name, levels) in enumerate(runs.items()):
        shift = 0.5 * (number / max(len(names) - 1, 1) - 0.5)  # so that no mark hides another
        marks(axes[0, 0], place + 0.5 * shift, levels, label=name, **pen(number))
        if number:
            change = levels.level - first
            axes[1, 0].plot(place, change, marker="o", ms=3, **pen(number))
    axes[0, 0].set_ylabel(shown_unit(unit))
    legend_above(axes[0, 0], names, width)
    axes[1, 0].axhline(0.0, color="#7b8794", lw=0.8)
    axes[1, 0].set(ylabel=f"less {names[0]}, dB", xlabel="third-octave band in Hz")
    axes[1, 0].set_xticks(place, [f"{band:g}" for band in bands], rotation=45)
    return encode(figure)


def legend_above(axes: Axes, names: Sequence[str], width: float) -> None:
    """A legend above the axes, in as many columns as its names leave room for."""
    longest = max(map(len, names)) + 4
    columns = int(np.clip(14 * width / longest, 1, 4))
    axes.legend(ncols=columns, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)


@styled
def histories_figure(runs: Mapping[str, tuple[Array, Array]], width: float) -> str:
    """Forces (nt,) N over time (nt,) s."""
    figure, axes = canvas(width, 3.0)
    for number, (name, (time, force)) in enumerate(runs.items()):
        axes[0, 0].plot(*envelope(time, force), lw=0.9, label=name, **pen(number))
    axes[0, 0].set(xlabel="time in s", ylabel="vertical contact force in N")
    legend_above(axes[0, 0], list(runs), width)
    return encode(figure)


@styled
def footprints(runs: Mapping[str, tuple[Array, Array]], width: float) -> str:
    """Pressure (c,) Pa at contact points (c, 3) m, on one colour scale."""
    columns = min(len(runs), 3 if width >= WIDE else 2)
    rows = -(-len(runs) // columns)
    figure, axes = canvas(width, 2.6 * rows, rows, columns, sharex=True, sharey=True)
    top = 1e-3 * max(pressure.max() for _, pressure in runs.values())
    scale = Normalize(0.0, top)
    every = np.concatenate([points[pressure > 0, :2] for points, pressure in runs.values()])
    low, high = frame(1e3 * every)
    for here, (name, (points, pressure)) in zip(axes.flat, runs.items(), strict=False):
        touching = pressure > 0
        place = 1e3 * points[touching]
        here.scatter(
            place[:, 0], place[:, 1], s=14, c=1e-3 * pressure[touching], cmap=PRESSURE, norm=scale
        )
        here.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        here.set_title(name, fontsize=8)
        here.set_xlabel("x in mm")
    for here in axes.flat[len(runs) :]:
        here.axis("off")
    axes[0, 0].set_ylabel("y in mm")
    figure.colorbar(ScalarMappable(scale, PRESSURE), ax=axes, label="pressure in kPa", pad=0.01)
    return encode(figure, "png")


def compare(directories: Sequence[Path], out: Path) -> Path:
    """Write out/compare.html and out/compare.csv; returns the page. Not collective.

    The first run is the reference. Quantities that a run does not have are left out and listed.
    Raises InputError for fewer than 2 or more than 12 folders, and for one without results.
    """
    if not 2 <= len(directories) <= MOST:
        raise InputError(f"compare takes 2 to {MOST} result folders, not {len(directories)}")
    runs = [RunResults(directory) for directory in directories]
    names = _names(directories)
    groups = _groups(runs)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{out}: cannot be made ({error.strerror}): choose another --out"
        ) from error
    write_text(out / "compare.csv", _table(names, groups))
    page = out / "compare.html"
    write_text(page, _page(runs, names, groups))
    return page


def _names(directories: Sequence[Path]) -> list[str]:
    """The folders' names, with as much of their paths as makes them unique."""
    whole = [directory.resolve() for directory in directories]
    for depth in range(1, 1 + max(len(path.parts) for path in whole)):
        names = ["/".join(path.parts[-depth:]) for path in whole]
        if len(set(names)) == len(set(whole)):
            return names
    return [str(path) for path in whole]


def _groups(runs: Sequence[RunResults]) -> dict[str, list[Row]]:
    summaries = [run.summary for run in runs]
    return {
        "scene": scene_rows([run.scene for run in runs]),
        "figures": figure_rows(summaries),
        "levels": level_rows(runs),
        "modes": mode_rows(runs),
        "cost": cost_rows(summaries),
    }


def _table(names: Sequence[str], groups: dict[str, list[Row]]) -> str:
    """The CSV: one row per quantity, one column per run."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["group", "quantity", "unit", *names])
    for rows in groups.values():
        for row in rows:
            cells = ["" if value is None else value for value in row.values]
            writer.writerow([row.group, row.name, row.unit, *cells])
    return stream.getvalue()


def _page(runs: Sequence[RunResults], names: Sequence[str], groups: dict[str, list[Row]]) -> str:
    return page_of(
        "compare",
        f"{len(names)} runs compared",
        filters={"change": _change},
        names=names,
        tables=_tables(groups),
        scene=groups["scene"],
        figures=_figures(runs, names, groups["levels"]),
        missing=_missing(runs, names),
    )


def _tables(groups: Mapping[str, list[Row]]) -> list[tuple[str, list[Row], list[Row]]]:
    """Title, rows in which the runs differ, and those in which all are the same, of each table."""
    titles = {
        "figures": "Headline figures",
        "modes": "Modes, matched by shape",
        "levels": "Third octaves",
        "cost": "Seconds a stage",
    }
    return [
        (
            title,
            [row for row in groups[key] if row.differs],
            [row for row in groups[key] if not row.differs],
        )
        for key, title in titles.items()
        if groups[key]
    ]


def _change(row: Row, index: int) -> str:
    """A value's difference from the first run's: in dB for levels, in percent for other numbers."""
    if row.name.rpartition(".")[2] == "seed":  # a number that measures nothing
        return ""
    first, value = row.values[0], row.values[index]
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (first, value))
    if index == 0 or not numbers or _same(first, value):
        return ""
    if row.unit.startswith("dB"):
        change = value - first
        return f"{change:+.1f} dB" if abs(change) >= 0.05 else f"{change:+.1g} dB"
    if not first:
        return ""
    change = 100 * (value / first - 1)
    return f"{change:+.2g} %" if abs(change) < 99.5 else f"{change:+.0f} %"


def _figures(
    runs: Sequence[RunResults], names: Sequence[str], levels: Sequence[Row]
) -> list[Drawing]:
    """Charts of the third octaves that several runs have, of histories and of footprints."""
    figures, every = [], [{level.name: level for level in band_levels(run)} for run in runs]
    for group in dict.fromkeys(row.group for row in levels if is_drawn(row.group)):
        rows = [row for row in levels if row.group == group]
        several = sum(any(row.values[k] is not None for row in rows) for k in range(len(runs))) > 1
        if len(rows) >= FEWEST_BANDS and several:  # fewer are in the table
            bands = [float(row.name.removesuffix(" Hz")) for row in rows]
            drawn = {
                name: BandMarks.at(bands, levels.get(group))
                for name, levels in zip(names, every, strict=True)
            }
            text = f"Third octaves: {group}.{marks_told(list(drawn.values()))}"
            chart = partial(levels_figure, bands, rows[0].unit, drawn)
            figures.append(drawing(chart, text))
    histories = {
        name: _valid(run)
        for name, run in zip(names, runs, strict=True)
        if "contact/total_force" in run
    }
    if len(histories) > 1:
        text = "Vertical contact force over time, below the limit of each run's spectra."
        figures.append(drawing(partial(histories_figure, histories), text))
    prints = {
        name: (run["static/contact/points"], run["static/contact/pressure"])
        for name, run in zip(names, runs, strict=True)
        if "static/contact/pressure" in run and (run["static/contact/pressure"] > 0).any()
    }
    if len(prints) > 1:
        text = "Contact pressure at rest, one scale for all."
        figures.append(drawing(partial(footprints, prints), text))
    return figures


def marks_told(drawn: Sequence[BandMarks]) -> str:
    """Explanation of the marks that a chart has."""
    told = ""
    if any(np.isfinite(mark.error).any() for mark in drawn):
        told += " Bars: estimated numerical error, unknown where there is none."
    elif any(np.isfinite(mark.level).any() for mark in drawn):
        told += " Their numerical error is unknown."
    if any(np.isfinite(mark.chance).any() for mark in drawn):
        told += " Boxes: chance of the stretch of road, 95 %, by the number of lines."
    return told


def _valid(run: RunResults) -> tuple[Array, Array]:
    """Time (nt,) s and vertical contact force (nt,) N, as far as it is valid where a limit is known."""
    time, force = run["contact/time"], run["contact/total_force"]
    limit = run.attributes("spectra").get("limit") if "spectra/frequency" in run else None
    if limit is not None and len(time) > 1:
        force = in_band(force, float(run.attributes("contact")["step"]), float(limit))
    return time, force[:, 2]


def _missing(runs: Sequence[RunResults], names: Sequence[str]) -> list[str]:
    """Runs that did not finish, and result files that some runs have and others lack."""
    unfinished = {Path(name).stem for name in UNFINISHED}
    files = [{key.partition("/")[0] for key in run} - unfinished for run in runs]
    ended = [f"{name}: {run.ending}" for name, run in zip(names, runs, strict=True) if run.ending]
    return ended + [
        f"{name} has no {', '.join(f'{file}.h5' for file in sorted(set.union(*files) - own))}: left out there."
        for name, own in zip(names, files, strict=True)
        if set.union(*files) - own
    ]
