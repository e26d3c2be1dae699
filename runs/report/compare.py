"""`compare`: two to twelve runs in one page and one table, from their result folders alone."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tireroad.contact.results.spectra import SILENT, nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import UNFINISHED
from tireroad.runs.files.reader import RunResults
from tireroad.runs.report.figures import CYCLE, FEWEST_BANDS, WIDE, canvas, encode, envelope, styled
from tireroad.runs.report.read import quantity
from tireroad.runs.report.surface_figures import PRESSURE, frame
from tireroad.runs.version import PROGRAM, VERSION

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
LEVELS = (
    ("axle force", "spectra/third_octave/level", "dB re 1 N"),
    ("contact force", "spectra/third_octave/contact_level", "dB re 1 N"),
    ("moment on the hub", "spectra/third_octave/hub_moment_level", "dB re 1 N m"),
    ("sound pressure", "sound/third_octave/level_a", "dB(A) re 20 uPa"),
    ("sound power", "sound/power", "dB re 1 pW"),
)
MATCHED = 24  # lowest modes of the first run that are matched in the others


@dataclass(frozen=True)
class Row:
    """One quantity in every run; None for a run that does not have it."""

    group: str
    name: str
    unit: str
    values: tuple[Any, ...]


def scene_rows(scenes: Sequence[Mapping[str, Any]]) -> list[Row]:
    """The scene keys whose values differ between runs; None for an absent key."""
    flat = [dict(_flattened(scene)) for scene in scenes]
    keys = sorted({key for one in flat for key in one} - {"name"})
    rows = [Row("scene", key, "", tuple(one.get(key) for one in flat)) for key in keys]
    return [row for row in rows if any(value != row.values[0] for value in row.values)]


def _flattened(table: Mapping[str, Any], path: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, value in table.items():
        where = f"{path}.{key}" if path else key
        if isinstance(value, Mapping):
            found += _flattened(value, where)
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for number, one in enumerate(value):
                found += _flattened(one, f"{where}.{number}")
        else:
            found.append((where, value))
    return found


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
    """Third-octave levels by quantity, component and band, in dB re the reference in `LEVELS`."""
    return [
        row
        for quantity, path, unit in LEVELS
        if any(path in run for run in runs)
        for row in _bands(runs, quantity, path, unit)
    ]


def _bands(runs: Sequence[RunResults], quantity: str, path: str, unit: str) -> list[Row]:
    found: list[dict[tuple[int, float], float]] = []
    for run in runs:
        own: dict[tuple[int, float], float] = {}
        centre = path.partition("/")[0] + "/third_octave/centre"
        if path in run and centre in run and len(run[centre]):
            heard_at = run[path].T if path.endswith("level_a") else run[path]
            level = heard_at.reshape(len(run[centre]), -1)  # some have components
            for band, parts in zip(nominal(run[centre]), level, strict=True):
                heard = ((axis, float(v)) for axis, v in enumerate(parts) if v > SILENT)
                own |= {(axis, float(band)): v for axis, v in heard}
        found.append(own)
    keys = sorted({key for own in found for key in own})
    several = any(axis for axis, _ in keys)
    names: Sequence[str] = AXES
    if path.startswith("sound/") and several:
        longest = max(runs, key=lambda run: len(run[path]) if path in run else 0)
        names = [f"at {name}" for name in longest.attributes("sound")["microphone_names"]]
    return [
        Row(
            f"{quantity} {names[axis]}" if several else quantity,
            f"{band:g} Hz",
            unit,
            tuple(own.get((axis, band)) for own in found),
        )
        for axis, band in keys
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
    found = [list(frequency)]
    least = np.ones(len(frequency))
    for run in runs[1:]:
        other = run["modes/surface/shape"]
        _, near = cKDTree(run["modes/surface/points"]).query(points)
        mac = assurance(shape, other[:, near])
        best = mac.argmax(axis=1)
        found.append(list(run["modes/frequency"][best]))
        least = np.minimum(least, mac.max(axis=1))
    return [
        Row("modes", f"mode {k + 1}, MAC {least[k]:.2f}", "Hz", tuple(float(f[k]) for f in found))
        for k in range(len(frequency))
    ]


def assurance(first: Array, second: Array) -> Array:
    """|a . b|^2 / (a . a)(b . b) of shapes (m, s, 3) and (n, s, 3): (m, n), 1 if identical."""
    a, b = first.reshape(len(first), -1), second.reshape(len(second), -1)
    square = np.einsum("ij,ij->i", a, a)[:, None] * np.einsum("ij,ij->i", b, b)[None, :]
    return (a @ b.T) ** 2 / np.maximum(square, 1e-300)


DASHES = ("-", "--")


def pen(number: int) -> dict[str, str]:
    """Colour and dashes for the curve of run `number`."""
    return {"color": CYCLE[number % len(CYCLE)], "ls": DASHES[number // len(CYCLE) % 2]}


@styled
def levels_figure(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Third octaves of every run, and below them the difference from the first, dB."""
    values = np.array([[np.nan if v is None else v for v in row.values] for row in rows])
    figure, axes = canvas(WIDE, 5.0, 2, sharex=True, gridspec_kw={"height_ratios": (2, 1)})
    place = np.arange(len(rows))
    for number, name in enumerate(names):
        axes[0, 0].plot(place, values[:, number], marker="o", ms=3, label=name, **pen(number))
        if number:
            change = values[:, number] - values[:, 0]
            axes[1, 0].plot(place, change, marker="o", ms=3, **pen(number))
    axes[0, 0].set_ylabel(rows[0].unit)
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
    axes[1, 0].axhline(0.0, color="#7b8794", lw=0.8)
    axes[1, 0].set(ylabel=f"less {names[0]}, dB", xlabel="third-octave band")
    axes[1, 0].set_xticks(place, [row.name for row in rows], rotation=45)
    return encode(figure)


