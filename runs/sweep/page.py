"""sweep.html: the members of a sweep side by side, with their third octaves and the errors of these.

Levels are also given in dB relative to the first member that has any. Members that differ only in a seed are samples of one
road: their powers are averaged as those of the stretches of one run are (contact.results.chance), with bounds by the number of
their lines and by the spread of the members. The numerical errors of the runs (contact.results.error_bars) are added as
squares; they are independent of the chance, and of those of other members.
"""

from __future__ import annotations

import csv
import re
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from tireroad.contact.results import chance
from tireroad.contact.results.spectra import confidence
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import replacing, write_text
from tireroad.runs.files.store import sealed
from tireroad.runs.files.trials import NAME, read_trials
from tireroad.runs.report.compare import BandMarks, legend_above, marks, marks_told, pen
from tireroad.runs.report.figures import Drawing, canvas, drawing, encode, styled
from tireroad.runs.report.kit import page_of
from tireroad.runs.report.levels import band_levels, is_drawn, rank
from tireroad.runs.report.read import shown_unit
from tireroad.runs.results.reader import RunResults
from tireroad.runs.scene.choices import with_modal
from tireroad.runs.scene.resolved import dumps, literal
from tireroad.runs.scene.schema import parts
from tireroad.runs.search.settings import applied
from tireroad.runs.sweep.definition import Member, Sweep

Array = NDArray[np.float64]
ERROR, FREEDOM = "error of the ", "degrees of freedom of the "
TOTAL = "spectra: level of the vertical force on the axle"  # over all lines, whatever the bands
SHOWN = (
    TOTAL,
    "static: deflection",
    "static: load",
    "contact: mean load",
    "sound: A-weighted CPX level",
    "sound: A-weighted OBSI level",
    "sound: A-weighted sound power level",
    "rotating: lowest frequency",
    "modes: lowest mode",
)
_VARIES = 1e-6  # relative
WIDE = 9.5  # inches
_OF_GROUP: dict[str, tuple[int, ...]] = {"level": (), "error": (), "chance": (2,), "spread": (2,)}
CURVES = 12  # third-octave spectra that can be distinguished in one figure


@dataclass(frozen=True)
class SweepColumn:
    """A quantity of every member; NaN if a member has none."""

    name: str
    unit: str
    values: Array


@dataclass(frozen=True)
class Gathered:
    """The table: `settings` per axis and member, `columns` of results, members without (`missing`).

    A setting is None where the member's scene has no value; third octaves are in ascending order.
    """

    names: tuple[str, ...]
    settings: Mapping[str, tuple[Any, ...]]
    columns: tuple[SweepColumn, ...]
    missing: tuple[str, ...]


def gather(sweep: Sweep, folder: Path) -> Gathered:
    """Gather the results of finished members in folder/members.

    A folder may hold the results of an earlier scene of the same name: they are not those of the
    member.
    """
    rows: list[dict[tuple[str, str], float]] = []
    missing = []
    for member in sweep.members:
        try:
            run = RunResults(folder / "members" / member.name)
            rows.append(_figures(run) if run.finished(_scenes(sweep, member, run)) else {})
        except (InputError, KeyError, ValueError):
            rows.append({})
        if not rows[-1]:
            missing.append(member.name)
    keys = sorted(dict.fromkeys(key for row in rows for key in row), key=_place)
    settings = [_settings(sweep, member) for member in sweep.members]
    return Gathered(
        names=tuple(member.name for member in sweep.members),
        settings={key: tuple(setting[key] for setting in settings) for key in sweep.axes},
        columns=tuple(
            SweepColumn(name, unit, np.array([row.get((name, unit), np.nan) for row in rows]))
            for name, unit in keys
        ),
        missing=tuple(missing),
    )


def _place(key: tuple[str, str]) -> tuple[int, tuple[int, str], float]:
    """Sorts headline numbers before levels before errors, and both of these by quantity and band.

    Members may have different bands: their first appearance is in no order.
    """
    what, band = _banded(key[0])
    if band is None:
        return 0, (0, ""), 0.0
    kind = next((k for k, mark in enumerate((ERROR, FREEDOM), 1) if what.startswith(mark)), 0)
    return 1 + kind, rank(what.removeprefix(ERROR).removeprefix(FREEDOM)), band


