"""Runs the members of a sweep on this machine, as many at a time as cores and memory allow."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from tireroad.runs.process import observe
from tireroad.runs.process.memory import available_memory
from tireroad.runs.scene.extent.estimate import memory
from tireroad.runs.stages.base import failed
from tireroad.runs.sweep.definition import Sweep
from tireroad.runs.sweep.members import Member

_LOOK = 0.5  # s between two checks of the running members
_OUTCOME = {0: "done", 2: "its input is wrong", 3: "a solver gave up", 4: "stopped"}


@dataclass
class Ended:
    """The outcome of a member: exit status, seconds, and its last line of output."""

    member: Member
    status: int
    seconds: float
    said: str

    @property
    def line(self) -> str:
        """The outcome in one line."""
        outcome = _OUTCOME.get(self.status, f"crashed (status {self.status}): a bug")
        more = f": {self.said}" if self.status else ""
        return f"{self.member.name}: {outcome} after {observe.seconds(self.seconds)}{more}"


def at_once(sweep: Sweep, wanted: int) -> tuple[int, str]:
    """How many members run at a time, and what limits it if fewer than wanted."""
    cores = os.cpu_count() or 1
    largest = max(sum(memory(sweep.load(member)).values()) for member in sweep.members)
    room = int(available_memory() // (largest * sweep.processes))
    allowed = {"cores": max(cores // sweep.processes, 1), "memory": max(room, 1)}
    limit = min(allowed, key=lambda name: allowed[name])
    if allowed[limit] >= wanted:
        return wanted, ""
    return allowed[limit], f"{limit}: {allowed[limit]} of the {wanted} wanted"


def run(sweep: Sweep, folder: Path, at_a_time: int) -> list[Ended]:
    """Run every member into folder/members/<name>; returns the outcomes in the sweep's order.

    Each of the workers (runs.sweep.worker) takes one member after the other. They share a cache of
    finished stages, so that equal inputs are computed once: a member waits while another computes
    what it needs. What fails is not tried again for another member with the same inputs. A worker
    that crashes is replaced; a stop signal ends all of them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix="failures-", dir=folder) as failures:
        return _run(sweep, folder, at_a_time, Path(failures))


def _run(sweep: Sweep, folder: Path, at_a_time: int, failures: Path) -> list[Ended]:
    """As `run`; stages that fail are noted in the empty folder `failures`."""
    waiting = list(sweep.members)
    workers: list[_Worker] = []
    started = 0
    ended: list[Ended] = []
    try:
        while waiting or any(one.member for one in workers):
            for one in [one for one in workers if one.crashed]:
                workers.remove(one)
                one.close()
            while waiting and len(workers) < at_a_time:
                started += 1
                workers.append(_Worker(sweep, folder, started, failures))
            for one in workers:
                if not one.member and waiting:
                    one.take(waiting.pop(0))
            time.sleep(_LOOK)
            for one in workers:
                if (how := one.ended()) is not None:
                    ended.append(how)
                    observe.say(f"  [{len(ended)}/{len(sweep.members)}] {how.line}")
    finally:
        for one in workers:
            one.end()
        for one in workers:
            one.close()
    order = {member.name: k for k, member in enumerate(sweep.members)}
    return sorted(ended, key=lambda one: order[one.member.name])


class _Worker:
    """A process, or mpirun with several, that computes one `member` at a time; None when idle."""

    def __init__(self, sweep: Sweep, folder: Path, number: int, failures: Path) -> None:
        self.member: Member | None = None
        self._sweep, self._folder, self._logs = sweep, folder, folder / "logs"
        self._logs.mkdir(parents=True, exist_ok=True)
        settings = {
            "TIREROAD_CACHE": str((folder / "cache").resolve()),
            failed.VARIABLE: str(failures.resolve()),
            "OPENBLAS_NUM_THREADS": "1",  # as a run alone: runs.start
            "OMP_NUM_THREADS": "1",
        }
        self._own = self._logs / f"worker-{number}.txt"  # output outside members
        with self._own.open("wb") as own:
            self.process = subprocess.Popen(
                _program(sweep, "work"),
                env={**os.environ, **settings},
                stdin=subprocess.PIPE,
                stdout=own,
                stderr=subprocess.STDOUT,
            )

    def take(self, member: Member) -> None:
        """Start a member."""
        self.member, self._began = member, time.monotonic()
        self._log, self._status = (self._logs / f"{member.name}.{end}" for end in ("txt", "status"))
        self._log.write_bytes(b"")
        self._status.unlink(missing_ok=True)
        files = {"log": str(self._log.resolve()), "status": str(self._status.resolve())}
        line = json.dumps({"run": _arguments(self._sweep, member, self._folder), **files})
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):  # it has crashed, which `ended` detects
            self.process.stdin.write(f"{line}\n".encode())
            self.process.stdin.flush()

    def ended(self) -> Ended | None:
        """The outcome of the current member once it has ended, else None."""
        if self.member is None:
            return None
        crashed = self.process.poll()
        if self._status.is_file():
            status, said = int(self._status.read_text(encoding="ascii")), _last(self._log)
            self._status.unlink()
        elif crashed is not None:
            status, said = crashed, _last(self._own) or _last(self._log)
        else:
            return None
        member, self.member = self.member, None
        return Ended(member, status, time.monotonic() - self._began, said)

    @property
    def crashed(self) -> bool:
        """Whether it has exited and the outcome of its last member is known."""
        return self.member is None and self.process.poll() is not None

    def end(self) -> None:
        """Take no more members; the current one is stopped."""
        if self.member is not None:
            self.process.terminate()
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            self.process.stdin.close()

    def close(self) -> None:
        """Wait for the process to exit."""
        self.end()
        self.process.wait()


def _last(log: Path) -> str:
    """The last line of a log."""
    text = log.read_text(encoding="utf-8", errors="replace").strip()
    return text.splitlines()[-1] if text else ""


def command(sweep: Sweep, member: Member, folder: Path) -> list[str]:
    """The command line that runs one member on its own."""
    return _program(sweep, *_arguments(sweep, member, folder))


def _program(sweep: Sweep, *arguments: str) -> list[str]:
    """The program's command line on the processes of one run."""
    line = [sys.executable, "-P", "-m", "tireroad.runs", *arguments]
    return ["mpirun", "-n", str(sweep.processes), *line] if sweep.processes > 1 else line


def _arguments(sweep: Sweep, member: Member, folder: Path) -> list[str]:
    """The program's arguments for one member's run."""
    settings: Sequence[str] = [part for one in member.overrides() for part in ("--set", one)]
    out = str(folder / "members" / member.name)
    return ["run", str(sweep.scene.resolve()), "--out", out, *settings]
