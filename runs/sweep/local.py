"""Members of a sweep on this machine: so many at a time as cores and memory allow."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tireroad.runs.process import observe
from tireroad.runs.process.memory import available_memory
from tireroad.runs.scene.extent.estimate import memory
from tireroad.runs.sweep.definition import Member, Sweep

_LOOK = 0.5  # s between two looks at the running members
_OUTCOME = {0: "done", 2: "its input is wrong", 3: "a solver gave up", 4: "stopped"}


@dataclass
class Ended:
    """How a member ended: exit status, seconds, and the last line that it said."""

    member: Member
    status: int
    seconds: float
    said: str

    @property
    def line(self) -> str:
        """One line for the user."""
        outcome = _OUTCOME.get(self.status, f"crashed (status {self.status}): a bug")
        more = f": {self.said}" if self.status else ""
        return f"{self.member.name}: {outcome} after {observe.seconds(self.seconds)}{more}"


def at_once(sweep: Sweep, wanted: int) -> tuple[int, str]:
    """How many members run at a time, and what limits it when it is fewer than wanted."""
    cores = os.cpu_count() or 1
    largest = max(sum(memory(sweep.load(member)).values()) for member in sweep.members)
    room = int(available_memory() // (largest * sweep.processes))
    allowed = {"cores": max(cores // sweep.processes, 1), "memory": max(room, 1)}
    limit = min(allowed, key=lambda name: allowed[name])
    if allowed[limit] >= wanted:
        return wanted, ""
    return allowed[limit], f"{limit}: {allowed[limit]} of the {wanted} wanted"


def run(sweep: Sweep, folder: Path, at_a_time: int) -> list[Ended]:
    """Run every member into folder/members/<name>; how each ended, in the order of the sweep.

    The members share a cache of finished stages, so that what has the same inputs is computed once: a
    member waits while another computes what it needs. A stop signal ends all of them.
    """
    waiting = list(sweep.members)
    running: list[_Running] = []
    ended: list[Ended] = []
    threads = max((os.cpu_count() or 1) // (at_a_time * sweep.processes), 1)
    try:
        while waiting or running:
            while waiting and len(running) < at_a_time:
                running.append(_Running(sweep, waiting.pop(0), folder, threads))
            time.sleep(_LOOK)
            for one in [one for one in running if one.process.poll() is not None]:
                running.remove(one)
                ended.append(one.ended())
                observe.say(f"  [{len(ended)}/{len(sweep.members)}] {ended[-1].line}")
    finally:
        for one in running:
            one.process.terminate()
        for one in running:
            one.process.wait()
    order = {member.name: k for k, member in enumerate(sweep.members)}
    return sorted(ended, key=lambda one: order[one.member.name])


class _Running:
    """A member's process."""

    def __init__(self, sweep: Sweep, member: Member, folder: Path, threads: int) -> None:
        self.member, self._began = member, time.monotonic()
        self._log = folder / "logs" / f"{member.name}.txt"
        self._log.parent.mkdir(parents=True, exist_ok=True)
        settings = {
            "TIREROAD_CACHE": str((folder / "cache").resolve()),
            "OPENBLAS_NUM_THREADS": str(threads),
            "OMP_NUM_THREADS": str(threads),
        }
        with self._log.open("wb") as log:
            self.process = subprocess.Popen(
                command(sweep, member, folder),
                env={**os.environ, **settings},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def ended(self) -> Ended:
        text = self._log.read_text(encoding="utf-8", errors="replace").strip()
        said = text.splitlines()[-1] if text else ""
        return Ended(self.member, self.process.returncode, time.monotonic() - self._began, said)


def command(sweep: Sweep, member: Member, folder: Path) -> list[str]:
    """The command line of one member's run."""
    program = [sys.executable, "-P", "-m", "tireroad.runs", "run", str(sweep.scene.resolve())]
    if sweep.processes > 1:
        program = ["mpirun", "-n", str(sweep.processes), *program]
    settings: Sequence[str] = [part for one in member.overrides() for part in ("--set", one)]
    return [*program, "--out", str(folder / "members" / member.name), *settings]