def _banded(name: str) -> tuple[str, float | None]:
    """The quantity and the band (Hz) of a third octave; None as the band of any other figure."""
    match = re.fullmatch(r"([^:]+), ([\d.e+]+) Hz", name)
    return (match[1], float(match[2])) if match else (name, None)


def _settings(sweep: Sweep, member: Member) -> dict[str, Any]:
    """The member's value of every axis; where it sets none, that of its resolved scene."""
    settings = dict(member.settings)
    if len(settings) < len(sweep.axes):
        scene = tomllib.loads(dumps(sweep.load(member)))
        settings = {key: _value(scene, parts(key)) for key in sweep.axes} | settings
    return settings


def _value(scene: Any, path: Sequence[str]) -> Any:
    """The value of a key; None if the scene has none."""
    for part in path:
        try:
            scene = scene[int(part) if isinstance(scene, list) else part]
        except (LookupError, TypeError, ValueError):
            return None
    return scene


def _scenes(sweep: Sweep, member: Member, run: RunResults) -> list[str]:
    """The resolved scenes that a run of the member leaves: its own, and those a search tries."""
    scene = sweep.load(member)
    scenes = [dumps(scene)]
    if scene.accuracy.searches:
        with suppress(OSError):
            for trial in read_trials(run.directory / NAME):
                scenes.append(dumps(with_modal(applied(scene, trial.settings), None)))
    return scenes


def _figures(run: RunResults) -> dict[tuple[str, str], float]:
    """Headline numbers of all stages, third-octave levels and their errors, by (name, unit)."""
    figures: dict[tuple[str, str], float] = {}
    for stage, entries in run.summary.items():
        for name, entry in (entries.get("headline") or {}).items():
            value = entry.get("value")
            if isinstance(value, int | float) and not isinstance(value, bool):
                figures[f"{stage}: {name}", entry.get("unit", "-")] = float(value)
    for level in band_levels(run):
        every = level.band, level.level, level.error, level.freedom
        for band, value, error, freedom in zip(*every, strict=True):
            if np.isfinite(value):
                figures[f"{level.name}, {band:g} Hz", level.unit] = float(value)
            if np.isfinite(error):
                figures[f"{ERROR}{level.name}, {band:g} Hz", "dB"] = float(error)
            if np.isfinite(freedom):
                figures[f"{FREEDOM}{level.name}, {band:g} Hz", "-"] = float(freedom)
    return figures


def write(table: Gathered, folder: Path) -> None:
    """Write folder/sweep.csv and folder/sweep.h5."""
    with (
        replacing(folder / "sweep.csv") as part,
        part.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["member", *table.settings, *(f"{c.name} ({c.unit})" for c in table.columns)]
        )
        for k, name in enumerate(table.names):
            given = [values[k] for values in table.settings.values()]
            shown = ["" if np.isnan(c.values[k]) else c.values[k] for c in table.columns]
            writer.writerow([name, *given, *shown])
    with replacing(folder / "sweep.h5") as part, sealed(part) as file:
        file["member"] = list(table.names)
        for key, values in table.settings.items():
            texts = ["" if v is None else str(v) for v in values]
            file[f"axis/{key}"] = np.array(values, float) if _numbers(values) else texts
        for number, column in enumerate(table.columns):
            data = file.create_dataset(f"result/{number:03d}", data=column.values)
            data.attrs["name"], data.attrs["unit"] = column.name, column.unit


def numeric(settings: Mapping[str, Sequence[Any]]) -> dict[str, Array]:
    """The axes whose values are numbers; NaN where a member has none."""
    return {
        key: np.array(values, float)
        for key, values in settings.items()
        if _numbers(values) and not any(isinstance(v, bool) for v in values)
    }


def _numbers(values: Sequence[Any]) -> bool:
    numbers = [v for v in values if v is not None]
    return bool(numbers) and all(isinstance(v, int | float) for v in numbers)


