"""Which result files of a folder belong to its scene: the one rule for all that read results."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.files.checksum import is_table_as_signed, signed
from tireroad.runs.files.store import opened
from tireroad.runs.scene.plan import STAGES

CHOSEN = "chosen.toml"
"""The scene with the settings that a search has found."""
UNFINISHED = ("checkpoint.h5", "static_last.h5")
"""Files of a stage that has not ended: no entry of the summary tells of them."""


def has_result(entry: Mapping[str, Any] | None) -> bool:
    """Whether a stage with this entry in summary.json has a result."""
    return entry is not None and entry.get("status", "computed") != "skipped"


def left_out(directory: Path) -> dict[str, str]:
    """Files in a result folder that are not results of its scene, with the reason.

    A run in a folder that is used again leaves the files of earlier runs where they are, to be
    reused by a run that goes back to them. The file of a stage counts if the stage has a result by
    summary.json; a file of an unfinished stage if it was written for the folder's scene; any other
    file always. Without a readable summary nothing is known, and every file counts. Not collective.
    """
    return _left_out(directory, _table(directory))


def _left_out(directory: Path, table: Mapping[str, Any] | None) -> dict[str, str]:
    if table is None:
        return {}
    entries, found = table["stages"], {}
    for stage in STAGES:
        name, entry = f"{stage}.h5", entries.get(stage)
        if not has_result(entry) and (directory / name).is_file():
            why = (entry or {}).get("reason") or "this run has not finished it"
            found[name] = f"it is of an earlier run ({why})"
    for name in UNFINISHED:
        if (directory / name).is_file() and not _is_of_scene(directory, name):
            found[name] = "it is of another scene"
    if _read(directory / CHOSEN) not in (None, _read(directory / "scene.toml")):
        found[CHOSEN] = "it was chosen for another scene"
    return found


def ending(summary: Mapping[str, Any]) -> str:
    """A sentence on a run that was stopped or failed, from its summary.json; else ""."""
    told = summary.get("ended")
    if not isinstance(told, Mapping):
        return ""
    return f"the run ended in stage {told.get('stage')}, {told.get('reason')}"


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None


def remarks(directory: Path) -> list[str]:
    """How the run ended, unless it finished, and the files left out, a sentence each."""
    table = _table(directory)
    ended = [f"{directory}: {text}"] if table and (text := ending(table)) else []
    return ended + [
        f"{directory / name} is left out: {reason}"
        for name, reason in _left_out(directory, table).items()
    ]


def _table(directory: Path) -> dict[str, Any] | None:
    """summary.json; None if it is absent or damaged, which its readers report."""
    try:
        table = json.loads((directory / "summary.json").read_text(encoding="utf-8"))
        table["stages"] = {name: dict(entry) for name, entry in table["stages"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return table if is_table_as_signed(table) else None


def _is_of_scene(directory: Path, name: str) -> bool:
    """Whether a file names the folder's scene as its own; its readers report any damage."""
    try:
        scene = (directory / "scene.toml").read_text(encoding="utf-8")
        with opened(directory / name) as file:
            return signed(str(file.attrs.get("scene", ""))) == scene
    except (OSError, ValueError, InputError):
        return True
