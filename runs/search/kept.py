"""What a search keeps in its result folder until it has found settings.

`search/scene.toml` is the scene as given, with which `resume` goes on; `scene.toml` is always that
of the results beside it. `search/cache` holds the stages of the trials.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from tireroad.runs.files.checksum import signed
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import make_folder
from tireroad.runs.files.present import CHOSEN

FOLDER = "search"
_SCENE = "scene.toml"


def begin(directory: Path, scene_text: str) -> None:
    """Keep the resolved scene of a search; what an earlier one chose is removed. Root only.

    In a folder without results it is also the folder's scene, which names the owner.
    """
    (directory / CHOSEN).unlink(missing_ok=True)
    make_folder(directory / FOLDER)
    write_text(directory / FOLDER / _SCENE, signed(scene_text))
    if not (directory / "summary.json").exists():
        write_text(directory / _SCENE, signed(scene_text))


def to_resume(directory: Path) -> Path:
    """The scene that `resume` goes on with: that of an unfinished search, if there is one."""
    given = directory / FOLDER / _SCENE
    return given if given.is_file() else directory / _SCENE


def leave(directory: Path) -> None:
    """Before a run without a search: `resume` is to go on with that run. Root process only."""
    (directory / FOLDER / _SCENE).unlink(missing_ok=True)


def forget(directory: Path) -> None:
    """Remove the scene as given, and the stages of the trials. Root process only."""
    shutil.rmtree(directory / FOLDER, ignore_errors=True)