@dataclass(frozen=True)
class Levels:
    """Levels of a `quantity` of groups of members that differ in seeds only.

    `names`; number of `seeds` that have a level in any band; `level` (g, b) dB in the `unit`, its numerical `error` (g, b) dB,
    and its bounds by chance (g, b, 2) dB, by the number of lines (`chance`) and by the spread of the seeds (`spread`), at the
    `bands`; NaN where nothing is known.
    """

    quantity: str
    unit: str
    names: tuple[str, ...]
    seeds: tuple[int, ...]
    bands: tuple[str, ...]
    level: Array
    error: Array
    chance: Array
    spread: Array

    @property
    def with_bands(self) -> tuple[int, ...]:
        """The groups that have a level in any band."""
        return tuple(np.flatnonzero(np.isfinite(self.level).any(axis=1)).tolist())

    def differences(self) -> tuple[Array, Array, Array]:
        """Differences (g, b) dB from the first group that has bands, their numerical errors (g, b), and their bounds
        (g, b, 2) by the spread of the seeds."""
        first = self.with_bands[0]
        both = np.sqrt(self.error**2 + self.error[first] ** 2)
        across = np.hypot(self.spread, self.spread[first, :, ::-1]) * [-1.0, 1.0]
        return self.level - self.level[first], both, across


