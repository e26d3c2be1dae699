"""sweep.html: the members of a sweep side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from numpy.typing import NDArray

from tireroad.runs.files.disk import write_text
from tireroad.runs.report.comparison_figures import pen
from tireroad.runs.report.figures import canvas, encode, styled
from tireroad.runs.report.quantities import quantity
from tireroad.runs.scene.resolved import literal
from tireroad.runs.sweep.gather import Column, Gathered, numeric
from tireroad.runs.sweep.levels import Levels, levels
from tireroad.runs.version import PROGRAM, VERSION

Array = NDArray[np.float64]
TOTAL = "spectra: level of the vertical force on the axle"  # over all lines, whatever the bands
SHOWN = (
    TOTAL,
    "static: deflection",
    "static: load",
    "contact: mean load",
    "rotating: lowest",
    "modes: lowest",
)
CURVES = 12  # third-octave spectra that can be distinguished in one figure


def write_page(table: Gathered, folder: Path, title: str, failed: Sequence[str]) -> Path:
    """Write folder/sweep.html; returns its path."""
    loader = FileSystemLoader(Path(__file__).parent)
    pages = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    pages.filters["quantity"] = quantity
    pages.filters["setting"] = _setting
    path = folder / "sweep.html"
    text = pages.get_template("sweep.html.j2").render(
        title=title,
        program=f"{PROGRAM} {VERSION}",
        table=table,
        columns=[column for column in table.columns if "Hz" not in column.name],
        figures=_figures(table),
        failed=failed,
    )
    write_text(path, text)
    return path


def _setting(value: object) -> str:
    """A setting as in a scene, texts without quotes; "–" where the member has none."""
    return "–" if value is None else value if isinstance(value, str) else literal(value)


def _figures(table: Gathered) -> list[tuple[str, str]]:
    axes = numeric(table.settings)
    found = []
    bands = [c for c in table.columns if c.name.startswith("axle force z")]
    if bands:
        text = "Third octaves of the vertical axle force."
        if len(table.names) > CURVES:
            text += f" The first {CURVES} of {len(table.names)} members."
        found.append((_spectra(bands, table.names), text))
    compared = levels(table)
    if compared is not None and len(compared.with_bands) > 1:
        found.append((_differences(compared), _about(compared)))
    chosen = _chosen(table)
    for key, values in axes.items():
        if chosen and len(set(values[np.isfinite(values)].tolist())) > 1:
            found.append((_against(key, values, chosen), f"Results over {key}."))
    if len(axes) == 2:
        for column in chosen[:2]:
            (first, a), (second, b) = axes.items()
            found.append((_map(first, a, second, b, column), f"{column.name} over both axes."))
    return found


def _chosen(table: Gathered) -> list[Column]:
    """The columns that are drawn over the axes, in the order of `SHOWN`: those that vary."""
    finite = {c.name: c.values[np.isfinite(c.values)] for c in table.columns if c.name in SHOWN}
    vary = {name for name, values in finite.items() if len(values) > 1 and np.ptp(values) > 0}
    columns = [c for c in table.columns if c.name in vary]
    return sorted(columns, key=lambda c: SHOWN.index(c.name))


@styled
def _spectra(bands: Sequence[Column], names: Sequence[str]) -> str:
    figure, axes = canvas(9.5, 3.6)
    place = np.arange(len(bands))
    for number, name in enumerate(names[:CURVES]):
        levels = [column.values[number] for column in bands]
        if np.isfinite(levels).any():
            axes[0, 0].plot(place, levels, marker="o", ms=3, label=name, **pen(number))
    axes[0, 0].set(ylabel="dB re 1 N, rms", xlabel="third-octave band")
    axes[0, 0].set_xticks(place, [c.name.partition(", ")[2] for c in bands], rotation=45)
    axes[0, 0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=7)
    return encode(figure)


@styled
def _differences(compared: Levels) -> str:
    """Differences in dB from the first that has bands, with error bars."""
    figure, axes = canvas(9.5, 3.2)
    level, error = compared.differences()
    place = np.arange(len(compared.bands))
    first, *others = compared.with_bands[:CURVES]
    for order, number in enumerate(others, start=1):
        there = np.isfinite(level[number])
        axes[0, 0].errorbar(
            (place + 0.3 * (order / (len(others) + 1) - 0.5))[there],
            level[number, there],
            np.nan_to_num(error[number, there]),
            marker="o",
            ms=3,
            capsize=2,
            label=compared.names[number],
            **pen(number),
        )
    axes[0, 0].axhline(0.0, color="#52606d", lw=0.8)
    axes[0, 0].set(ylabel=f"dB of {compared.names[first]}", xlabel="third-octave band")
    axes[0, 0].set_xticks(place, compared.bands, rotation=45)
    axes[0, 0].legend(ncols=3, loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=7)
    return encode(figure)


def _about(compared: Levels) -> str:
    """Caption of the figure of differences."""
    text = (
        "Vertical axle force, difference from the first that has bands, "
        f"{compared.names[compared.with_bands[0]]}, in dB, with what the runs' error bars tell of it; "
        "where there is no bar nothing is known."
    )
    least, most = (f([compared.seeds[k] for k in compared.with_bands]) for f in (min, max))
    if most > 1:
        number = f"{most}" if least == most else f"{least} to {most}"
        text += (
            f" Mean power over {number} seeds; the bars hold the true mean of all seeds in 95 of "
            "100 cases."
        )
    return text


@styled
def _against(key: str, values: Array, columns: Sequence[Column]) -> str:
    """Every chosen result over one axis, in separate panels."""
    count = max(min(len(columns), 4), 1)
    figure, axes = canvas(9.5, 2.0 * count + 0.4, count, sharex=True)
    order = np.argsort(values, kind="stable")
    for here, column in zip(axes[:, 0], columns, strict=False):
        there = order[np.isfinite(values[order]) & np.isfinite(column.values[order])]
        here.plot(values[there], column.values[there], "o-", ms=4, lw=0.8, color="#0072b2")
        here.set(title=column.name, ylabel=column.unit)
    axes[-1, 0].set_xlabel(key)
    return encode(figure)


@styled
def _map(first: str, a: Array, second: str, b: Array, column: Column) -> str:
    """A result over two axes, coloured at the grid's points."""
    figure, axes = canvas(6.5, 4.2)
    there = np.isfinite(a) & np.isfinite(b) & np.isfinite(column.values)
    shown = {"c": column.values[there], "s": 320, "marker": "s", "cmap": "cividis"}
    drawn = axes[0, 0].scatter(a[there], b[there], **shown)
    axes[0, 0].set(xlabel=first, ylabel=second)
    axes[0, 0].margins(0.15)
    figure.colorbar(drawn, ax=axes, label=f"{column.name}, {column.unit}")
    return encode(figure)
