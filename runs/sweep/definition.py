"""Definition of a sweep file: a base scene, axes, and how their values form members.

  name = "speeds"
  scene = "passenger.toml"          # relative to the sweep file
  plan = "grid"                     # grid | list | latin-hypercube

  [[axis]]
  key = "rotation.speed"
  values = [20.0, 40.0, 60.0]       # grid: every combination of all axes
  # range = [20.0, 60.0]            # latin-hypercube, or grid with count = 5

  [[member]]                        # plan = "list": the members one by one
  name = "soft"
  set = { "tire.material.youngs_modulus" = 30e6 }

`samples` and `seed` belong to the latin hypercube. [slurm] holds options of sbatch (account,
partition, time); [queue] names the template and the commands of another batch system
(runs.sweep.queue).
"""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.walk import walk

PLANS = ("grid", "list", "latin-hypercube")
MOST = 10_000
_KEYS = {
    "name",
    "scene",
    "plan",
    "axis",
    "member",
    "samples",
    "seed",
    "slurm",
    "queue",
    "processes",
}
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}")


@dataclass(frozen=True)
class Member:
    """One run: the name of its folder, and its settings on top of the base scene, key by key."""

    name: str
    settings: Mapping[str, Any]

    def overrides(self) -> list[str]:
        """The settings as arguments of --set; the scene takes the member's name."""
        given = [f"{key}={literal(value)}" for key, value in self.settings.items()]
        return [*given, f"name={literal(self.name)}"]


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A sweep as read: `axes` are the keys that vary, in file order; `folder` is the file's."""

    name: str
    scene: Path
    axes: tuple[str, ...]
    members: tuple[Member, ...]
    processes: int = 1
    slurm: Mapping[str, Any] = field(default_factory=dict)
    queue: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path(".")

    def load(self, member: Member) -> Scene:
        """The member's scene, checked. An InputError names the member."""
        try:
            return load(self.scene, member.overrides())
        except InputError as error:
            raise InputError(f"sweep member {member.name}: {error}") from None


def read(path: Path) -> Sweep:
    """Read and check a sweep file. Raises InputError for any problem, including members' scenes."""
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    unknown = sorted(set(raw) - _KEYS)
    if unknown:
        raise InputError(
            f"{path}: unknown key {unknown[0]}; known here: {', '.join(sorted(_KEYS))}"
        )
    name = str(raw.get("name", path.stem))
    if not _NAME.fullmatch(name):
        raise InputError(f"{path}: name must be letters, digits, '.', '_', '-', not {name!r}")
    scene = path.parent / str(raw.get("scene", ""))
    if not scene.is_file():
        raise InputError(f"{path}: scene = {raw.get('scene')!r} names no file: {scene}")
    axes, members = _planned(path, raw)
    sweep = Sweep(
        name=name,
        scene=scene,
        axes=axes,
        members=tuple(Member(m.name, _absolute(m.settings, path.parent)) for m in members),
        processes=_whole(path, raw, "processes", 1, 1, 9999),
        slurm=_table(path, raw, "slurm"),
        queue=_table(path, raw, "queue"),
        folder=path.parent,
    )
    for member in sweep.members:
        sweep.load(member)
    return sweep


