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

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.walk import walk
from tireroad.runs.sweep.members import NAME, PLAN_KEYS, Member, check_keys, planned, whole

_KEYS = {"name", "scene", "processes", "slurm", "queue"} | PLAN_KEYS


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
    found = raw.get(key, {})
    if not isinstance(found, dict):
        raise InputError(f"{path}: {key} must be a table, written [{key}]")
    return found


def _absolute(settings: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Make file names absolute, relative to the sweep file's folder."""
    files = {name for name, *_, key in walk(Scene) if key.is_file}
    return {
        key: str((folder / value).resolve()) if key in files and isinstance(value, str) else value
        for key, value in settings.items()
    }
