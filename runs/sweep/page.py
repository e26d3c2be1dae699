"""Third octaves of a sweep's members in dB relative to the first with any, with their uncertainty.

Members that differ only in a seed are samples of one road: their powers are averaged, and the mean
power lies within t s / sqrt(n) of that of all roads in 95 of 100 cases (Student's t with n - 1
degrees of freedom, s the standard deviation over the n seeds). The error bars of the runs
(contact.results.error_bars) are added as squares; both are independent of each other and of those
of other members.

sweep.html: the members of a sweep side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from numpy.typing import NDArray
from scipy import stats

from tireroad.runs.files.disk import write_text
from tireroad.runs.report.compare import pen
from tireroad.runs.report.figures import canvas, encode, styled
from tireroad.runs.report.read import quantity
from tireroad.runs.scene.resolved import literal
from tireroad.runs.sweep.gather import Column, Gathered, numeric
from tireroad.runs.version import PROGRAM, VERSION

Array = NDArray[np.float64]
LEVEL, ERROR = "axle force z, ", "error of the axle force z, "
_SURE = 0.95


@dataclass(frozen=True)
class Levels:
    """Levels of groups of members that differ in seeds only.

    `names`; number of `seeds` that have a level in any band; `level` (g, b) dB re 1 N and its `error` (g, b) dB at the `bands`,
    NaN where nothing is known.
    """

    names: tuple[str, ...]
    seeds: tuple[int, ...]
    bands: tuple[str, ...]
    level: Array
    error: Array

    @property
    def with_bands(self) -> tuple[int, ...]:
        """The groups that have a level in any band."""
        return tuple(np.flatnonzero(np.isfinite(self.level).any(axis=1)).tolist())

    def differences(self) -> tuple[Array, Array]:
        """Differences (g, b) dB from the first group that has bands, and their errors."""
        first = self.with_bands[0]
        both = np.sqrt(self.error**2 + self.error[first] ** 2)
        return self.level - self.level[first], both


def levels(table: Gathered) -> Levels | None:
    """Levels of the vertical axle force; None if no member has a finite one."""
    columns = {column.name: column.values for column in table.columns}
    bands = tuple(
        name.removeprefix(LEVEL) for name in columns if name.startswith(LEVEL) and "Hz" in name
    )
    level = np.array([columns[LEVEL + band] for band in bands]).T
    if not np.isfinite(level).any():
        return None
    nothing = np.full(len(level), np.nan)
    error = np.stack([columns.get(ERROR + band, nothing) for band in bands], axis=1)
    groups = _alike(table)
    found = [_mean(level[members], error[members]) for members in groups.values()]
    return Levels(
        names=tuple(groups),
        seeds=tuple(
            int(np.isfinite(level[members]).any(axis=1).sum()) for members in groups.values()
        ),
        bands=bands,
        level=np.array([one for one, _ in found]),
        error=np.array([off for _, off in found]),
    )


def _alike(table: Gathered) -> dict[str, list[int]]:
    """Members grouped by their settings other than seeds; one group each if no axis is a seed."""
    seeds = [key for key in table.settings if key.rpartition(".")[2] == "seed"]
    if not seeds:
        return {name: [k] for k, name in enumerate(table.names)}
    groups: dict[str, list[int]] = {}
    for k in range(len(table.names)):
        rest = [
            f"{key} = {values[k]}" for key, values in table.settings.items() if key not in seeds
        ]
        groups.setdefault(", ".join(rest) or "all", []).append(k)
    return groups


def _mean(level: Array, error: Array) -> tuple[Array, Array]:
    """Level of the mean power (b,) of n members (n, b), and its error, dB."""
    power = 10 ** (level / 10)
    count = np.isfinite(power).sum(axis=0)
    known = np.where(count > 0, count, 1)
    mean = np.where(count > 0, np.nansum(power, axis=0) / known, np.nan)
    squares = np.nansum((power - mean) ** 2, axis=0)
    more = np.maximum(count - 1, 1)
    width = stats.t.ppf((1 + _SURE) / 2, more) * np.sqrt(squares / more / known)
    spread = np.where(count > 1, 10 * np.log10(1 + width / mean), 0.0)
    own = np.sqrt(np.nansum(np.where(np.isfinite(error), error, 0.0) ** 2, axis=0) / known)
    unknown = ~np.isfinite(error).any(axis=0)
    total = np.sqrt(spread**2 + own**2)
    return 10 * np.log10(mean), np.where(unknown & (count < 2), np.nan, total)


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
