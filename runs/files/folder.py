"""The result folder: its owner, and whether it is writable."""

import fcntl
import json
import os
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.files.checksum import is_as_signed, is_table_as_signed
from tireroad.runs.files.disk import explained, remove_leftovers
from tireroad.runs.scene.resolved import MARK
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

OTHER = "choose another folder with --out, or remove this one; nothing was written"


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
    found = earlier_summary(directory)
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
