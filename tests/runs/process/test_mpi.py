"""All processes end together, with one message and one status, however they fail."""

import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from mpi4py import MPI
from started import environment

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs import cli
from tireroad.runs.process import mpi, signals
from tireroad.runs.process.signals import STOPPED

CASE = """
import sys, time
from mpi4py import MPI
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.process import mpi, signals

def fail(error):
    raise error

mpi.TOGETHER = 1.0
comm = MPI.COMM_WORLD
last = comm.rank == comm.size - 1
cases = {
    "none": lambda: comm.Barrier(),
    "all": lambda: fail(InputError("bad key")),
    "last": lambda: fail(InputError("bad key")) if last else comm.Barrier(),
    "most": lambda: fail(ConvergenceError("no luck")) if comm.rank else comm.Barrier(),
    "bug": lambda: fail(KeyError("odd")) if comm.rank == 0 else comm.Barrier(),
    "told": lambda: mpi.on_root(comm, lambda: fail(KeyError("odd"))),
    "full": lambda: fail(OSError(28, "No space left on device", "a.h5")),
    "wait": lambda: (print("begun", flush=True), time.sleep(60)),
}
signals.stop_on_signals()
with mpi.common_ending(comm) as end:
    cases[sys.argv[1]]()
sys.exit(end.status)
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 3])
@pytest.mark.parametrize(
    ("case", "status", "message"),
    [
        ("none", 0, ""),
        ("all", 2, "error: bad key\n"),
        ("last", 2, "error: bad key\n"),
        ("told", 1, "KeyError: 'odd'"),
        ("full", 3, "disk is full"),
    ],
)
def test_endings(launch, case: str, status: int, message: str, processes: int) -> None:
    done = launch("-c", CASE, case, processes=processes)
    assert done.returncode == status, done.stderr
    assert done.stderr.count(message) == 1 if message else done.stderr == ""
    assert done.stderr.count("Traceback") == (1 if status == 1 else 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "status", "message"),
    [("most", 3, "error: no luck\n"), ("bug", 1, "KeyError: 'odd'")],
)
def test_hanging_processes_are_ended(launch, case: str, status: int, message: str) -> None:
    began = time.monotonic()
    done = launch("-c", CASE, case, processes=3)
    # Two processes end it: MPICH's mpirun may give the status of the one that it killed meanwhile.
    killed = {9} if "MPICH" in MPI.Get_library_version() else set()
    assert done.returncode in {status} | killed, done.stderr
    assert done.stderr.count(message) == 1
    assert time.monotonic() - began < 600  # without an end to it, for ever


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_with_four(number: signal.Signals) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", CASE, "wait"],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(number)
        _, text = process.communicate(timeout=300)
    assert process.returncode == 4
    assert text.startswith(f"stopped by {number.name}") and "Traceback" not in text


@pytest.mark.mpi
def test_root_tells_all() -> None:
    comm = MPI.COMM_WORLD
    assert mpi.on_root(comm, lambda: comm.rank) == 0

    def fail(error: Exception):
        raise error

    for error in (InputError("bad key"), ConvergenceError("no luck")):
        with pytest.raises(type(error), match=str(error)):
            mpi.on_root(comm, lambda error=error: fail(error))
    unexpected = KeyError if comm.rank == 0 else mpi.FailedOnRoot
    with pytest.raises(unexpected):
        mpi.on_root(comm, lambda: fail(KeyError("odd")))


@pytest.mark.mpi
def test_all_here_sees_who_is_late() -> None:
    comm = MPI.COMM_WORLD.Dup()
    assert mpi.all_here(comm, 10.0)
    late = comm.rank == comm.size - 1
    if late:
        time.sleep(0.5)
    came = mpi.all_here(comm, None if late else 0.1)
    assert came is (late or comm.size == 1)


@pytest.mark.parametrize(("command", "words"), [("check", "begins again"), ("sweep", "resume")])
def test_a_stop_says_what_the_command_goes_on_from(monkeypatch, capsys, command, words) -> None:
    def stopped(args) -> None:
        raise signals.Stopped("SIGINT")

    monkeypatch.setitem(cli.COMMANDS, command, replace(cli.COMMANDS[command], alone=stopped))
    monkeypatch.setattr(signals, "stop_on_signals", lambda: None)
    assert cli.main([command, "any.toml"]) == STOPPED
    said = capsys.readouterr().err
    assert said.startswith("stopped by SIGINT: ") and words in said and len(said.splitlines()) == 1


@pytest.mark.mpi
def test_the_others_work_until_the_root_has_ended():
    comm, asked = MPI.COMM_WORLD, []

    def meanwhile(ended) -> None:
        began = time.monotonic()
        asked.append(ended())
        comm.send(None, 0)
        while not ended() and time.monotonic() - began < 30.0:
            time.sleep(0.01)
        asked.append(ended())

    def slow() -> int:
        for rank in range(1, comm.size):  # have all asked
            comm.recv(source=rank)
        return 7

    assert mpi.on_root_beside(comm, slow, meanwhile) == 7
    assert asked == ([False, True] if comm.rank else [])


@pytest.mark.mpi
def test_what_fails_on_the_root_fails_on_the_others_that_worked_meanwhile():
    comm = MPI.COMM_WORLD

    def fails() -> None:
        raise ConvergenceError("no luck")

    for _ in range(2):  # a notice that was left unread would end the second before it began
        with pytest.raises(ConvergenceError, match="no luck"):
            mpi.on_root_beside(comm, fails, lambda ended: None)
    assert not comm.iprobe(tag=mpi._ENDED)
