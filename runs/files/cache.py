"""Finished stages that several result folders share, kept by stage and hash of inputs.

The environment variable TIREROAD_CACHE names the folder; without it there is none. Files are linked,
not copied, where the file system allows it: result files are never written to in place.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tireroad.runs.files import store
from tireroad.runs.files.disk import replacing, write_text

VARIABLE = "TIREROAD_CACHE"


class Cache:
    """The shared folder, or nothing where the variable is not set. Root process only."""

    def __init__(self, folder: str | Path | None = None) -> None:
        given = folder or os.environ.get(VARIABLE)
        self.folder = Path(given) if given else None

    def place(self, stage: str, key: str) -> Path:
        """Where a stage's file is kept."""
        assert self.folder is not None
        return self.folder / f"{stage}-{key}.h5"

    def fetch(self, stage: str, key: str, path: Path) -> dict[str, Any] | None:
        """Put the kept file at `path`; the figures kept with it, or None where there is no file that is
        whole and of these inputs.
        """
        if self.folder is None or store.why_not(self.place(stage, key), key, stage):
            return None
        try:
            figures = json.loads(self._figures(stage, key).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        _link(self.place(stage, key), path)
        return figures

    def keep(self, stage: str, key: str, path: Path, figures: Mapping[str, Any]) -> None:
        """Keep a finished file and its figures for others. What cannot be kept is computed again there."""
        if self.folder is not None:
            with suppress(OSError):
                self.folder.mkdir(parents=True, exist_ok=True)
                text = json.dumps(figures, default=store.plain)
                write_text(self._figures(stage, key), text)
                _link(path, self.place(stage, key))

    def _figures(self, stage: str, key: str) -> Path:
        return self.place(stage, key).with_suffix(".json")

    @contextmanager
    def claimed(self, stage: str, key: str) -> Iterator[None]:
        """While inside, other runs that want the same file wait: it is computed once."""
        if self.folder is None:
            yield
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        with self.place(stage, key).with_suffix(".lock").open("w") as lock:
            with suppress(OSError):  # a file system without locks: it may be computed twice
                fcntl.flock(lock, fcntl.LOCK_EX)
            yield


def _link(source: Path, target: Path) -> None:
    """`target` becomes the same file, or a copy where it cannot be linked."""
    with replacing(target) as part:
        try:
            os.link(source, part)
        except OSError:
            shutil.copyfile(source, part)
