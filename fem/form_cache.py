"""Cache of compiled forms that an interrupted compilation cannot damage.

FFCx marks a form under compilation by a file, and other processes wait for the one that made it. If
that process is killed, the file remains and every process that needs the form waits ten minutes in
vain. Therefore each process compiles in a folder of its own, which starts with links to all cached
forms, and complete new forms are copied to the cache afterwards. Folders of dead processes are
removed by the next run.

A form can be begun ahead of its use: FFCx writes its code, and the compiler goes on beside the program,
in files of other names. Whoever asks for the form finds it ready, or waits for that compiler.
"""

from __future__ import annotations

import atexit
import fcntl
import logging
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError

DONE = ".c.cached"  # FFCx's mark of a compiled module
_LOCK = "in-use"
_ABANDONED = 3600.0  # s after which another machine's folder without a lock is abandoned
_PATIENCE = 2.0  # s of compilation after which it is announced
_LIBRARY = tuple(EXTENSION_SUFFIXES)
_SUFFIX = EXTENSION_SUFFIXES[0]  # of the libraries that are built here
_AHEAD = "ahead-"  # before the names of what is built ahead of its use

_LOG = logging.getLogger(__name__)  # tells the user that forms are being compiled
_ahead: list[bool] = []  # whether forms are asked for ahead of their use
_begun: dict[
    Path, subprocess.Popen
] = {}  # compilers at work for libraries of this process's folder
_held: list[int] = []  # locks of this process's folders, released however it ends


def kept_in() -> Path:
    """The folder of compiled forms for this Python version, in the user's cache."""
    return user_folder() / f"forms-{sys.implementation.cache_tag}"


def user_folder() -> Path:
    """The program's folder in the user's cache, `$XDG_CACHE_HOME` or `~/.cache`."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "tireroad"


def compiled(comm: Any, make: Callable[[Path], Any]) -> Any:
    """Value of `make(folder)`, which compiles with `folder` as FFCx's cache. Collective.

    Raises InputError when forms cannot be compiled or loaded: the cause is then a compiler or a
    folder that the user can change, not the scene.
    """
    folder = _shared_workshop(comm)
    try:
        with _announced(folder):
            built = make(folder)
    except (OSError, ImportError, RuntimeError, _cffi_error()) as error:
        raise InputError(
            f"{folder.parent}: finite-element forms cannot be compiled or loaded there ({error});"
            " this needs a C compiler and some room: name another folder by XDG_CACHE_HOME, or"
            " remove this one if it is damaged"
        ) from error
    except BaseException:  # an interruption: the compiler would continue by itself
        end_compilers(folder)
        raise
    if comm.rank == 0:
        _keep(folder)
    return built


def begin(comm: Any, make: Callable[[Path], Any]) -> None:
    """Begin what `compiled(comm, make)` will be asked for, unless it is there. Collective.

    Does nothing where as many compilers are at work as there are processors. What fails now fails
    again, and is told, when it is asked for.
    """
    folder = _shared_workshop(comm)
    working = sum(process.poll() is None for process in _begun.values())
    if not comm.bcast(working < len(os.sched_getaffinity(0))):
        return
    _ahead.append(True)
    try:
        # FFCx takes `Begun` for a failure; on several processes dolfinx raises RuntimeError on all.
        with suppress(OSError, ImportError, RuntimeError, _cffi_error()):
            make(folder)
    finally:
        _ahead.pop()


class Begun(RuntimeError):
    """A form's compiler is at work."""


def build(
    folder: Path, name: str, code: str, command: Sequence[str], libraries: Sequence[str]
) -> str | None:
    """Build the library of a form from its C code in FFCx's cache `folder`; what the compiler said if it failed.

    Raises Begun ahead of its use, with the compiler at work.
    """
    library = folder / f"{name}{_SUFFIX}"
    if not _ahead:
        if _taken(library):
            return None
        source = folder / f"{name}.c"
        source.write_text(code, encoding="utf-8")
        run = [*command, str(source), "-o", str(library), *libraries]
        done = subprocess.run(run, capture_output=True, text=True)
        return done.stderr if done.returncode else None
    if library not in _begun:
        source = folder / f"{_AHEAD}{name}.c"
        source.write_text(code, encoding="utf-8")
        run = [*command, str(source), "-o", str(folder / f"{_AHEAD}{library.name}"), *libraries]
        nowhere = subprocess.DEVNULL
        _begun[library] = subprocess.Popen(run, stdin=nowhere, stdout=nowhere, stderr=nowhere)
    raise Begun(name)


def _taken(library: Path) -> bool:
    """Whether a compiler begun ahead has made the library, once it has ended; its files get their names."""
    process = _begun.pop(library, None)
    if process is None or process.wait():
        return False
    folder, name = library.parent, library.name.removesuffix(_SUFFIX)
    os.replace(folder / f"{_AHEAD}{library.name}", library)
    os.replace(folder / f"{_AHEAD}{name}.c", folder / f"{name}.c")
    return True


def _take_finished() -> None:
    """Let FFCx find the forms whose compilers have ended."""
    for library in [library for library, process in _begun.items() if process.poll() is not None]:
        if _taken(library):
            form = library.with_name(library.name.removesuffix(_SUFFIX))
            form.with_name(f"{form.name}.c.failed").unlink(missing_ok=True)  # so FFCx called it
            form.with_name(f"{form.name}{DONE}").touch()


def _shared_workshop(comm: Any) -> Path:
    """The root process's folder. Collective."""
    if comm.rank == 0:
        _take_finished()
    folder = Path(comm.bcast(str(_workshop()) if comm.rank == 0 else None))
    _pass_over_options(folder)
    return folder


