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
(runs.sweep.command).
"""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import described, finite
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene

MOST = 10_000
PLANS = {
    "grid": {"axis"},
    "list": {"member"},
    "latin-hypercube": {"axis", "samples", "seed"},
}  # and the keys of the file that each uses
PLAN_KEYS = {"plan"}.union(*PLANS.values())
_AXIS = {"grid": {"key", "values", "range", "count"}, "latin-hypercube": {"key", "range"}}
NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,79}")
_KEYS = {"name", "scene", "processes", "slurm", "queue"} | PLAN_KEYS


@dataclass(frozen=True)
class Member:
    """One run: the name of its folder, and its settings on top of the base scene, key by key."""

    name: str
    settings: Mapping[str, Any]

    def overrides(self) -> list[str]:
        """The settings as arguments of --set; the scene takes the member's name."""
        items = [f"{key}={literal(value)}" for key, value in self.settings.items()]
        return [*items, f"name={literal(self.name)}"]


def check_keys(where: str, keys: Mapping[str, Any], known: set[str]) -> None:
    """Raise InputError for a key that is not known."""
    for key in keys:
        if key not in known:
            raise InputError(f"{where}: unknown key {key}; known here: {', '.join(sorted(known))}")


def planned(path: Path, raw: Mapping[str, Any]) -> tuple[tuple[str, ...], list[Member]]:
    """The keys that vary, and the members. Raises InputError for any mistake in them."""
    plan = raw.get("plan", "list" if "member" in raw else "grid")
    if not isinstance(plan, str) or plan not in PLANS:
        raise InputError(f"{path}: plan must be one of {', '.join(PLANS)}, not {plan!r}")
    for key in PLAN_KEYS - PLANS[plan] - {"plan"}:
        if key in raw:
            users = " or ".join(name for name in PLANS if key in PLANS[name])
            raise InputError(f'{path}: {key} belongs to plan = {users}, and this is "{plan}"')
    return _listed(path, raw) if plan == "list" else _crossed(path, raw, plan)