def levels(table: Gathered, quantity: str) -> Levels | None:
    """Third octaves of a quantity (runs.report.levels); None if no member has a finite one."""
    columns = {column.name: column for column in table.columns}
    own = [column for name, column in columns.items() if _banded(name)[0] == quantity]
    level = np.array([column.values for column in own]).T
    if not np.isfinite(level).any():
        return None
    nothing = SweepColumn("", "", np.full(len(level), np.nan))
    error, freedom = (
        np.stack([columns.get(mark + c.name, nothing).values for c in own], axis=1)
        for mark in (ERROR, FREEDOM)
    )
    groups = _alike(table)
    pooled = [_pooled(level[each], error[each], freedom[each]) for each in groups.values()]
    return Levels(
        quantity=quantity,
        unit=own[0].unit,
        names=tuple(groups),
        seeds=tuple(
            int(np.isfinite(level[members]).any(axis=1).sum()) for members in groups.values()
        ),
        bands=tuple(f"{_banded(column.name)[1]:g} Hz" for column in own),
        **{name: np.array([band[name] for band in pooled]) for name in pooled[0]},
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


def _pooled(level: Array, error: Array, freedom: Array) -> dict[str, Array]:
    """Fields for n members (n, b) that are samples of one road: those of `Levels` of their group.

    A numerical error is that of the mean of independent ones.
    """
    bands = level.shape[1]
    pooled = {name: np.full((bands, *more), np.nan) for name, more in _OF_GROUP.items()}
    for band in range(bands):
        there = np.isfinite(level[:, band])
        if not there.any():
            continue
        levels, own, degrees = level[there, band], error[there, band], freedom[there, band]
        pooled["level"][band] = chance.pooled(levels[:, None])[0]
        known = own[np.isfinite(own)]
        if len(known):
            pooled["error"][band] = np.sqrt((known**2).sum()) / len(levels)
        pooled["chance"][band] = confidence(degrees.sum())
        one = np.ones(1)
        pooled["spread"][band] = chance.spread(levels[:, None], one, len(levels) * one)[0]
    return pooled


def write_page(table: Gathered, folder: Path, title: str, failed: Sequence[str]) -> Path:
    """Write folder/sweep.html; returns its path."""
    path = folder / "sweep.html"
    text = page_of(
        "sweep",
        title,
        filters={"setting": _setting},
        table=table,
        columns=[column for column in table.columns if _banded(column.name)[1] is None],
        figures=_page_figures(table),
        failed=failed,
    )
    write_text(path, text)
    return path


def _setting(value: object) -> str:
    """A setting as in a scene, texts without quotes; "–" where the member has none."""
    return "–" if value is None else value if isinstance(value, str) else literal(value)


def _page_figures(table: Gathered) -> list[Drawing]:
    axes = numeric(table.settings)
    figures = []
    quantities = dict.fromkeys(_banded(column.name)[0] for column in table.columns)
    for what in filter(is_drawn, quantities):
        figures += _of_bands(table, what)
    chosen = _chosen(table)
    for key, values in axes.items():
        if chosen and len(set(values[np.isfinite(values)].tolist())) > 1:
            text = f"Results over {key}; lines join members that are equal in all other keys."
            lines = _lines(table, key, values)
            figures.append(drawing(partial(_against, key, values, lines, chosen), text, WIDE))
    if len(axes) == 2:
        (first, a), (second, b) = axes.items()
        for column in chosen[:2]:
            text = f"{column.name} over both axes."
            figures.append(drawing(partial(_map, first, a, second, b, column), text, WIDE))
    return figures


def _of_bands(table: Gathered, what: str) -> list[Drawing]:
    """Third octaves of a quantity in all members, and their differences from the first with any."""
    bands = [column for column in table.columns if _banded(column.name)[0] == what]
    text = f"Third octaves: {what}."
    if len(table.names) > CURVES:
        text += f" The first {CURVES} of {len(table.names)} members."
    figures = [drawing(partial(_spectra, bands, table.names), text, WIDE)]
    compared = levels(table, what)
    if compared is not None and max(compared.seeds) > 1:
        text = (
            f"Third octaves: {what}, mean power over all seeds. Thin lines: its chance, 95 %, by the spread of the "
            f"seeds.{marks_told([BandMarks(compared.level, compared.error, compared.chance)])}"
        )
        figures.append(drawing(partial(_of_seeds, compared), text, WIDE))
    if compared is not None and len(compared.with_bands) > 1:
        figures.append(drawing(partial(_differences, compared), _about(compared), WIDE))
    return figures


def _lines(table: Gathered, key: str, values: Array) -> list[list[int]]:
    """Members that are equal in all keys but one, in ascending order of its values."""
    others: dict[str, list[int]] = {}
    for k in np.argsort(values, kind="stable").tolist():
        if np.isfinite(values[k]):
            rest = repr([setting[k] for name, setting in table.settings.items() if name != key])
            others.setdefault(rest, []).append(k)
    return list(others.values())


def _chosen(table: Gathered) -> list[SweepColumn]:
    """The columns that are drawn over the axes, in the order of `SHOWN`: those that vary."""
    finite = {c.name: c.values[np.isfinite(c.values)] for c in table.columns if c.name in SHOWN}
    # A load that is given comes out equal but for rounding.
    vary = {
        name
        for name, values in finite.items()
        if len(values) > 1 and np.ptp(values) > _VARIES * np.abs(values).max()
    }
    columns = [c for c in table.columns if c.name in vary]
    return sorted(columns, key=lambda c: SHOWN.index(c.name))


@styled
def _spectra(bands: Sequence[SweepColumn], names: Sequence[str], width: float) -> str:
    figure, axes = canvas(width, 3.6)
    place = np.arange(len(bands))
    shown = [k for k in range(min(CURVES, len(names))) if _any(bands, k)]
    for number in shown:
        level = [column.values[number] for column in bands]
        axes[0, 0].plot(place, level, marker="o", ms=3, label=names[number], **pen(number))
    axes[0, 0].set(ylabel=f"{shown_unit(bands[0].unit)}, rms", xlabel="third-octave band in Hz")
    _ticks(axes[0, 0], [_banded(column.name)[1] for column in bands])
    legend_above(axes[0, 0], [names[number] for number in shown], width)
    return encode(figure)


def _any(bands: Sequence[SweepColumn], member: int) -> bool:
    return bool(np.isfinite([column.values[member] for column in bands]).any())


def _ticks(axes: Axes, bands: Sequence[float | None]) -> None:
    axes.set_xticks(np.arange(len(bands)), [f"{band:g}" for band in bands], rotation=45)


@styled
def _of_seeds(pooled: Levels, width: float) -> str:
    """Levels over all seeds, with bars for numerical errors, boxes for the chance by lines and thin lines for that by the spread."""
    figure, axes = canvas(width, 3.6)
    place, shown = np.arange(len(pooled.bands), dtype=float), pooled.with_bands[:CURVES]
    for order, group in enumerate(shown):
        level, error, sure = (part[group] for part in (pooled.level, pooled.error, pooled.chance))
        here = place + 0.6 * ((order + 0.5) / len(shown) - 0.5)
        drawn = {"label": pooled.names[group], **pen(group)}
        marks(axes[0, 0], here, BandMarks(level, error, sure), **drawn)
        _spans(axes[0, 0], here, level[:, None] + pooled.spread[group], pen(group)["color"])
    axes[0, 0].set(ylabel=f"{shown_unit(pooled.unit)}, rms", xlabel="third-octave band in Hz")
    _ticks(axes[0, 0], [float(band.removesuffix(" Hz")) for band in pooled.bands])
    legend_above(axes[0, 0], [pooled.names[group] for group in shown], width)
    return encode(figure)


def _spans(axes: Axes, place: Array, ends: Array, colour: str) -> None:
    """Thin lines at places (b,) between ends (b, 2), where these are known."""
    known = np.isfinite(ends).all(axis=1)
    axes.vlines(place[known], *ends[known].T, color=colour, lw=0.6)


@styled
def _differences(compared: Levels, width: float) -> str:
    """Differences in dB from the first that has bands, with bars for numerical errors and thin lines for the chance."""
    figure, axes = canvas(width, 3.2)
    level, error, across = compared.differences()
    place = np.arange(len(compared.bands))
    _, *others = compared.with_bands[:CURVES]
    for order, number in enumerate(others, start=1):
        there = np.isfinite(level[number])
        here = (place + 0.3 * (order / (len(others) + 1) - 0.5))[there]
        ends = (level[number, :, None] + across[number])[there]
        _spans(axes[0, 0], here, ends, pen(number)["color"])
        axes[0, 0].errorbar(
            here,
            level[number, there],
            np.nan_to_num(error[number, there]),
            marker="o",
            ms=3,
            capsize=2,
            label=compared.names[number],
            **pen(number),
        )
    axes[0, 0].axhline(0.0, color="#52606d", lw=0.8)
    axes[0, 0].set(ylabel="difference in dB", xlabel="third-octave band in Hz")
    _ticks(axes[0, 0], [float(band.removesuffix(" Hz")) for band in compared.bands])
    legend_above(axes[0, 0], [compared.names[number] for number in others], width)
    return encode(figure)


def _about(compared: Levels) -> str:
    """Caption of the figure of differences."""
    text = (
        f"Third octaves: {compared.quantity}, difference from the first that has bands, "
        f"{compared.names[compared.with_bands[0]]}, in dB, with bars for the runs' numerical errors; "
        "where there is no bar nothing is known."
    )
    least, most = (f([compared.seeds[k] for k in compared.with_bands]) for f in (min, max))
    if most > 1:
        number = f"{most}" if least == most else f"{least} to {most}"
        text += f" Mean power over {number} seeds; thin lines: chance of the seeds, 95 %, as if the two had different ones."
    return text


@styled
def _against(
    key: str,
    values: Array,
    lines: Sequence[Sequence[int]],
    columns: Sequence[SweepColumn],
    width: float,
) -> str:
    """Every chosen result over one axis, in separate panels; `lines` join members."""
    count = max(min(len(columns), 4), 1)
    figure, axes = canvas(width, 2.0 * count + 0.4, count, sharex=True)
    for here, column in zip(axes[:, 0], columns, strict=False):
        for number, members in enumerate(lines):
            there = [k for k in members if np.isfinite(column.values[k])]
            joined = "-" if len(there) > 1 else ""
            colour = pen(number)["color"]
            place = values[there], column.values[there]
            here.plot(*place, marker="o", ls=joined, ms=4, lw=0.8, color=colour)
        here.set(title=column.name, ylabel=shown_unit(column.unit))
    axes[-1, 0].set_xlabel(key)
    return encode(figure)


@styled
def _map(first: str, a: Array, second: str, b: Array, column: SweepColumn, width: float) -> str:
    """A result over two axes, coloured at the grid's points."""
    figure, axes = canvas(min(width, 6.5), 4.2)
    there = np.isfinite(a) & np.isfinite(b) & np.isfinite(column.values)
    shown = {"c": column.values[there], "s": 320, "marker": "s", "cmap": "cividis"}
    drawn = axes[0, 0].scatter(a[there], b[there], **shown)
    axes[0, 0].set(xlabel=first, ylabel=second)
    axes[0, 0].margins(0.15)
    figure.colorbar(drawn, ax=axes, label=f"{column.name}, {shown_unit(column.unit)}")
    return encode(figure)
