"""The result folder: its owner, its summary, and which of its files belong to the scene."""

import fcntl
import itertools
import json
import math
import os
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import (
    explained,
    is_as_signed,
    is_table_as_signed,
    remove_leftovers,
    signed,
    signed_table,
    text_digest,
    write_text,
)
from tireroad.runs.files.names import MARK, STAGES, scene_name
from tireroad.runs.files.store import opened, plain
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

OTHER = "choose another folder with --out, or remove this one; nothing was written"
MADE_OF = "made_of.txt"
CHOSEN = "chosen.toml"
"""The scene with the settings that a search has found."""
UNFINISHED = ("checkpoint.h5", "static_last.h5")
"""Files of a stage that has not ended: no entry of the summary tells of them."""


def earlier_summary(directory: Path) -> dict[str, Any] | None:
    """The summary of an earlier run, or None. Raises InputError if it is unreadable or damaged."""
    path = directory / "summary.json"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {OTHER}") from None
    try:
        summary = json.loads(text)
        summary["program"]["version"], summary["scene"], summary["stages"].items()
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{path}: is not a summary of {PROGRAM}; {OTHER}") from None
    if not is_table_as_signed(summary):
        raise InputError(
            f"{path}: is damaged: it is not what was written (checksum). Remove it to go on, the"
            " stages' own files are kept; or choose another folder with --out"
        )
    return summary