@styled
def histories_figure(runs: Mapping[str, tuple[Array, Array]]) -> str:
    """Forces (nt,) N over time (nt,) s."""
    figure, axes = canvas(WIDE, 3.0)
    for number, (name, (time, force)) in enumerate(runs.items()):
        axes[0, 0].plot(*envelope(time, force), lw=0.9, label=name, **pen(number))
    axes[0, 0].set(xlabel="time in s", ylabel="vertical contact force in N")
    axes[0, 0].legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8)
    return encode(figure)


@styled
def footprints(runs: Mapping[str, tuple[Array, Array]]) -> str:
    """Pressure (c,) Pa at contact points (c, 3) m, on one colour scale."""
    columns = min(len(runs), 3)
    rows = -(-len(runs) // columns)
    figure, axes = canvas(WIDE, 2.6 * rows, rows, columns, sharex=True, sharey=True)
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


MOST = 12
# Groups of levels that are drawn, and their names.
DRAWN = {
    "axle force z": "vertical axle force",
    "contact force z": "vertical contact force",
    "radiated power": "equivalent radiated power",
}


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
            given = ["" if value is None else value for value in row.values]
            writer.writerow([row.group, row.name, row.unit, *given])
    return stream.getvalue()


def _page(runs: Sequence[RunResults], names: Sequence[str], groups: dict[str, list[Row]]) -> str:
    pages = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    pages.filters |= {"quantity": quantity, "change": _change}
    return pages.get_template("compare.html.j2").render(
        program=f"{PROGRAM} {VERSION}",
        names=names,
        groups=groups,
        figures=_figures(runs, names, groups["levels"]),
        missing=_missing(runs, names),
    )


def _change(row: Row, index: int) -> str:
    """A value's difference from the first run's: in dB for levels, in percent for other numbers."""
    first, value = row.values[0], row.values[index]
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (first, value))
    if index == 0 or not numbers or first == value:
        return ""
    if row.unit.startswith("dB"):
        return f"{value - first:+.1f} dB"
    if not first:
        return ""
    change = 100 * (value / first - 1)
    return f"{change:+.2g} %" if abs(change) < 99.5 else f"{change:+.0f} %"


def _figures(
    runs: Sequence[RunResults], names: Sequence[str], levels: Sequence[Row]
) -> list[tuple[str, str]]:
    found = []
    for group, what in DRAWN.items():
        rows = [row for row in levels if row.group == group]
        if len(rows) >= FEWEST_BANDS:  # fewer are in the table
            found.append((levels_figure(rows, names), f"Third octaves of the {what}."))
    histories = {
        name: (run["contact/time"], run["contact/total_force"][:, 2])
        for name, run in zip(names, runs, strict=True)
        if "contact/total_force" in run
    }
    if len(histories) > 1:
        found.append((histories_figure(histories), "Vertical contact force over time."))
    prints = {
        name: (run["static/contact/points"], run["static/contact/pressure"])
        for name, run in zip(names, runs, strict=True)
        if "static/contact/pressure" in run and (run["static/contact/pressure"] > 0).any()
    }
    if len(prints) > 1:
        found.append((footprints(prints), "Contact pressure at rest, one scale for all."))
    return found


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
