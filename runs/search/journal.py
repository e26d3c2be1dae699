"""search.json: the trials of a search, so that it can be resumed, and is not repeated."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from tireroad.runs.files import store
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.identity import identity
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables.accuracy import Accuracy
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.search.settings import Settings
from tireroad.runs.search.shares import Found

NAME = "search.json"


@dataclass(frozen=True)
class Trial:
    """Settings and their result: `found` errors, or the reason (`failed`) why there are none.

    `seconds` by stage of a run with these settings, reused stages at their original cost; `spent` s
    by this trial alone; `scheme` of its time loop.
    """

    settings: Settings
    seconds: Mapping[str, float]
    spent: float
    found: Found | None = None
    scheme: str = ""
    failed: str = ""


class Journal:
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
        data = {"of": self._of, "trials": [asdict(one) for one in self.trials]}
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
                return [_trial(one) for one in data["trials"]]
        return []


def read_trials(path: Path) -> list[Trial]:
    """All trials in a file, of any scene. Raises OSError, ValueError or KeyError without any."""
    return [_trial(one) for one in json.loads(path.read_text(encoding="utf-8"))["trials"]]


def _trial(data: dict[str, Any]) -> Trial:
    settings = data["settings"] | {"mesh": tuple(data["settings"]["mesh"])}
    found = data["found"]
    if found is not None:
        level = {cause: tuple(values) for cause, values in found["level"].items()}
        found = Found(found["history"], found["mean"], tuple(found["centre"]), level)
    return Trial(**data | {"settings": Settings(**settings), "found": found})


def _origin(scene: Scene) -> str:
    """Hash of all that trials depend on: the scene without its target, its files, the program."""
    of, up_to = scene.accuracy.of, scene.accuracy.up_to
    bare = replace(scene, accuracy=Accuracy(of=of, up_to=up_to))
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
    given = scene.road and scene.road.file, scene.pattern and scene.pattern.file
    return [path for path in given if path]