def _table(path: Path, raw: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = raw.get(key, {})
    if not isinstance(found, dict):
        raise InputError(f"{path}: {key} must be a table, written [{key}]")
    return found


def _planned(path: Path, raw: Mapping[str, Any]) -> tuple[tuple[str, ...], list[Member]]:
    plan = raw.get("plan", "list" if "member" in raw else "grid")
    if plan not in PLANS:
        raise InputError(f"{path}: plan must be one of {', '.join(PLANS)}, not {plan!r}")
    if plan == "list":
        return _listed(path, raw.get("member", []))
    axes = raw.get("axis", [])
    if not isinstance(axes, list) or not axes or not all("key" in axis for axis in axes):
        raise InputError(f'{path}: plan = "{plan}" needs [[axis]] tables, each with a key')
    keys = tuple(str(axis["key"]) for axis in axes)
    if len(set(keys)) < len(keys):
        raise InputError(f"{path}: two [[axis]] tables have the same key")
    if plan == "grid":
        rows = list(itertools.product(*(_values(path, axis) for axis in axes)))
    else:
        rows = _hypercube(path, raw, axes)
    if not 1 <= len(rows) <= MOST:
        raise InputError(f"{path}: {len(rows)} members; a sweep has 1 to {MOST}")
    return keys, _named(keys, rows)


def _listed(
    path: Path, tables: Sequence[Mapping[str, Any]]
) -> tuple[tuple[str, ...], list[Member]]:
    members = [
        Member(str(one.get("name", f"{k:03d}")), dict(one.get("set", {})))
        for k, one in enumerate(tables, start=1)
    ]
    if not members:
        raise InputError(f'{path}: plan = "list" needs [[member]] tables')
    names = [member.name for member in members]
    wrong = [name for name in names if not _NAME.fullmatch(name) or names.count(name) > 1]
    if wrong:
        raise InputError(
            f"{path}: member name {wrong[0]!r} must be unique and of letters, digits, '.', '_', '-'"
        )
    keys = dict.fromkeys(key for member in members for key in member.settings)
    return tuple(keys), members


def _values(path: Path, axis: Mapping[str, Any]) -> list[Any]:
    """The values of an axis of a grid: a list, or `count` values over a `range`."""
    if "values" in axis:
        values = axis["values"]
        if not isinstance(values, list) or not values:
            raise InputError(f"{path}: axis {axis['key']}: values must be a list that is not empty")
        return values
    low, high = _range(path, axis)
    count = _whole(path, axis, "count", 0, 2, MOST)
    return np.linspace(low, high, count).tolist()


def _hypercube(
    path: Path, raw: Mapping[str, Any], axes: Sequence[Mapping[str, Any]]
) -> list[tuple[Any, ...]]:
    samples = _whole(path, raw, "samples", 0, 1, MOST)
    seed = _whole(path, raw, "seed", 0, 0, 2**32 - 1)
    bounds = np.array([_range(path, axis) for axis in axes])
    unit = qmc.LatinHypercube(d=len(axes), seed=seed).random(samples)
    return [tuple(row) for row in qmc.scale(unit, bounds[:, 0], bounds[:, 1]).tolist()]


def _range(path: Path, axis: Mapping[str, Any]) -> tuple[float, float]:
    given = axis.get("range")
    if (
        not isinstance(given, list)
        or len(given) != 2
        or not all(isinstance(v, int | float) for v in given)
        or not given[0] < given[1]
    ):
        raise InputError(f"{path}: axis {axis['key']}: give values, or range = [low, high]")
    return float(given[0]), float(given[1])


def _whole(
    path: Path, raw: Mapping[str, Any], key: str, default: int, least: int, most: int
) -> int:
    value = raw.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(
            f"{path}: {key} must be a whole number from {least} to {most}, not {value!r}"
        )
    return value


def _named(keys: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> list[Member]:
    """Members numbered and named by their settings: 03_speed-40."""
    digits = len(str(len(rows)))
    members = []
    for number, row in enumerate(rows, start=1):
        settings = dict(zip(keys, row, strict=True))
        parts = [f"{key.rpartition('.')[2]}-{_short(value)}" for key, value in settings.items()]
        members.append(Member("_".join([f"{number:0{digits}d}", *parts])[:80], settings))
    return members


def _short(value: Any) -> str:
    text = (
        f"{value:.6g}"
        if isinstance(value, float)
        else Path(value).stem
        if isinstance(value, str)
        else str(value)
    )
    return re.sub(r"[^A-Za-z0-9._-]", "", text)[:24]


def _absolute(settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Make file names absolute, relative to the sweep file's folder."""
    files = {name for name, *_, key in walk(Scene) if key.is_file}
    return {
        key: str((folder / value).resolve()) if key in files and isinstance(value, str) else value
        for key, value in settings.items()
    }
