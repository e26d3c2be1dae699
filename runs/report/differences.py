"""Differences between runs in scene, figures, levels, modes and cost, as rows of one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tireroad.contact.results.spectra import SILENT, nominal
from tireroad.runs.files.reader import RunResults

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
LEVELS = (
    ("axle force", "spectra/third_octave/level", "dB re 1 N"),
    ("contact force", "spectra/third_octave/contact_level", "dB re 1 N"),
    ("moment on the hub", "spectra/third_octave/hub_moment_level", "dB re 1 N m"),
    ("radiated power", "vibration/third_octave/radiated_power_level", "dB re 1 pW"),
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
        centre = path.rpartition("/")[0] + "/centre"
        if path in run and centre in run and len(run[centre]):
            level = run[path].reshape(len(run[centre]), -1)  # some have components
            for band, parts in zip(nominal(run[centre]), level, strict=True):
                heard = ((axis, float(v)) for axis, v in enumerate(parts) if v > SILENT)
                own |= {(axis, float(band)): v for axis, v in heard}
        found.append(own)
    keys = sorted({key for own in found for key in own})
    several = any(axis for axis, _ in keys)
    return [
        Row(
            f"{quantity} {AXES[axis]}" if several else quantity,
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
