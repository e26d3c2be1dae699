"""The self-contained page of benchmarks and validations, with numbered tables and figures."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable
from os.path import commonprefix
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from tireroad.runs.report.figures import canvas, encode, styled
from tireroad.runs.report.kit import page_of
from tireroad.runs.version import PROGRAM, VERSION

COLOURS = ("#2f6db5", "#c8502d", "#2e8b6a", "#7a4fa3", "#b58a1f", "#52606d")
MARKS = ("o", "s", "^", "D", "v", "P")
INK, MUTED = "#1d2733", "#9aa5b1"
MOST_MARKS = 40  # curves with more points are drawn without marks
SIZES = (4.0, 9.0)  # points: sizes of the marks for the smallest and the largest value

LONG = 16  # rows above which a table is collapsed


def drawn(table: Any) -> str | None:
    """The figure that `plot` of a runs.validation.tables.Table asks for, as a data URI, or None.

    kind "lines" (default): `y` columns over column `x`, one curve per value of column `by`, axes in
    `log` logarithmic; "front": `points` (rows like the table's), coloured by column `by`, with
    marks by column `mark` and sizes by column `size`, the rows `front` joined and labelled by
    column `label`, the rows `beside` as a separate curve; "bars": ratios of column `y`, starting at
    1, named by the columns `x`. `targets` are horizontal lines, `limits` vertical ones:
    (value, text) each.
    """
    if table.plot is None:
        return None
    return _KINDS[table.plot.get("kind", "lines")](table)


class _Columns:
    """Columns of rows by name; their units appear in axis labels."""

    def __init__(self, table: Any) -> None:
        self.names = [name for name, _ in table.columns]
        self._units = dict(table.columns)

    def pick(self, row: list, name: str) -> Any:
        return row[self.names.index(name)]

    def label(self, name: str) -> str:
        unit = self._units[name]
        return name if unit in ("", "-") else f"{name} in {unit}"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


@styled
def _lines(table: Any) -> str:
    plot, columns = table.plot, _Columns(table)
    figure, axes = canvas(8.0, 4.4)
    here, by = axes[0, 0], plot.get("by")
    groups = list(dict.fromkeys(columns.pick(row, by) for row in table.rows)) if by else [None]
    several = len(plot["y"]) > 1
    curves = 0
    for group in groups:
        rows = [row for row in table.rows if by is None or columns.pick(row, by) == group]
        for name in plot["y"]:
            points = [(columns.pick(row, plot["x"]), columns.pick(row, name)) for row in rows]
            points = sorted(p for p in points if all(map(_is_number, p)))
            if not points:
                continue
            parts = [str(group) if by else "", name if several or not by else ""]
            colour, mark = COLOURS[curves % len(COLOURS)], MARKS[curves % len(MARKS)]
            dense = len(points) > MOST_MARKS
            style = {"color": colour, "marker": "" if dense else mark, "ms": 4.5, "lw": 1.3}
            here.plot(*zip(*points, strict=True), label=", ".join(filter(None, parts)), **style)
            curves += 1
    _scales(here, plot.get("log", ""))
    here.set(xlabel=columns.label(plot["x"]), ylabel=columns.label(plot["y"][0]))
    if several:
        here.set_ylabel(_shared_label(plot["y"], columns))
    if curves > 1:
        here.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), title=by)
    _guides(here, plot)
    return encode(figure)


def _shared_label(names: list[str], columns: _Columns) -> str:
    """Common label of several curves on one axis: the first words of their names, and the unit."""
    words = list(commonprefix([name.split() for name in names]))
    while words and words[-1] in ("of", "a", "the"):
        words.pop()
    units = {columns.label(name).removeprefix(name) for name in names}
    unit = units.pop() if len(units) == 1 else ""
    return " ".join(words) + unit if words else unit.removeprefix(" in ")


@styled
def _front(table: Any) -> str:
    plot, columns = table.plot, _Columns(table)
    figure, axes = canvas(9.5, 5.4)
    here = axes[0, 0]

    def place(row: list) -> tuple[float, float]:
        return columns.pick(row, plot["x"]), columns.pick(row, plot["y"][0])

    colours = _styles(plot["points"], columns, plot["by"], COLOURS)
    marks = _styles(plot["points"], columns, plot["mark"], MARKS)
    counts = sorted({columns.pick(row, plot["size"]) for row in plot["points"]})
    step = (SIZES[1] - SIZES[0]) / max(len(counts) - 1, 1)
    sizes = {count: SIZES[0] + step * k for k, count in enumerate(counts)}
    for row in plot["points"]:
        colour, mark = (
            colours[columns.pick(row, plot["by"])],
            marks[columns.pick(row, plot["mark"])],
        )
        size = sizes[columns.pick(row, plot["size"])]
        here.plot(*place(row), mark, color=colour, ms=size, alpha=0.75, mew=0.0, zorder=3)
    if plot["beside"]:
        far = list(zip(*map(place, plot["beside"]), strict=True))
        here.plot(*far, "*--", color=INK, ms=9, lw=0.9, label=plot["beside_name"])
    best = [place(row) for row in plot["front"]]
    here.step([x for x, _ in best], [y for _, y in best], where="post", color=INK, lw=1.3, zorder=2)
    for k, row in enumerate(plot["front"]):
        # Alternate sides of labels: neighbours on a front may be close.
        aside = {"ha": "left", "va": "bottom"} if k % 2 else {"ha": "right", "va": "top"}
        offset = (4, 4) if k % 2 else (-4, -4)
        text = str(columns.pick(row, plot["label"]))
        style = {"textcoords": "offset points", "fontweight": "bold", "zorder": 4}
        here.annotate(text, place(row), offset, **style, **aside)
    _scales(here, "xy")
    here.set(xlabel=columns.label(plot["x"]), ylabel=columns.label(plot["y"][0]))
    _guides(here, plot)
    keys = [Line2D([], [], color=INK, lw=1.3, label="Pareto front")]
    if plot["beside"]:
        keys.append(Line2D([], [], color=INK, ls="--", marker="*", label=plot["beside_name"]))
    keys.append(_heading(plot["by"]))
    keys += [_key(colour, "o", 6, str(name)) for name, colour in colours.items()]
    keys.append(_heading(columns.label(plot["mark"])))
    keys += [_key(MUTED, mark, 6, f"{name:g}") for name, mark in marks.items()]
    keys.append(_heading(columns.label(plot["size"])))
    keys += [_key(MUTED, "o", size, str(name)) for name, size in sizes.items()]
    here.legend(handles=keys, loc="upper left", bbox_to_anchor=(1.01, 1.0), labelspacing=0.45)
    return encode(figure)


def _styles(rows: list[list], columns: _Columns, name: str, styles: tuple) -> dict:
    """A colour or a mark for every value of a column, in order of appearance."""
    values = dict.fromkeys(columns.pick(row, name) for row in rows)
    return {value: styles[k % len(styles)] for k, value in enumerate(values)}


def _heading(text: str) -> Line2D:
    return Line2D([], [], ls="", label=f"$\\bf{{{text.replace(' ', chr(92) + ' ')}}}$")


def _key(colour: str, mark: str, size: float, text: str) -> Line2D:
    return Line2D([], [], color=colour, marker=mark, ls="", mew=0.0, ms=size, label=text)


@styled
def _bars(table: Any) -> str:
    plot, columns = table.plot, _Columns(table)
    rows = [row for row in table.rows if _is_number(columns.pick(row, plot["y"][0]))][::-1]
    figure, axes = canvas(8.0, 0.32 * len(rows) + 1.0)
    here = axes[0, 0]
    lengths = [columns.pick(row, plot["y"][0]) for row in rows]
    ratios = [length - 1.0 for length in lengths]
    here.barh(range(len(rows)), ratios, left=1.0, color=COLOURS[0], height=0.6)
    for k, length in enumerate(lengths):
        here.annotate(f"{length:.3g}", (length, k), (4, 0), textcoords="offset points", va="center")
    texts = [": ".join(str(columns.pick(row, name)) for name in plot["x"]) for row in rows]
    here.set_yticks(range(len(rows)), texts)
    here.grid(axis="y", visible=False)
    _scales(here, plot.get("log", ""))
    here.margins(x=0.12)
    here.set_xlabel(columns.label(plot["y"][0]))
    _guides(here, plot)
    return encode(figure)


def _scales(axes: Axes, log: str) -> None:
    """Set logarithmic axes, with plain numbers where they are short."""
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        if name not in log:
            continue
        (axes.set_xscale if name == "x" else axes.set_yscale)("log")
        low, high = axis.get_view_interval()
        axis.set_major_formatter(_number)
        if high < 30 * low:  # few powers of ten in between
            axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
            axis.set_minor_formatter(_number)
        else:
            axis.set_minor_formatter(NullFormatter())


def _number(value: float, _: int) -> str:
    if 1e-4 <= value < 1e6:
        return f"{value:g}"
    return f"$10^{{{round(math.log10(value))}}}$"


def _guides(axes: Axes, plot: dict) -> None:
    """Draw target values as lines labelled at their end."""
    style = {"color": "#c8502d", "lw": 0.9, "ls": (0, (4, 3)), "zorder": 1}
    for value, text in plot.get("targets", ()):
        axes.axhline(value, **style)
        axes.annotate(
            text, (1.0, value), (-3, 2), xycoords=("axes fraction", "data"),
            textcoords="offset points", ha="right", va="bottom", color=style["color"], fontsize=8,
        )  # fmt: skip
    for value, text in plot.get("limits", ()):
        axes.axvline(value, **style)
        axes.annotate(
            text, (value, 1.0), (3, -3), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="left", va="top", color=style["color"], fontsize=8,
        )  # fmt: skip


_KINDS: dict[str, Callable[[Any], str]] = {"lines": _lines, "front": _front, "bars": _bars}


def page(results: dict[str, list], about: dict[str, str]) -> str:
    """HTML of tables (runs.validation.tables.Table) by module name, with their ABOUT lines."""
    counted = {"tables": 0, "figures": 0}
    parts = [
        {"name": name, "about": about[name], "tables": [_shaped(t, counted) for t in tables]}
        for name, tables in results.items()
    ]
    return page_of("tables", f"{PROGRAM} {VERSION}", machine=machine(), parts=parts)


def machine() -> str:
    """The machine and the date of the measurement."""
    bytes_here = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    cores = len(os.sched_getaffinity(0))
    return (
        f"{_processor()}, {cores} core{'s' if cores > 1 else ''}, {bytes_here / 2**30:.0f} GB; "
        f"{platform.system()} {platform.release()}, Python {platform.python_version()}; "
        f"{time.strftime('%Y-%m-%d')}"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()


def _shaped(table: Any, counted: dict[str, int]) -> dict:
    """A table as the template needs it; numbers it and its figure."""
    image = drawn(table)
    counted["tables"] += 1
    counted["figures"] += image is not None
    words = [any(isinstance(row[k], str) for row in table.rows) for k in range(len(table.columns))]
    return {
        "title": table.title,
        "notes": table.remarks,
        "image": image,
        "number": counted["tables"],
        "figure": counted["figures"],
        "long": len(table.rows) > LONG,
        "columns": [
            (name, "" if unit == "-" else unit, word)
            for (name, unit), word in zip(table.columns, words, strict=True)
        ],
        "rows": [
            [(_shown(value), word) for value, word in zip(row, words, strict=True)]
            for row in table.rows
        ],
    }


def _shown(value: Any) -> str:
    """Three digits; powers of ten below a thousandth and from a million up."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return "" if value is None else str(value)
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
    mantissa, _, power = f"{value:.2e}".partition("e")
    if not power:
        return mantissa  # NaN or infinity
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.rstrip('0').rstrip('.')}·10{raised}"