def _tables(path: Path, raw: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    """An array of tables; empty if absent."""
    tables = raw.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise InputError(f"{path}: {name} must be written [[{name}]], one for each")
    return tables


def _crossed(path: Path, raw: Mapping[str, Any], plan: str) -> tuple[tuple[str, ...], list[Member]]:
    """The members of a grid or a latin hypercube over the axes."""
    axes = _tables(path, raw, "axis")
    if not axes or not all("key" in axis for axis in axes):
        raise InputError(f'{path}: plan = "{plan}" needs [[axis]] tables, each with a key')
    keys = tuple(str(axis["key"]) for axis in axes)
    _check_apart(f"{path}: [[axis]]", keys)
    for key, axis in zip(keys, axes, strict=True):
        check_keys(f"{path}: axis {key}", axis, _AXIS[plan])
    if plan == "latin-hypercube":
        return keys, _named(keys, _hypercube(path, raw, axes))
    values = [_values(f"{path}: axis {key}", axis) for key, axis in zip(keys, axes, strict=True)]
    _check_count(path, math.prod(len(value) for value in values))
    return keys, _named(keys, list(itertools.product(*values)))


def _check_count(path: Path, count: int) -> None:
    if not 1 <= count <= MOST:
        raise InputError(f"{path}: {count} members; a sweep has 1 to {MOST}")


def _listed(path: Path, raw: Mapping[str, Any]) -> tuple[tuple[str, ...], list[Member]]:
    members = []
    for number, table in enumerate(_tables(path, raw, "member"), start=1):
        name, settings = str(table.get("name", f"{number:03d}")), table.get("set", {})
        check_keys(f"{path}: member {name}", table, {"name", "set"})
        if not isinstance(settings, dict):
            raise InputError(
                f"{path}: member {name}: set must be a table of keys and values, "
                f'such as {{ "static.load" = 300.0 }}, not {described(settings)}'
            )
        names = list(_keyed(settings))
        _check_apart(f"{path}: member {name}", [key for key, _ in names])
        members.append(Member(name, dict(names)))
    if not members:
        raise InputError(f'{path}: plan = "list" needs [[member]] tables')
    _check_count(path, len(members))
    count = Counter(member.name for member in members)
    wrong = [name for name, number in count.items() if number > 1 or not NAME.fullmatch(name)]
    if wrong:
        raise InputError(
            f"{path}: member name {wrong[0]!r} must be unique and of letters, digits, '.', '_', '-'"
        )
    keys = dict.fromkeys(key for member in members for key in member.settings)
    return tuple(keys), members


def _keyed(settings: Mapping[str, Any], table: str = "") -> Iterator[tuple[str, Any]]:
    """Keys and values of a member; contact.slip = 0.1 without quotes is a key in a table to TOML."""
    for key, value in settings.items():
        path = f"{table}{key}"
        if isinstance(value, dict) and "." not in key and path in _tables_of_scene():
            yield from _keyed(value, f"{path}.")
        else:
            yield path, value


@cache
def _tables_of_scene() -> frozenset[str]:
    parents = (dotted.split(".")[:-1] for dotted, *_ in walk(Scene))
    return frozenset(".".join(parts[:k]) for parts in parents for k in range(1, len(parts) + 1))


def _check_apart(where: str, keys: Sequence[str]) -> None:
    """Raise InputError for a key given twice, or with a table that holds it: one would be lost."""
    for key in keys:
        if keys.count(key) > 1:
            raise InputError(f"{where}: {key} is given twice")
        for other in keys:
            if other.startswith(f"{key}."):
                raise InputError(f"{where}: {key} holds {other}: give one of them")


def _values(where: str, axis: Mapping[str, Any]) -> list[Any]:
    """The values of an axis of a grid: a list, or `count` values over a `range`.

    Of a range of whole numbers the whole values are integers, and for a key of whole numbers all
    are.
    """
    if "values" in axis:
        values = axis["values"]
        if not isinstance(values, list) or not values:
            raise InputError(f"{where}: values must be a list that is not empty")
        if extra := {"range", "count"} & set(axis):
            raise InputError(
                f"{where}: give values or range and count, not values and {min(extra)}"
            )
        return values
    low, high = _range(where, axis)
    count = whole(where, axis, "count", 0, 2, MOST)
    values = np.linspace(low, high, count)
    if _counts(axis):
        if count > high - low + 1:
            raise InputError(
                f"{where}: count = {count}, and {axis['range']} has fewer whole numbers"
            )
        return np.rint(values).astype(int).tolist()
    if all(isinstance(end, int) for end in axis["range"]):
        return [int(value) if value.is_integer() else value for value in values.tolist()]
    return values.tolist()


def _counts(axis: Mapping[str, Any]) -> bool:
    """Whether the values of a range are whole: both ends are, and so are the key's in a scene."""
    name = re.sub(r"\.\d+(?=\.)", "[]", str(axis["key"]))
    known = any(key.is_whole for dotted, *_, key in walk(Scene) if dotted == name)
    return known and all(isinstance(end, int) for end in axis["range"])


def _hypercube(
    path: Path, raw: Mapping[str, Any], axes: Sequence[Mapping[str, Any]]
) -> list[tuple[Any, ...]]:
    samples = whole(str(path), raw, "samples", 0, 1, MOST)
    seed = whole(str(path), raw, "seed", 0, 0, 2**32 - 1)
    unit = qmc.LatinHypercube(d=len(axes), seed=seed).random(samples)
    columns = []
    for share, axis in zip(unit.T, axes, strict=True):
        low, high = _range(f"{path}: axis {axis['key']}", axis)
        if _counts(axis):  # each whole number has the same share of the layers
            columns.append((low + np.floor(share * (high - low + 1))).astype(int).tolist())
        else:
            columns.append((low + share * (high - low)).tolist())
    return list(zip(*columns, strict=True))


def _range(where: str, axis: Mapping[str, Any]) -> tuple[float, float]:
    limits = axis.get("range")
    try:
        if isinstance(limits, list) and len(limits) == 2:
            low, high = (finite(end) for end in limits)
            if low < high:
                return low, high
    except ValueError as error:
        raise InputError(f"{where}: range: an end {error}") from None
    raise InputError(f"{where}: give values, or range = [low, high]")


def whole(where: str, raw: Mapping[str, Any], key: str, default: int, least: int, most: int) -> int:
    """A whole number of a table. Raises InputError if it is none, or out of range."""
    value = raw.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise InputError(
            f"{where}: {key} must be a whole number from {least} to {most}, not {value!r}"
        )
    return value


def _named(keys: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> list[Member]:
    """Members numbered and named by their settings: 03_speed-40."""
    digits = len(str(len(rows)))
    members = []
    for number, row in enumerate(rows, start=1):
        settings = dict(zip(keys, row, strict=True))
        # A key of [tire.scale] may have blanks: they are none of a folder's name.
        parts = [
            f"{key.rpartition('.')[2].replace(' ', '_')}-{_short(value)}"
            for key, value in settings.items()
        ]
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
        raw = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    check_keys(str(path), raw, _KEYS)
    name = str(raw.get("name", path.stem))
    if not NAME.fullmatch(name):
        raise InputError(f"{path}: name must be letters, digits, '.', '_', '-', not {name!r}")
    scene = path.parent / str(raw.get("scene", ""))
    if not scene.is_file():
        raise InputError(f"{path}: scene = {raw.get('scene')!r} names no file: {scene}")
    axes, members = planned(path, raw)
    sweep = Sweep(
        name=name,
        scene=scene,
        axes=axes,
        members=tuple(Member(m.name, _absolute(m.settings, path.parent)) for m in members),
        processes=whole(str(path), raw, "processes", 1, 1, 9999),
        slurm=_table(path, raw, "slurm"),
        queue=_table(path, raw, "queue"),
        folder=path.parent,
    )
    for member in sweep.members:
        sweep.load(member)
    return sweep


def _table(path: Path, raw: Mapping[str, Any], key: str) -> dict[str, Any]:
    table = raw.get(key, {})
    if not isinstance(table, dict):
        raise InputError(f"{path}: {key} must be a table, written [{key}]")
    return table


def _absolute(settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Make file names absolute, relative to the sweep file's folder."""
    files = {name for name, *_, key in walk(Scene) if key.is_file}
    return {
        key: str((folder / value).resolve()) if key in files and isinstance(value, str) else value
        for key, value in settings.items()
    }
