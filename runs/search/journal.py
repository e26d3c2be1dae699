"""The journal of a search: its trials with their estimated errors, in search.json.

From it a search is resumed, and not repeated. `search/scene.toml` is the scene as given, with which
`resume` goes on; `scene.toml` is always that of the results beside it. `search/cache` holds the
stages of the trials.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tireroad.contact.results.error_bars import CAUSES
from tireroad.runs.files import store
from tireroad.runs.files.disk import signed, write_text
from tireroad.runs.files.folder import CHOSEN, make_folder
from tireroad.runs.files.store import identity
from tireroad.runs.files.trials import (
    NAME,
    VERTICAL,
    ErrorsByCause,
    Settings,
    Trial,
    trial_of,
    worst,
)
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.scene import AccuracyTable, Scene

if TYPE_CHECKING:
    from tireroad.runs.stages.accuracy import Accuracy

FOLDER = "search"
_SCENE = "scene.toml"


def errors_of(product: Accuracy, table: AccuracyTable) -> ErrorsByCause:
    """Errors of the force that the target applies to."""
    bars = product.by_cause.get(table.of, {})
    below = np.flatnonzero(product.centre <= product.up_to)
    unknown = (float("nan"),) * len(below)
    mean = abs(float(product.mean[table.of][VERTICAL])) if table.of in product.mean else 0.0
    return ErrorsByCause(
        {c: float(bar.history[VERTICAL]) for c, bar in bars.items()},
        {c: float(bar.mean[VERTICAL]) / mean if mean else 0.0 for c, bar in bars.items()},
        tuple(map(float, product.centre[below])),
        {
            c: tuple(map(float, bars[c].level[below, VERTICAL])) if c in bars else unknown
            for c in CAUSES
        },
    )


def shown(over: np.ndarray, table: AccuracyTable) -> str:
    """The error and its shares in words, for the figure that is furthest from its target."""
    total, figure = worst(over)
    relative = 2 if table.target is not None else 0
    unit, scale = (
        ("%", 100 * (table.target or 0.0)) if figure < relative else ("dB", table.target_db)
    )
    parts = ", ".join(
        f"{cause} {_number(scale * value)}"
        for cause, value in zip(CAUSES, over[:, figure], strict=True)
    )
    return f"{_number(scale * total)} {unit} ({parts})"


def _number(value: float) -> str:
    return f"{value:.2g}" if np.isfinite(value) else "unknown"


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
    scene = directory / FOLDER / _SCENE
    return scene if scene.is_file() else directory / _SCENE


def leave(directory: Path) -> None:
    """Before a run without a search: `resume` is to go on with that run. Root process only."""
    (directory / FOLDER / _SCENE).unlink(missing_ok=True)


def forget(directory: Path) -> None:
    """Remove the scene as given, and the stages of the trials. Root process only."""
    shutil.rmtree(directory / FOLDER, ignore_errors=True)


class SearchJournal:
    """The trials of a search in a folder; the file is rewritten after each. Root process only."""

    def __init__(self, directory: Path, scene: Scene) -> None:
        self.path, self.scene = directory / NAME, scene
        self._of = _origin(scene)
        self.trials = self._kept()

    def known(self, settings: Settings) -> Trial | None:
        """The trial with these settings, if there was one."""
        return next((trial for trial in self.trials if trial.settings == settings), None)

    def add(self, trial: Trial) -> None:
        """Add a trial."""
        self.trials.append(trial)
        data = {"of": self._of, "trials": [asdict(trial) for trial in self.trials]}
        write_text(self.path, json.dumps(data, indent=1) + "\n")

    @staticmethod
    def forget(directory: Path) -> None:
        """Remove the trials of a folder."""
        (directory / NAME).unlink(missing_ok=True)

    def _kept(self) -> list[Trial]:
        """Trials of an earlier search for the same scene by the same program, for any target."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            data = json.loads(self.path.read_text(encoding="utf-8"))
            if data["of"] == self._of:
                return [trial_of(trial) for trial in data["trials"]]
        return []


def _origin(scene: Scene) -> str:
    """Hash of all that trials depend on: the scene without its target, its files, the program."""
    of, up_to = scene.accuracy.of, scene.accuracy.up_to
    bare = replace(scene, accuracy=AccuracyTable(of=of, up_to=up_to))
    files = [store.file_hash(path) for path in _files(scene)]
    program = identity("accuracy")
    parts = (
        dumps(bare),
        files,
        scene.tire.shape.fingerprint(scene.tire),
        program.code,
        sorted(program.libraries.items()),
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _files(scene: Scene) -> list[str]:
    files = scene.road and scene.road.file, scene.pattern and scene.pattern.file
    return [path for path in files if path]