def check_kept_scene(path: Path) -> None:
    """Raise InputError if a run's scene has changed since it was written: no `resume` then."""
    try:
        text = path.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(
            f"{path.parent}: there is no run to resume: it has no scene.toml"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not is_as_signed(text):
        raise InputError(
            f"{path}: has changed since the run wrote it (damaged or edited): resume continues"
            " what was started; use run for another scene, or to write it anew from your own file"
        )


def _check_name(directory: Path, summary: Any, scene_name: str) -> None:
    if summary != scene_name:
        raise InputError(
            f'{directory}: holds results of the scene "{summary}", not of "{scene_name}"; {OTHER}'
        )


def _check_scene(directory: Path, scene_name: str) -> None:
    """Check a folder without a summary: its scene.toml must come from a run of this scene."""
    try:
        text = (directory / "scene.toml").read_text(encoding="utf-8")
        name = tomllib.loads(text).get("name")
    except FileNotFoundError:
        return
    except (OSError, ValueError):
        text, name = "", None
    if not text.startswith(MARK):
        raise InputError(f"{directory}: holds a scene.toml that is not a result; {OTHER}")
    _check_name(directory, name, scene_name)


def check_owner(directory: Path, scene_name: str) -> None:
    """Raise InputError if the folder holds results of another scene or another version."""
    summary = earlier_summary(directory)
    if summary is None:
        _check_scene(directory, scene_name)
        return
    _check_name(directory, summary["scene"], scene_name)
    program = summary["program"]
    if (program["version"], program.get("format")) != (VERSION, RESULT_FORMAT):
        raise InputError(
            f"{directory}: holds results of {PROGRAM} {program['version']}"
            f" (format {program.get('format')}), this is {VERSION} (format {RESULT_FORMAT});"
            f" {OTHER}"
        )


def make_folder(directory: Path) -> None:
    """Create the folder and its parents. Root process only. Raises InputError if that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unusable(directory, error) from None


def folder_of(file: Path, of: Path = Path("results")) -> Path:
    """The folder for what is made from a file that is no scene: results/NAME, results/NAME-2, …

    The first that is new or was made from this very file: files of one name in different folders, or of different kinds,
    and the results of a run, do not overwrite each other. Creates nothing where that is not permitted.
    """
    text, name = f"{file.resolve()}\n", scene_name(file.stem)
    for number in itertools.count(1):
        folder = of / (name if number == 1 else f"{name}-{number}")
        mark = folder / MADE_OF
        try:
            if folder.exists() and (not mark.is_file() or mark.read_text(encoding="utf-8") != text):
                continue
            folder.mkdir(parents=True, exist_ok=True)
            mark.write_text(text, encoding="utf-8")
        except OSError:
            pass
        return folder
    raise AssertionError("numbers do not end")


@contextmanager
def held(directory: Path) -> Iterator[None]:
    """Create the folder and lock it against a second command. Root process only."""
    make_folder(directory)
    try:
        handle = os.open(directory, os.O_RDONLY)
    except OSError as error:
        raise _unusable(directory, error) from None
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{directory}: another run is writing here: wait for it, or use --out"
            ) from None
        except OSError:
            pass  # file system without locks
        yield
    finally:
        os.close(handle)


@contextmanager
def claimed(directory: Path, scene_name: str) -> Iterator[None]:
    """Create, lock and check a run's folder, and remove what dead runs left. Root process only."""
    with held(directory):
        check_owner(directory, scene_name)
        _check_purpose(directory)
        remove_leftovers(directory)
        try:
            tempfile.TemporaryFile(dir=directory).close()
        except OSError as error:
            raise _unusable(directory, error) from None
        yield


def _check_purpose(directory: Path) -> None:
    """Refuse the working folder unless it is empty or holds results already."""
    if directory.resolve() != Path.cwd() or (directory / "summary.json").exists():
        return
    if (directory / "scene.toml").exists() or not any(directory.iterdir()):
        return
    raise InputError(
        f"{directory}: this is the working folder, with other files in it: give results a folder of"
        " their own with --out"
    )


def _unusable(directory: Path, error: OSError) -> InputError:
    if isinstance(error, FileExistsError | NotADirectoryError):
        return InputError(f"{directory}: is not a folder; choose another with --out")
    clear = explained(error, directory) or (
        f"{directory}: cannot be written: {error.strerror}; choose another with --out"
    )
    return InputError(str(clear))


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
    entries, left = table["stages"], {}
    for stage in STAGES:
        name, entry = f"{stage}.h5", entries.get(stage)
        if not has_result(entry) and (directory / name).is_file():
            why = (entry or {}).get("reason") or "this run has not finished it"
            left[name] = f"it is of an earlier run ({why})"
    for name in UNFINISHED:
        if (directory / name).is_file() and not _is_of_scene(directory, name):
            left[name] = "it is of another scene"
    if _read(directory / CHOSEN) not in (None, _read(directory / "scene.toml")):
        left[CHOSEN] = "it was chosen for another scene"
    return left


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


class Summary:
    """`summary.json`: one entry per stage, rewritten completely after each. Root process only.

    The file of a stage is a result of the folder's scene only if `stages` says so
    (runs.files.folder). Entries of a run of another scene, and of stages whose inputs have changed
    since, are moved to `earlier`: their files stay, so that a run that goes back to that scene
    finds them, with their figures. A run of the same scene begins with the entries it finds.
    """

    def __init__(
        self, directory: Path, scene_name: str, processes: int, scene_text: str = ""
    ) -> None:
        self.path = directory / "summary.json"
        self._scene = directory / "scene.toml", signed(scene_text)
        self._entered: set[str] = set()
        summary = earlier_summary(directory) or {"stages": {}}
        self.data: dict[str, Any] = {
            "program": {"name": PROGRAM, "version": VERSION, "format": RESULT_FORMAT},
            "scene": scene_name,
            "resolved_scene": text_digest(scene_text),
            "processes": processes,
            "stages": summary["stages"],
            "earlier": summary.get("earlier", {}),
        }
        self._of_another = not self._is_scene()
        if self._of_another:
            self._set_aside()
        self.data["stages"].pop("report", None)  # it tells a finished run

    def note_files(self, rows: Sequence[Sequence[str]]) -> None:
        """Keep what the run reads of files (runs.scene.files) for those that read the results; written with the next stage."""
        self.data["files"] = [list(row) for row in rows]

    def begin(self) -> None:
        """Write scene.toml, after the summary if it has results of another scene to set aside."""
        if self._of_another and self.path.exists():
            self._write()
        write_text(*self._scene)

    def record(
        self,
        stage: str,
        status: str,
        *,
        reason: str = "",
        seconds: float = 0.0,
        input_hash: str = "",
        headline: dict[str, tuple[Any, str]] | None = None,
        indicators: dict[str, tuple[Any, str]] | None = None,
        warnings: list[str] | None = None,
        notes: list[str] | None = None,
        cost: dict[str, float] | None = None,
    ) -> None:
        """Enter a stage and write the file. Figures are given as name: (value, unit).

        A reused stage keeps the figures of the run that computed it. A skipped stage keeps its
        result of a run of the same scene: it is only this run that ends before it.
        """
        if status == "skipped" and has_result(self.data["stages"].get(stage)):
            return
        before = self._known(stage, input_hash) if status == "reused" else {}
        self._displace(stage, status, input_hash)
        self.data["stages"][stage] = {
            "status": status,
            "reason": reason,
            "seconds": seconds,
            "input_hash": input_hash,
            "headline": _figures(headline) or before.get("headline", {}),
            "indicators": _figures(indicators) or before.get("indicators", {}),
            "warnings": warnings or before.get("warnings", []),
            **({"notes": said} if (said := notes or before.get("notes", [])) else {}),
            "cost": cost or before.get("cost", {}),
        }
        self._write()

    def end(self, stage: str, reason: str) -> None:
        """Enter that the run ends in a stage, failed or stopped, for those that read the results."""
        self.data["ended"] = {"stage": stage, "reason": reason}
        self._write()

    def _is_scene(self) -> bool:
        """Whether the folder's scene.toml is that of this run."""
        path, text = self._scene
        try:
            return path.read_text(encoding="utf-8") == text
        except (OSError, UnicodeDecodeError):
            return False

    def _known(self, stage: str, input_hash: str) -> dict[str, Any]:
        """The entry of the file that a stage reuses, {} if there is none."""
        for group in (self.data["stages"], self.data["earlier"]):
            if stage in group and group[stage].get("input_hash", input_hash) == input_hash:
                return group[stage]
        return {}

    def _displace(self, stage: str, status: str, input_hash: str) -> None:
        """Set aside what the entry of a stage makes out of date: its own, and those after it."""
        before = self.data["stages"].get(stage, {})
        if before.get("input_hash", input_hash) != input_hash:
            self._set_aside()
        if status != "skipped":
            self.data["earlier"].pop(stage, None)
        self._entered.add(stage)

    def _set_aside(self) -> None:
        """Move the entries that this run has not made itself to `earlier`."""
        for stage in self.data["stages"].keys() - self._entered:
            entry = self.data["stages"].pop(stage)
            if has_result(entry) and stage != "report":
                self.data["earlier"][stage] = entry

    def _write(self) -> None:
        data = json.loads(json.dumps(_finite(self.data), default=plain))
        text = json.dumps(signed_table(data), indent=1, ensure_ascii=False)
        write_text(self.path, text + "\n")


def _figures(figures: dict[str, tuple[Any, str]] | None) -> dict[str, Any]:
    return {name: {"value": value, "unit": unit} for name, (value, unit) in (figures or {}).items()}


def _finite(value: Any) -> Any:
    """Replace infinities and NaN, which JSON does not have, by null."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