def _pass_over_options(folder: Path) -> None:
    """Let FFCx and dolfinx look for a user's options in `folder` where ~/.config may not be entered.

    They fail there (a home of another user, in a container) instead of going without.
    """
    try:
        os.stat(Path.home() / ".config" / "ffcx")
    except PermissionError:
        os.environ.setdefault("XDG_CONFIG_HOME", str(folder))
    except OSError:
        pass  # none, the usual case


@cache
def _cffi_error() -> type[Exception]:
    import cffi

    return cffi.VerificationError


@cache
def _workshop() -> Path:
    """This process's own folder, with links to all cached forms."""
    target = kept_in()
    try:
        target.mkdir(parents=True, exist_ok=True)
        _sweep(target)
        folder = _new_folder(target)
        for names in _forms(target).values():
            _borrow(target, folder, names)
    except OSError as error:
        _LOG.warning(
            f"compiled forms cannot be kept in {target} ({error.strerror}) and are compiled anew in"
            " every run: name another folder by XDG_CACHE_HOME"
        )
        folder = Path(tempfile.mkdtemp(prefix="tireroad-forms-"))
        # The compiler of the wheels keeps its own beside ours.
        os.environ.setdefault("ZIG_GLOBAL_CACHE_DIR", str(folder / "zig"))
    atexit.register(_leave, folder)
    return folder


def _leave(folder: Path) -> None:
    working = [process for process in _begun.values() if process.poll() is None]
    if working:
        end_compilers(folder)
    for process in working:  # killed is not yet gone
        process.kill()
        process.wait()
    shutil.rmtree(folder, ignore_errors=True)


def _new_folder(parent: Path) -> Path:
    folder = Path(tempfile.mkdtemp(prefix=folder_prefix(os.getpid()), dir=parent))
    _held.append(os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600))
    with suppress(OSError):  # the file system has no locks
        fcntl.flock(_held[-1], fcntl.LOCK_EX)
    return folder


def folder_prefix(process: int) -> str:
    """Start of the name of a folder that a process of this machine made."""
    return f"run-{socket.gethostname()}-{process}-"


def _sweep(kept: Path) -> None:
    """Remove the folders of processes that ended without removing them."""
    for folder in kept.glob("run-*"):
        with suppress(OSError):
            if _unlocked(folder):
                _remove(folder)
                continue
            handle = os.open(folder / _LOCK, os.O_RDWR | os.O_CLOEXEC)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                _remove(folder)
            finally:
                os.close(handle)


def _remove(folder: Path) -> None:
    """Remove a folder to which compilers may write until they have died."""
    end_compilers(folder)
    for _ in range(10):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(0.1)


def _unlocked(folder: Path) -> bool:
    """Whether a folder has no lock file and no live process that may still create it.

    Its process was killed before it created the lock, or while it removed the folder.
    """
    if (folder / _LOCK).exists():
        return False
    process = folder.name.removeprefix(f"run-{socket.gethostname()}-").partition("-")[0]
    if process.isdigit():
        return not Path("/proc", process).exists()
    return time.time() - folder.stat().st_mtime > _ABANDONED  # made on another machine


def _forms(folder: Path) -> dict[str, list[str]]:
    """The complete forms in a folder by name: the files of each, the mark last."""
    files: dict[str, list[str]] = {}
    for name in os.listdir(folder):
        files.setdefault(name.partition(".")[0], []).append(name)
    forms = {}
    for form, names in files.items():
        library = [name for name in names if name.endswith(_LIBRARY)]
        if len(library) == 1 and {f"{form}.c", f"{form}{DONE}"} <= set(names):
            forms[form] = [library[0], f"{form}.c", f"{form}{DONE}"]
    return forms


def _borrow(source: Path, folder: Path, names: list[str]) -> None:
    """Link a cached form into the folder."""
    for name in names:
        try:
            os.link(source / name, folder / name)
        except FileNotFoundError:
            return  # another process has just removed it: the form will be compiled
        except OSError:
            os.symlink(source / name, folder / name)


def _keep(folder: Path) -> None:
    """Copy new complete forms of the folder to the cache."""
    parent = folder.parent
    if parent != kept_in():
        return  # a temporary folder: there is no cache
    for form, names in _forms(folder).items():
        if not (parent / f"{form}{DONE}").exists():
            with suppress(OSError):  # disk full: this process has its own copy
                for name in names:
                    _put(folder / name, parent / name)


def _put(source: Path, target: Path) -> None:
    """Copy a file to `target` atomically and flushed to disk."""
    part = target.with_name(f".{target.name}.{source.parent.name}.part")
    try:
        shutil.copyfile(source, part)
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def _announced(folder: Path) -> Iterator[None]:
    """Announce once that forms are being compiled, if that takes more than `_PATIENCE` seconds."""
    timer = threading.Timer(_PATIENCE, _announce, (folder,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _announce(folder: Path) -> None:
    if any(not file.with_suffix(DONE).exists() for file in folder.glob("*.c")):
        _say_once(folder.parent)


@cache
def _say_once(folder: Path) -> None:
    _LOG.warning(
        f"compiling finite-element forms, once for this kind of tire (kept in {folder}) ..."
    )


def end_compilers(folder: str | Path) -> None:
    """Kill the compilers at work in a folder: they outlive the process that started them."""
    named = os.fsencode(folder)
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError, ValueError):
            if int(entry.name) != os.getpid() and named in (entry / "cmdline").read_bytes():
                os.kill(int(entry.name), signal.SIGKILL)
