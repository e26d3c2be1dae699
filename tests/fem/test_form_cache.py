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


AHEAD = """
import sys
import numpy as np
import tireroad
import ufl
from mpi4py import MPI
from tireroad.fem import compat, form_cache
from tireroad.fem.errors import InputError

# Eight cubes in a row, of the root process.
points = np.stack(np.meshgrid([0.0, 1.0], [0.0, 1.0], np.arange(9.0), indexing="ij"), -1).reshape(-1, 3)
first = np.arange(8)[:, None] + 9 * np.array([0, 2, 1, 3])
cells = np.concatenate([first, first + 1], axis=1)[: 8 if MPI.COMM_WORLD.rank == 0 else 0]
points = points[: len(points) if MPI.COMM_WORLD.rank == 0 else 0]
space = compat.vector_space(compat.create_mesh(MPI.COMM_WORLD, cells, points, 1), 2)

def laplace():
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    return ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx

compat.begin_form(laplace())
"""
USED = """
begun = MPI.COMM_WORLD.bcast(len(form_cache._begun))
if "late" in sys.argv:
    for process in form_cache._begun.values():
        process.wait()
compat.form(laplace())
compat.begin_form(laplace())
MPI.COMM_WORLD.Barrier()
if MPI.COMM_WORLD.rank == 0:
    print(begun, len(form_cache._begun), flush=True)
"""


def ahead(tmp_path: Path, code: str, compiler: str, processes: int = 1, *given: str):
    """A program that begins a form, by a compiler that writes down its work into a file `done`."""
    (tmp_path / "cc").write_text(f"#!/bin/sh\necho $* >>{tmp_path}/done\n{compiler}\n")
    (tmp_path / "cc").chmod(0o755)
    command = [sys.executable, "-P", "-c", AHEAD + code, *given]
    if processes > 1:
        command = ["mpirun", "-n", str(processes), *command]
    own = environment(XDG_CACHE_HOME=str(tmp_path), CC=str(tmp_path / "cc"))
    return subprocess.run(command, env=own, capture_output=True, text=True, timeout=600)


@pytest.mark.parametrize("processes", [1, 2, 3])
@pytest.mark.parametrize("given", ["early", "late"])
def test_a_form_begun_ahead_is_compiled_once(tmp_path: Path, processes: int, given: str) -> None:
    """Asked for while its compiler is at work, and after; asked for ahead again, it is there."""
    found = ahead(tmp_path, USED, 'exec gcc "$@"', processes, given)
    assert (found.returncode, found.stdout) == (0, "1 0\n"), found.stderr
    done = [line for line in (tmp_path / "done").read_text().splitlines() if "ffcx_forms" in line]
    assert len(done) == 1 and "-g" not in done[0].split()
    assert incomplete(tmp_path) == []
    assert list(tmp_path.glob("tireroad/forms-*/libffcx_forms*.so"))


@pytest.mark.parametrize("processes", [1, 2])
def test_what_fails_ahead_is_told_when_it_is_asked_for(tmp_path: Path, processes: int) -> None:
    code = "try: compat.form(laplace())\nexcept InputError as error: print('told', flush=True)"
    broken = 'case "$*" in *ffcx_forms*) exit 1;; esac\nexec gcc "$@"'
    found = ahead(tmp_path, code, broken, processes)
    said = found.stdout.replace("\n", "")  # lines of two processes run into each other
    assert (found.returncode, said) == (0, "told" * processes), found.stderr


@pytest.mark.parametrize(
    "ending", ["", "raise KeyboardInterrupt", "import os; os.kill(os.getpid(), 9)"]
)
def test_compilers_at_work_end_with_the_program(tmp_path: Path, ending: str) -> None:
    """Whatever its end; those of a program that was killed by the next one."""
    endless = 'case "$*" in *ffcx_forms*) while :; do sleep 0.1; done;; esac\nexec gcc "$@"'
    began = time.monotonic()
    ahead(tmp_path, ending, endless)
    assert time.monotonic() - began < 300
    left = compilers(tmp_path / "tireroad")
    assert len(left) == (1 if "kill" in ending else 0)
    found = ahead(tmp_path, USED, 'exec gcc "$@"')
    assert found.returncode == 0, found.stderr
    assert compilers(tmp_path / "tireroad") == [] and incomplete(tmp_path) == []
