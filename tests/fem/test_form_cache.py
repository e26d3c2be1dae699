"""A stop in the middle of a compilation leaves nothing that a later run would wait for."""

import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mpi4py import MPI
from started import environment

from tireroad.fem import form_cache
from tireroad.fem.errors import InputError

pytestmark = pytest.mark.slow

CODE = """
import sys
import tireroad
import ufl
from dolfinx import mesh
from mpi4py import MPI
from tireroad.fem import compat
from tireroad.runs.process import mpi, signals

def compile_one():
    box = mesh.create_unit_cube(MPI.COMM_WORLD, 2, 2, 2, mesh.CellType.hexahedron)
    space = compat.vector_space(box, 2)
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    compat.form(ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx)
    print("compiled", flush=True)

signals.stop_on_signals()
with mpi.common_ending(MPI.COMM_WORLD) as end:
    compile_one()
sys.exit(end.status)
"""


def start(cache: Path, processes: int = 1) -> subprocess.Popen:
    command = [sys.executable, "-P", "-c", CODE]
    if processes > 1:
        command = ["mpirun", "-n", str(processes), *command]
    return subprocess.Popen(
        command,
        env=environment(XDG_CACHE_HOME=str(cache)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def compiling(cache: Path) -> list[Path]:
    """The folders in which a form is being compiled."""
    files = cache.glob("tireroad/*/run-*/libffcx_forms*.c")
    return [file.parent for file in files if not file.with_suffix(form_cache.DONE).exists()]


def incomplete(cache: Path) -> list[str]:
    """Forms that are kept and that FFCx would wait for; what was not tidied up."""
    (kept,) = cache.glob("tireroad/forms-*")
    forms = form_cache._forms(kept)
    return [path.name for path in kept.iterdir() if path.name.partition(".")[0] not in forms]


def compilers(folder: Path) -> list[str]:
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            text = entry.read_bytes()
        except OSError:
            continue
        if os.fsencode(folder) in text:
            found.append(text.decode(errors="replace"))
    return found


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "processes"), [(signal.SIGKILL, 1), (signal.SIGTERM, 1), (signal.SIGTERM, 2)]
)
def test_stopped_while_compiling(tmp_path: Path, number: signal.Signals, processes: int) -> None:
    with start(tmp_path, processes) as process:
        while not (folders := compiling(tmp_path)):
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.005)
        process.send_signal(number)
        process.communicate(timeout=600)
    if number != signal.SIGKILL:
        assert process.returncode == 4 or (processes > 1 and process.returncode)
    if processes == 1 and number != signal.SIGKILL:
        assert compilers(folders[0]) == []
        assert incomplete(tmp_path) == []
    began = time.monotonic()
    for _ in range(2):
        with start(tmp_path) as again:
            out, error = again.communicate(timeout=600)
        assert (again.returncode, out) == (0, "compiled\n"), error
    assert time.monotonic() - began < 300, "it waited for the compilation that was stopped"
    if processes == 1:  # of a mpirun that was killed, the processes may still be there
        assert incomplete(tmp_path) == []


@pytest.mark.long
def test_forms_are_kept_and_used_again(tmp_path: Path) -> None:
    for _ in range(2):
        with start(tmp_path, 2) as process:
            out, error = process.communicate(timeout=600)
        assert process.returncode == 0, error
    libraries = list(tmp_path.glob("tireroad/*/*.so"))
    assert libraries and incomplete(tmp_path) == []
    assert len({path.stat().st_mtime_ns for path in libraries}) == len(libraries)
    before = {path: path.stat().st_mtime_ns for path in libraries}
    with start(tmp_path) as process:
        assert process.communicate(timeout=600)[0] == "compiled\n"
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_without_a_place_to_keep_forms_they_are_compiled_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with start(tmp_path / "file") as process:
        out, error = process.communicate(timeout=600)
    assert (process.returncode, out) == (0, "compiled\n"), error
    assert "XDG_CACHE_HOME" in error and "--out" not in error


def test_a_compiler_that_fails_is_named_with_its_folder() -> None:
    def make(folder: Path):
        raise OSError(28, "No space left on device", str(folder / "a.c"))

    with pytest.raises(InputError, match="XDG_CACHE_HOME"):
        form_cache.compiled(MPI.COMM_SELF, make)


def test_a_long_compilation_is_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    told = logging.Handler()
    monkeypatch.setattr(told, "emit", lambda record: said.append(record.getMessage()))
    monkeypatch.setattr(form_cache._LOG, "handlers", [told])
    monkeypatch.setattr(form_cache, "_PATIENCE", 0.05)
    form_cache._say_once.cache_clear()

    def make(folder: Path) -> str:
        (folder / "slow.c").touch()
        deadline = time.monotonic() + 60
        while not said and time.monotonic() < deadline:
            time.sleep(0.01)
        (folder / "slow.c").unlink()
        return "made"

    assert form_cache.compiled(MPI.COMM_SELF, make) == "made"
    assert len(said) == 1 and str(form_cache.kept_in()) in said[0]


def test_folders_without_a_lock_are_removed_when_nobody_makes_them(tmp_path: Path) -> None:
    """A process killed between making its folder and the lock in it; one that is just there; another machine's."""
    dead = subprocess.Popen(["true"])
    dead.wait()
    names = [form_cache.folder_prefix(n) + "x" for n in (dead.pid, os.getpid())]
    folders = [tmp_path / name for name in (*names, "run-elsewhere-12-x", "run-elsewhere-13-x")]
    for folder in folders:
        folder.mkdir()
    (folders[0] / "libffcx_forms_1.c").write_text("half a form")
    os.utime(folders[3], (1e9, 1e9))
    form_cache._sweep(tmp_path)
    assert [folder.exists() for folder in folders] == [False, True, True, False]


def test_a_user_s_options_that_may_not_be_looked_for_are_passed_over(tmp_path, monkeypatch) -> None:
    """FFCx failed in a home of another user; the advice to set XDG_CACHE_HOME had no effect."""

    def refused(path: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setenv("XDG_CONFIG_HOME", "")  # to be put back afterwards
    monkeypatch.delenv("XDG_CONFIG_HOME")
    form_cache._pass_over_options(tmp_path)
    assert "XDG_CONFIG_HOME" not in os.environ
    monkeypatch.setattr(form_cache.os, "stat", refused)
    form_cache._pass_over_options(tmp_path)
    assert os.environ["XDG_CONFIG_HOME"] == str(tmp_path)
