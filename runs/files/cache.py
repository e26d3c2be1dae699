"""Cache of finished stages shared by several result folders, by stage and hash of inputs.

The environment variable TIREROAD_CACHE names the folder for a command; "off" disables it. If unset,
a folder in the user's cache is used: it keeps the stages that another road or time does not change,
up to `LARGEST` bytes, and drops the least recently used first. A run from a script uses the cache
it is given, by default none. Files are hard-linked, not copied, where the file system allows it:
result files are never modified in place.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py

from tireroad.fem.form_cache import user_folder
from tireroad.runs.files import store
from tireroad.runs.files.disk import Refused, replacing, write_text

VARIABLE, OFF = "TIREROAD_CACHE", "off"
SHARED = (
    "static",
    "modes",
    "fields",
    "rotating",
    "greens",
    "stiffness",
)  # stages kept in the user's own cache
_LOG = logging.getLogger(__name__)
LARGEST = 10e9  # bytes: largest size of the user's own cache


def own_folder() -> Path:
    """The folder for stages in the user's cache."""
    return user_folder() / "stages"


@dataclass(frozen=True)
class Kept:
    """A finished stage in a cache: its file, bytes, and time (s since 1970) of its last use."""

    path: Path
    size: int
    used: float

    @property
    def stage(self) -> str:
        """Name of the stage."""
        return self.path.name.partition("-")[0]

    def remove(self) -> None:
        """Remove it from the cache; result folders that share it keep it."""
        for path in (self.path.with_suffix(".json"), self.path):
            with suppress(OSError):
                path.unlink()


@dataclass(frozen=True)
class Cache:
    """The shared `folder`, or None. Reading and writing are for the root process only."""

    folder: Path | None = None

    @classmethod
    def of_user(cls) -> Cache:
        """The cache named by TIREROAD_CACHE, by default the user's own."""
        name = os.environ.get(VARIABLE) or str(own_folder())
        return cls(None if name == OFF else Path(name))

    def of_family(self, folder: Path) -> Cache:
        """The cache of a family of runs: its own `folder`, unless the user has named one."""
        return Cache(folder) if self.folder is None or self._own else self

    @property
    def _own(self) -> bool:
        """Whether it is the user's own cache, which is limited in size."""
        return self.folder == own_folder()

    def entries(self) -> list[Kept]:
        """The stages kept, least recently used first."""
        entries = []
        for path in self.folder.glob("*-*.h5") if self.folder else ():
            with suppress(OSError):  # another process has just removed it
                used = path.with_suffix(".json").stat().st_mtime
                entries.append(Kept(path, path.stat().st_size, used))
        return sorted(entries, key=lambda entry: entry.used)

    def described(self) -> str:
        """A table of the stages kept, most recently used first, and their total size."""
        if self.folder is None:
            return "no stages are kept: TIREROAD_CACHE is off, or the folder cannot be written"
        entries = self.entries()[::-1]
        lines = [f"{'stage':10s}{'scene':26s}{'MB':>9s}  last used"]
        for entry in entries:
            with suppress(OSError), h5py.File(entry.path) as file:
                when = time.strftime("%Y-%m-%d %H:%M", time.localtime(entry.used))
                scene = str(file.attrs.get("scene_name", "?"))[:24]
                lines.append(f"{entry.stage:10s}{scene:26s}{entry.size / 1e6:9.1f}  {when}")
        total = sum(one.size for one in entries) / 1e9
        most = f", at most {LARGEST / 1e9:g} GB" if self._own else ""
        return "\n".join([*lines, f"{len(entries)} stages, {total:.2f} GB in {self.folder}{most}"])

    def clear(self, unused_for: float) -> str:
        """Remove the stages unused for that many days; returns a report."""
        old = [entry for entry in self.entries() if time.time() - entry.used >= 86400 * unused_for]
        for one in old:
            one.remove()
        for lock in self.folder.glob("*.lock") if self.folder and not unused_for else ():
            with suppress(OSError):
                lock.unlink()
        return f"{len(old)} stages removed, {sum(entry.size for entry in old) / 1e9:.2f} GB"

    def _prune(self) -> None:
        """Remove the least recently used stages of the user's own cache beyond its limit."""
        entries = self.entries() if self._own else []
        total = sum(entry.size for entry in entries)
        for one in entries:
            if total <= LARGEST:
                return
            one.remove()
            total -= one.size

    def place(self, stage: str, key: str) -> Path:
        """The path of a stage's file in the cache."""
        assert self.folder is not None
        return self.folder / f"{stage}-{key}.h5"

    def fetch(self, stage: str, key: str, path: Path) -> dict[str, Any] | None:
        """Put the cached file at `path`; returns the figures stored with it.

        None if there is no intact file of these inputs.
        """
        if self.folder is None:
            return None
        try:
            if store.why_not(self.place(stage, key), key, stage):
                return None
            figures = json.loads(self._figures(stage, key).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        _link(self.place(stage, key), path)
        with suppress(OSError):
            os.utime(self._figures(stage, key), (time.time(), time.time()))
        return figures

    def keep(self, stage: str, key: str, path: Path, figures: Mapping[str, Any]) -> None:
        """Store a finished file and its figures; if that fails, others compute the stage again."""
        if self.folder is None or (self._own and stage not in SHARED):
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            text = json.dumps(figures, default=store.plain)
            write_text(self._figures(stage, key), text)
            _link(path, self.place(stage, key))
            self._prune()
        except (OSError, Refused) as error:
            _LOG.warning(f"  not kept for other runs, {VARIABLE} = {self.folder}: {error}")

    def _figures(self, stage: str, key: str) -> Path:
        return self.place(stage, key).with_suffix(".json")

    @contextmanager
    def claimed(self, stage: str, key: str) -> Iterator[None]:
        """Within the context, other runs that need the same file wait, so that it is computed once.

        Without file locks in that folder it may be computed twice.
        """
        if self.folder is None:
            yield
            return
        with ExitStack() as held:
            with suppress(OSError):
                self.folder.mkdir(parents=True, exist_ok=True)
                lock = held.enter_context(self.place(stage, key).with_suffix(".lock").open("w"))
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    _LOG.warning(f"{stage:9s} waits for another run that computes the same stage")
                    fcntl.flock(lock, fcntl.LOCK_EX)
            yield


NO_CACHE = Cache()


def _link(source: Path, target: Path) -> None:
    """Make `target` a hard link to `source`, or a copy if it cannot be linked."""
    with replacing(target) as part:
        try:
            os.link(source, part)
        except OSError:
            shutil.copyfile(source, part)
