"""Gathers settings and results of all members of a sweep from their folders into one table."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.levels import nominal
from tireroad.contact.results.spectra import SILENT
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import replacing
from tireroad.runs.files.reader import RunResults
from tireroad.runs.files.store import sealed
from tireroad.runs.scene.derived import with_modal
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.search.journal import NAME, read_trials
from tireroad.runs.search.settings import applied
from tireroad.runs.sweep.definition import Sweep
from tireroad.runs.sweep.members import Member

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """A quantity of every member; NaN if a member has none."""

    name: str
    unit: str
    values: Array


@dataclass(frozen=True)
class Gathered:
    """The table: `settings` per axis and member, `columns` of results, members without (`missing`)."""

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
    keys = list(dict.fromkeys(key for row in rows for key in row))
    return Gathered(
        names=tuple(member.name for member in sweep.members),
        settings={key: tuple(m.settings.get(key) for m in sweep.members) for key in sweep.axes},
        columns=tuple(
            Column(name, unit, np.array([row.get((name, unit), np.nan) for row in rows]))
            for name, unit in keys
        ),
        missing=tuple(missing),
    )


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
    # Where the run has no spectra, a file of them is an earlier run's.
    skipped = run.summary.get("spectra", {}).get("status") == "skipped"
    if not skipped and "spectra/third_octave/level" in run:
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
            numbers = all(isinstance(v, int | float) for v in values)
            file[f"axis/{key}"] = np.array(values, float) if numbers else [str(v) for v in values]
        for number, column in enumerate(table.columns):
            data = file.create_dataset(f"result/{number:03d}", data=column.values)
            data.attrs["name"], data.attrs["unit"] = column.name, column.unit


def numeric(settings: Mapping[str, Sequence[Any]]) -> dict[str, Array]:
    """The axes whose values are numbers."""
    return {
        key: np.array(values, float)
        for key, values in settings.items()
        if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    }
