"""Gathers settings and results of all members of a sweep from their folders into one table."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import SILENT, nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import replacing
from tireroad.runs.files.reader import RunResults
from tireroad.runs.files.store import sealed
from tireroad.runs.scene.load import with_modal
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.source import parts
from tireroad.runs.search.journal import NAME, read_trials
from tireroad.runs.search.settings import applied
from tireroad.runs.sweep.definition import Member, Sweep

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
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
    columns: tuple[Column, ...]
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
        settings={key: tuple(one[key] for one in settings) for key in sweep.axes},
        columns=tuple(
            Column(name, unit, np.array([row.get((name, unit), np.nan) for row in rows]))
            for name, unit in keys
        ),
        missing=tuple(missing),
    )


def _place(key: tuple[str, str]) -> tuple[int, float]:
    """Sorts headline numbers before levels before errors, and both of these by their band.

    Members may have different bands: their first appearance is in no order.
    """
    what, _, band = key[0].rpartition(", ")
    for order, kind in enumerate(("axle force ", "error of the axle force "), start=1):
        if what.startswith(kind):
            return order, float(band.removesuffix(" Hz"))
    return 0, 0.0


def _settings(sweep: Sweep, member: Member) -> dict[str, Any]:
    """The member's value of every axis; where it sets none, that of its resolved scene."""
    found = dict(member.settings)
    if len(found) < len(sweep.axes):
        scene = tomllib.loads(dumps(sweep.load(member)))
        found = {key: _value(scene, parts(key)) for key in sweep.axes} | found
    return found


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
    found = [dumps(scene)]
    if scene.accuracy.searches:
        with suppress(OSError):
            for trial in read_trials(run.directory / NAME):
                found.append(dumps(with_modal(applied(scene, trial.settings), None)))
    return found


def _figures(run: RunResults) -> dict[tuple[str, str], float]:
    """Headline numbers of all stages, third-octave levels and their errors, by (name, unit)."""
    found: dict[tuple[str, str], float] = {}
    for stage, entries in run.summary.items():
        for name, entry in (entries.get("headline") or {}).items():
            value = entry.get("value")
            if isinstance(value, int | float) and not isinstance(value, bool):
                found[f"{stage}: {name}", entry.get("unit", "-")] = float(value)
    if "spectra/third_octave/level" in run:
        centres = nominal(run["spectra/third_octave/centre"])
        level = run["spectra/third_octave/level"]
        for centre, parts in zip(centres, level, strict=True):
            for axis, value in zip("xyz", parts, strict=True):
                if value > SILENT:
                    found[f"axle force {axis}, {centre:g} Hz", "dB re 1 N"] = float(value)
        if "spectra/third_octave/level_error" in run:
            errors = run["spectra/third_octave/level_error"]
            for centre, parts in zip(centres, errors, strict=True):
                for axis, value in zip("xyz", parts, strict=True):
                    found[f"error of the axle force {axis}, {centre:g} Hz", "dB"] = float(value)
    return found


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
    given = [v for v in values if v is not None]
    return bool(given) and all(isinstance(v, int | float) for v in given)
