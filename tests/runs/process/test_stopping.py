"""Every way to be stopped ends in time, with status 4 and nothing that is half written."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from started import ROOT, environment
from tires import soft_torus

pytestmark = pytest.mark.slow

PROGRAM = [sys.executable, "-P", "-m", "runs"]
LONG = 600  # s that the slowest machine may take

SCENE = (
    """
name = "stopped"
"""
    + soft_torus(12, 4)
    + """[static]
load = 300.0
[modal]
count = 8
[rotation]
speed = 30.0
[contact]
youngs_modulus = 2e7
[road]
kind = "sine"
amplitude = 1e-4
[time]
duration = 60.0
step = 1e-5
checkpoint = 3600.0
[output]
spectra = false
"""
)

DEAF = """
import os, sys
from tireroad.runs.process import supervisor
supervisor.PATIENCE = 1.0
supervisor.supervise()
name = f".a.h5.host.{os.getpid()}.part"
with open(name, "w"):
    print("begun", flush=True)
    sum(range(10**13))  # a library that does not come back to Python; signals are still blocked
"""

SWALLOWS = """
import os, sys, time
from tireroad.runs.process import signals, supervisor
supervisor.PATIENCE = 1.0
supervisor.supervise()
signals.stop_on_signals()
while True:
    try:
        print("begun", flush=True)
        time.sleep(3600)
    except:  # as a library that catches all
        pass
"""

DIES = """
import os, sys
from tireroad.runs.process import supervisor
supervisor.supervise()
os.kill(os.getpid(), int(sys.argv[1]))
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def begin(command: list, cwd: Path | None = None, **extra: str) -> subprocess.Popen:
    return subprocess.Popen(
        list(map(str, command)),
        cwd=cwd,
        env=environment(**extra),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=hears_hangups,
    )


def hears_hangups() -> None:
    """Whoever starts the suite by nohup has it ignore SIGHUP, and with it all that it starts."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def in_the_loop(process: subprocess.Popen, out: Path) -> None:
    """Wait until blocks of steps have been written: with the points, and no step, the file has 0.1 MB."""
    while not any(part.stat().st_size > 300_000 for part in out.glob(".contact.h5.*.part")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)


def processes_with(text: str) -> list[int]:
    """Processes whose command line has the text in it."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if os.fsencode(text) in entry.read_bytes():
                found.append(int(entry.parent.name))
        except OSError:
            pass
    return found


def until_caught(pid: int, number: signal.Signals) -> None:
    """Wait until a process has a handler of the signal."""
    for _ in range(200):
        caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text())
        if caught and int(caught[1], 16) >> (number - 1) & 1:
            return
        time.sleep(0.02)
    raise AssertionError(f"process {pid} does not catch {number.name}")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("after", [0.0, 0.05, 0.2, 0.8])
def test_in_the_first_second(scene: Path, number: signal.Signals, after: float) -> None:
    """From the launcher on: Python takes a while before it can hear anything."""
    with begin([ROOT / "tireroad", "run", scene, "--out", scene.parent / "o"]) as process:
        until_caught(process.pid, number)  # the shell's own first instruction sets its trap
        time.sleep(after)
        process.send_signal(number)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 4, error
    assert "Traceback" not in error


def test_a_request_that_the_parent_ignores_is_heard(scene: Path) -> None:
    """Signals that are ignored stay so in what a process starts: here they count all the same."""
    out = scene.parent / "ignored"
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        process = begin([*PROGRAM, "run", scene, "--out", out])
    finally:
        signal.signal(signal.SIGTERM, before)
    with process:
        in_the_loop(process, out)
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 4, error


def test_deaf_worker_is_ended(tmp_path: Path) -> None:
    with begin([sys.executable, "-P", "-c", DEAF], cwd=tmp_path) as process:
        assert process.stdout.readline() == "begun\n"
        assert len(list(tmp_path.iterdir())) == 1
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 4, error
    assert "stopped by SIGTERM in the middle of a library's work" in error
    assert list(tmp_path.iterdir()) == []


def test_a_request_that_a_library_swallows_ends_the_worker(tmp_path: Path) -> None:
    with begin([sys.executable, "-P", "-c", SWALLOWS], cwd=tmp_path) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 4, error
    assert "stopped by SIGTERM in the middle of a library's work" in error


@pytest.mark.parametrize(
    ("number", "status", "words"),
    [
        (signal.SIGKILL, 3, "out of memory"),
        (signal.SIGSEGV, 1, "crashed (SIGSEGV)"),
    ],
)
def test_a_worker_that_dies_is_explained(number: signal.Signals, status: int, words: str) -> None:
    with begin([sys.executable, "-P", "-c", DIES, int(number)]) as process:
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == status and words in error


def test_killed_supervisor_takes_its_worker_along(scene: Path) -> None:
    """The worker stops in order: the run can be resumed."""
    out = scene.parent / "killed"
    with begin([*PROGRAM, "run", scene, "--out", out]) as process:
        in_the_loop(process, out)
        process.kill()
        process.wait()
        _, error = process.communicate(timeout=LONG)  # ends when the worker has closed the pipe
    assert "stopped by SIGTERM" in error
    assert (out / "checkpoint.h5").exists()
    assert list(out.glob(".*.part")) == []


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGKILL])
def test_two_processes_and_their_launcher(scene: Path, number: signal.Signals) -> None:
    """A stop is status 4; a launcher that is killed leaves nothing running."""
    out = scene.parent / "parallel"
    command = [ROOT / "tireroad", "run", scene, "--out", out, "-n", "2"]
    with begin(command) as process:
        in_the_loop(process, out)
        process.send_signal(number)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == (-9 if number == signal.SIGKILL else 4), error
    assert (out / "checkpoint.h5").exists()
    deadline = time.monotonic() + 60
    while processes_with(str(out)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert processes_with(str(out)) == []


@pytest.mark.long
def test_mpirun_ends_with_four(scene: Path) -> None:
    """A batch script's own mpirun, without the launcher; it hands SIGUSR1 on."""
    out = scene.parent / "batch"
    with begin(["mpirun", "-n", "2", *PROGRAM, "run", scene, "--out", out]) as process:
        in_the_loop(process, out)
        process.send_signal(signal.SIGUSR1)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 4, error
    assert error.count("stopped by SIGUSR1") == 1
    assert (out / "checkpoint.h5").exists()


@pytest.mark.long
def test_one_request_by_several_ways_is_one(scene: Path) -> None:
    """`timeout` and terminals signal the supervisor and the worker: the checkpoint is written."""
    out = scene.parent / "group"
    command = ["timeout", "--signal=TERM", "3600", *PROGRAM, "run", scene, "--out", out]
    with begin(command) as process:
        in_the_loop(process, out)
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=LONG)
    assert (out / "checkpoint.h5").exists()


@pytest.mark.long
def test_nohup_is_respected(scene: Path) -> None:
    command = ["nohup", *PROGRAM, "run", scene, "--out", scene.parent / "o", "--until", "static"]
    with begin(command) as process:
        assert any("inflation" in line for line in process.stdout)
        process.send_signal(signal.SIGHUP)
        _, error = process.communicate(timeout=LONG)
    assert process.returncode == 0, error
