"""Streams, paths, folders and limits that are not as a program would like them."""

import errno
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from started import ROOT, environment
from tires import soft_torus

from tireroad.runs import start
from tireroad.runs.cli import main
from tireroad.runs.stages.modes import ModesStage

pytestmark = pytest.mark.slow

PROGRAM = [sys.executable, "-P", "-m", "runs"]
LONG = 600

SCENE = (
    """
name = "odd"
"""
    + soft_torus(12, 4)
    + """[static]
deflection = 0.002
error_estimate = false
[modal]
count = 4
"""
)
ROLLING = """
[rotation]
speed = 30.0
[contact]
youngs_modulus = 2e7
[road]
kind = "flat"
[time]
duration = 60.0
step = 1e-5
checkpoint = 0.2
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def shell(line: str, *arguments: object, **options) -> subprocess.CompletedProcess:
    """A line of sh in which "$@" is `python3 -m runs` and the arguments."""
    command = ["sh", "-c", line, "sh", *PROGRAM, *map(os.fspath, arguments)]
    options.setdefault("env", environment())
    return subprocess.run(command, capture_output=True, timeout=LONG, **options)


@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", ">/dev/full 2>/dev/full"])
def test_a_run_goes_on_without_its_streams(scene: Path, closed: str) -> None:
    out = scene.parent / "out"
    done = shell(f'"$@" {closed}', "run", scene, "--out", out)
    assert done.returncode == 0
    log = (out / "log.txt").read_text()
    assert "static    done" in log and "modes     done" in log and "report    done" in log
    assert "static    solver: Newton's method" in log and "modes     solver: block Lanczos" in log


def test_a_run_goes_on_when_its_reader_has_gone(scene: Path) -> None:
    out = scene.parent / "out"
    line = '{ "$@"; echo $? > status; } | head -n 1'
    done = shell(line, "run", scene, "--out", out, "--until", "static", cwd=scene.parent)
    assert (scene.parent / "status").read_text() == "0\n", done.stderr
    assert "static    done" in (out / "log.txt").read_text()
    assert b"Traceback" not in done.stderr and b"BrokenPipe" not in done.stderr


@pytest.mark.parametrize("arguments", [["--help"], ["check", "scene.toml"]])
def test_short_commands_end_quietly_in_a_pipe(scene: Path, arguments: list[str]) -> None:
    line = '{ "$@"; echo $? > status; } | true'
    done = shell(line, *arguments, cwd=scene.parent)
    assert (scene.parent / "status").read_text() == "0\n"
    assert done.stderr == b""


def test_output_that_is_lost_is_an_error_where_it_is_all_there_is(scene: Path) -> None:
    done = shell('"$@" >/dev/full', "check", scene)
    assert done.returncode == 2 and b"standard output cannot be written" in done.stderr


@pytest.mark.long
@pytest.mark.parametrize("locale", [{}, {"LC_ALL": "C", "PYTHONUTF8": "0"}])
def test_paths_that_are_not_text(scene: Path, locale: dict[str, str]) -> None:
    out = os.fsencode(scene.parent) + b"/o\xff\xfe \xc3\xa4"
    command = [*PROGRAM, "run", scene, "--out", out, "--until", "modes"]
    env = environment(**locale)
    for words in (b"static    done", b"modes     reused"):
        done = subprocess.run(command, capture_output=True, env=env, timeout=LONG)
        assert done.returncode == 0, done.stderr
        assert words in done.stdout
    for line in (["resume", out], ["info", out + b"/static.h5"], ["export", out], ["report", out]):
        done = subprocess.run([*PROGRAM, *line], capture_output=True, env=env, timeout=LONG)
        assert done.returncode == 0, done.stderr


@pytest.mark.long
@pytest.mark.parametrize("processes", [1, 2])
def test_result_folder_removed_under_a_run(scene: Path, processes: int) -> None:
    scene.write_text(SCENE + ROLLING)
    out = scene.parent / "out"
    command = [ROOT / "tireroad", "run", scene, "--out", out, "-n", str(processes)]
    with subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        while not (out / "checkpoint.h5").exists():
            assert process.poll() is None
            time.sleep(0.05)
        shutil.rmtree(out, ignore_errors=True)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 3, error
    assert "was removed during the run" in error and "Traceback" not in error


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_disk_that_refuses_keeps_what_is_finished(
    scene: Path, number: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    """Full or read-only in the middle of modes.h5: status 3; the same command continues from the static state."""

    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    out = scene.parent / "out"
    run = ["run", str(scene), "--out", str(out), "--until", "modes"]
    with monkeypatch.context() as patched:
        patched.setattr(ModesStage, "write", refuse)
        assert main(run) == 3
    told = capsys.readouterr().err
    assert "modes.h5: cannot be written" in told and "Traceback" not in told
    assert not (out / "modes.h5").exists() and not list(out.glob(".*.part"))
    assert main(run) == 0
    assert "static    reused" in (out / "log.txt").read_text()


def test_working_folder_that_is_gone(scene: Path) -> None:
    gone = scene.parent / "gone"
    gone.mkdir()
    done = shell('rmdir "$PWD"; "$@"', "run", scene, "--out", scene.parent / "out", cwd=gone)
    assert done.returncode == 2 and b"working folder was removed" in done.stderr


def test_working_folder_is_no_place_for_results(scene: Path) -> None:
    mine = scene.rename(scene.with_name("mine.toml"))
    for out, words in (("", b"is empty"), (".", b"folder of their own")):
        done = shell('"$@"', "run", mine, "--out", out, cwd=scene.parent)
        assert done.returncode == 2 and words in done.stderr
    assert [path.name for path in scene.parent.iterdir()] == ["mine.toml"]


def test_a_link_in_place_of_the_log_is_not_followed(scene: Path) -> None:
    out, other = scene.parent / "out", scene.parent / "other.txt"
    out.mkdir()
    other.write_text("mine")
    (out / "log.txt").symlink_to(other)
    done = shell('"$@"', "run", scene, "--out", out, "--until", "static")
    assert done.returncode == 0, done.stderr
    assert other.read_text() == "mine" and "static    done" in (out / "log.txt").read_text()


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('ulimit -v 600000; "$@"', b"ulimit -v"),
        ('ulimit -f 100; "$@"', b"ulimit -f"),
    ],
)
def test_tight_limits_are_named(scene: Path, line: str, words: bytes) -> None:
    done = shell(line, "run", scene, "--out", scene.parent / "out")
    assert done.returncode == 2 and words in done.stderr, done.stderr


@pytest.mark.parametrize("package", ["numpy", "mpi4py", "dolfinx"])
def test_a_missing_package_is_one_line(scene: Path, package: str) -> None:
    code = f"""
import sys
sys.modules[{package!r}] = None
sys.argv = ["tireroad", "run", {str(scene)!r}, "--out", {str(scene.parent / "out")!r}]
from tireroad.runs.start import program
program()
"""
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, capture_output=True, env=environment(), timeout=LONG, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert f"the Python package {package} is missing" in done.stderr


def test_a_folder_of_temporary_files_that_is_not_there_is_named(scene: Path) -> None:
    """MPI ended with status 1 and five lines of its own."""
    missing = environment() | {"TMPDIR": str(scene.parent / "nosuch")}
    ended = shell('exec "$@"', "run", scene, cwd=scene.parent, env=missing)
    assert ended.returncode == 2
    assert ended.stderr.decode().startswith("error: TMPDIR = ") and b"nosuch" in ended.stderr


def test_without_a_home_a_temporary_folder_takes_its_place(monkeypatch) -> None:
    """dolfinx cannot be imported without one (docker run --user with a number that has no name)."""
    monkeypatch.setenv("HOME", "/somewhere")
    start._need_home()
    assert os.environ["HOME"] == "/somewhere"
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    start._need_home()
    assert os.environ["HOME"].endswith(f"tireroad-{os.getuid()}")
