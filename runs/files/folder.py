"""The result folder: its owner, whether it is writable, and its summary."""

import fcntl
import json
import math
import os
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.files.checksum import is_as_signed, is_table_as_signed, signed_table, text_digest
from tireroad.runs.files.disk import explained, remove_leftovers, write_text
from tireroad.runs.files.store import plain
from tireroad.runs.scene.resolved import MARK
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

OTHER = "choose another folder with --out, or remove this one; nothing was written"


def _earlier(directory: Path) -> dict[str, Any] | None:
    """The summary of an earlier run, or None. Raises InputError if it is unreadable or damaged."""
    path = directory / "summary.json"
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); {OTHER}") from None
    try:
        found = json.loads(text)
        found["program"]["version"], found["scene"], found["stages"].items()
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{path}: is not a summary of {PROGRAM}; {OTHER}") from None
    if not is_table_as_signed(found):
        raise InputError(
            f"{path}: is damaged: it is not what was written (checksum). Remove it to go on, the"
            " stages' own files are kept; or choose another folder with --out"
        )
    return found


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
            f"{path}: has changed since the run wrote it (damaged or edited): resume goes on with"
            " what was begun; use run for another scene, or to write it anew from your own file"
        )


def _check_name(directory: Path, found: Any, scene_name: str) -> None:
    if found != scene_name:
        raise InputError(
            f'{directory}: holds results of the scene "{found}", not of "{scene_name}"; {OTHER}'
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
    found = _earlier(directory)
    if found is None:
        _check_scene(directory, scene_name)
        return
    _check_name(directory, found["scene"], scene_name)
    program = found["program"]
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


class Summary:
    """`summary.json`: one entry per stage, rewritten completely after each. Root process only.

    Until the first stage of a run has ended, the file is that of an earlier run: the hash of the
    resolved scene, `scene_text`, tells them apart.
    """

    def __init__(
        self, directory: Path, scene_name: str, processes: int, scene_text: str = ""
    ) -> None:
        self.path = directory / "summary.json"
        self.earlier: dict[str, Any] = (_earlier(directory) or {"stages": {}})["stages"]
        self.data: dict[str, Any] = {
            "program": {"name": PROGRAM, "version": VERSION, "format": RESULT_FORMAT},
            "scene": scene_name,
            "resolved_scene": text_digest(scene_text),
            "processes": processes,
            "stages": {},
        }

    def record(
        self,
        stage: str,
        status: str,
        *,
        reason: str = "",
        seconds: float = 0.0,
        headline: dict[str, tuple[Any, str]] | None = None,
        indicators: dict[str, tuple[Any, str]] | None = None,
        warnings: list[str] | None = None,
        cost: dict[str, float] | None = None,
    ) -> None:
        """Enter a stage and write the file. Figures are given as name: (value, unit).

        A reused stage keeps the figures of the run that computed it.
        """
        kept = self.earlier.get(stage, {}) if status == "reused" else {}
        self.data["stages"][stage] = {
            "status": status,
            "reason": reason,
            "seconds": seconds,
            "headline": _figures(headline) or kept.get("headline", {}),
            "indicators": _figures(indicators) or kept.get("indicators", {}),
            "warnings": warnings or kept.get("warnings", []),
            "cost": cost or kept.get("cost", {}),
        }
        data = json.loads(json.dumps(_finite(self.data), default=plain))
        text = json.dumps(signed_table(data), indent=1, ensure_ascii=False)
        write_text(self.path, text + "\n")


def _figures(given: dict[str, tuple[Any, str]] | None) -> dict[str, Any]:
    return {name: {"value": value, "unit": unit} for name, (value, unit) in (given or {}).items()}


def _finite(value: Any) -> Any:
    """Replace infinities and NaN, which JSON does not have, by null."""
    if isinstance(value, dict):
        return {key: _finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(part) for part in value]
    if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
