"""The command `sweep`: runs all members, here or in a batch system; writes a table and a page.

Members share stages through the cache in the sweep's folder. The first job computes one member of
each group that shares a static state and modes; after it, array jobs run the rest, and a last job
gathers.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from typing import Any

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import held
from tireroad.runs.files.store import stage_hash
from tireroad.runs.process import console
from tireroad.runs.process.surroundings import available_memory
from tireroad.runs.scene.estimate import memory
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.failures import FAILURES
from tireroad.runs.sweep.definition import Member, Sweep, read
from tireroad.runs.sweep.page import gather, write, write_page

_LOOK = 0.5  # s between two checks of the running members
_OUTCOME = {0: "done", 2: "its input is wrong", 3: "a solver gave up", 4: "stopped"}
MOST = 1000  # tasks of an array job: Slurm's own limit unless a cluster sets another (MaxArraySize)
WARNING = 120  # s before the time limit at which a job is signalled to write a checkpoint
_DIRECTIVE = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
SLURM = """\
#!/bin/bash
#SBATCH --job-name=$name
#SBATCH --output=$logs/$name-%j.txt
#SBATCH --open-mode=append
#SBATCH --ntasks=$processes
#SBATCH --signal=B:USR1@$warning
#SBATCH --requeue
$directives
# A warning before the time limit: the run writes a checkpoint, and the job is queued again.
export TIREROAD_CACHE=$cache OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
child=
again() { [ -n "$$child" ] && kill -USR1 "$$child"; }
trap again USR1 TERM
$body
wait "$$child"
status=$$?
while kill -0 "$$child" 2>/dev/null; do wait "$$child"; status=$$?; done
if [ "$$status" = 4 ]; then
    scontrol requeue "$${SLURM_ARRAY_JOB_ID:+$${SLURM_ARRAY_JOB_ID}_}$${SLURM_ARRAY_TASK_ID:-$$SLURM_JOB_ID}"
fi
exit "$$status"
"""
_OWN = {"array", "dependency", "job-name", "ntasks", "open-mode", "output", "requeue", "signal"}
_TABLE = {"template", "task", "submit", "array", "after"}
_MORE = {"number", "join"}


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
        return f"{self.member.name}: {outcome} after {console.seconds(self.seconds)}{more}"


def concurrent(sweep: Sweep, processes: int) -> tuple[int, str]:
    """How many members run at a time, and what limits it if fewer than wanted."""
    cores = os.cpu_count() or 1
    largest = max(sum(memory(sweep.load(member)).values()) for member in sweep.members)
    room = int(available_memory() // (largest * sweep.processes))
    allowed = {"cores": max(cores // sweep.processes, 1), "memory": max(room, 1)}
    limit = min(allowed, key=lambda name: allowed[name])
    if allowed[limit] >= processes:
        return processes, ""
    return allowed[limit], f"{limit}: {allowed[limit]} of the {processes} wanted"


def run_members(sweep: Sweep, folder: Path, at_a_time: int) -> list[Ended]:
    """Run every member into folder/members/<name>; returns the outcomes in the sweep's order.

    Each of the workers (runs.sweep.worker) takes one member after the other. They share a cache of
    finished stages, so that equal inputs are computed once: a member waits while another computes
    what it needs. What fails is not tried again for another member with the same inputs. A worker
    that crashes is replaced; a stop signal ends all of them.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix="failures-", dir=folder) as failures:
        return _dispatch(sweep, folder, at_a_time, Path(failures))


def _dispatch(sweep: Sweep, folder: Path, at_a_time: int, failures: Path) -> list[Ended]:
    """As `run_members`; stages that fail are noted in the empty folder `failures`."""
    waiting = list(sweep.members)
    workers: list[_Worker] = []
    started = 0
    ended: list[Ended] = []
    try:
        while waiting or any(worker.member for worker in workers):
            for crashed in [worker for worker in workers if worker.crashed]:
                workers.remove(crashed)
                crashed.close()
            while waiting and len(workers) < at_a_time:
                started += 1
                workers.append(_Worker(sweep, folder, started, failures))
            for crashed in workers:
                if not crashed.member and waiting:
                    crashed.take(waiting.pop(0))
            time.sleep(_LOOK)
            for crashed in workers:
                if (how := crashed.ended()) is not None:
                    ended.append(how)
                    console.say(f"  [{len(ended)}/{len(sweep.members)}] {how.line}")
    finally:
        for crashed in workers:
            crashed.end()
        for crashed in workers:
            crashed.close()
    order = {member.name: k for k, member in enumerate(sweep.members)}
    return sorted(ended, key=lambda worker: order[worker.member.name])


class _Worker:
    """A process, or mpirun with several, that computes one `member` at a time; None when idle."""

    def __init__(self, sweep: Sweep, folder: Path, number: int, failures: Path) -> None:
        self.member: Member | None = None
        self._sweep, self._folder, self._logs = sweep, folder, folder / "logs"
        self._logs.mkdir(parents=True, exist_ok=True)
        settings = {
            "TIREROAD_CACHE": str((folder / "cache").resolve()),
            FAILURES: str(failures.resolve()),
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
    settings: Sequence[str] = [
        part for override in member.overrides() for part in ("--set", override)
    ]
    out = str(folder / "members" / member.name)
    return ["run", str(sweep.scene.resolve()), "--out", out, *settings]


@dataclass(frozen=True, kw_only=True)
class Queue:
    """Interface to a batch system, by default Slurm.

    `template`: text of a job script with $name, $logs, $processes, $cache, $directives, $warning
    and $body, which starts the run in the background and sets `child`. `task`: environment variable
    with the task number in an array. `submit`: the command; the group of the pattern `number` finds
    the job number in its output. `array` with {count}, `after` with {jobs}: its options; `join`
    separates the jobs.
    """

    template: str = SLURM
    task: str = "SLURM_ARRAY_TASK_ID"
    submit: str = "sbatch --parsable"
    array: str = "--array=1-{count}"
    after: str = "--dependency=afterany:{jobs}"
    number: str = "([^;\\s]+)"
    join: str = ":"
    directives: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, sweep: Sweep) -> Queue:
        """The batch system of the sweep's [queue] table, or Slurm with its [slurm] options."""
        values = dict(sweep.queue)
        if not values:
            return cls(directives=sweep.slurm)
        missing, unknown = sorted(_TABLE - values.keys()), sorted(values.keys() - _TABLE - _MORE)
        if missing or unknown:
            wrong = f"needs {missing[0]}" if missing else f"has no key {unknown[0]}"
            raise InputError(
                f"sweep: [queue] {wrong}; its keys are {', '.join(sorted(_TABLE | _MORE))}"
            )
        path = sweep.folder / str(values["template"])
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"sweep: queue.template {path} cannot be read: {error}") from None
        if not _has_group(str(values.get("number", cls.number))):
            raise InputError(
                f"sweep: queue.number = {values['number']!r} is not a pattern with a group in round brackets, as in "
                '"Job <([0-9]+)>"'
            )
        words: dict[str, Any] = {key: str(value) for key, value in values.items()}
        queue = cls(**words | {"template": text})
        try:
            queue.submission(path, 1, ["1"])
        except (LookupError, ValueError) as error:
            raise InputError(
                f"sweep: [queue] submit, array or after is not a command line with {{count}} and {{jobs}} in their places: {error!r}"
            ) from None
        return queue

    def submission(self, script: Path, count: int | None, before: Sequence[str]) -> list[str]:
        """The command line that submits a script as an array of `count` after jobs `before`."""
        line = shlex.split(self.submit)
        if count is not None:
            line += shlex.split(self.array.format(count=count))
        if before:
            line += shlex.split(self.after.format(jobs=self.join.join(before)))
        return [*line, str(script)]

    def numbered(self, said: str) -> str:
        """The job number in the output of `submit`. Raises ConvergenceError if there is none."""
        match = re.search(self.number, said)
        if match is None:
            raise ConvergenceError(
                f"sweep: {self.submit} printed {said.strip()!r}, in which queue.number = {self.number!r} finds no job"
            )
        return match.group(1)


def _has_group(pattern: str) -> bool:
    try:
        return re.compile(pattern).groups > 0
    except re.error:
        return False


@dataclass(frozen=True)
class Script:
    """A job script, and the `tasks` of its array; None if it is no array job."""

    path: Path
    tasks: int | None = None


def write_scripts(
    sweep: Sweep, folder: Path, first: Sequence[Member], rest: Sequence[Member], source: Path
) -> dict[str, Script]:
    """Write the job scripts; by name: `first`, `rest` (if there are any) and `gather`.

    More than `MOST` members are divided into several: `rest`, `rest-2`, ...
    """
    queue, scripts = Queue.of(sweep), {}
    for group, members in (("first", first), ("rest", rest)):
        for k in range(0, len(members), MOST):
            some, name = members[k : k + MOST], f"{group}-{k // MOST + 1}" if k else group
            body = _members(sweep, folder, some, queue.task)
            scripts[name] = Script(_script(sweep, folder, name, body, queue), len(some))
    again = [sys.executable, "-P", "-m", "tireroad.runs", "sweep", str(source.resolve())]
    body = f"{shlex.join([*again, '--out', str(folder.resolve()), '--gather'])} &\nchild=$!"
    scripts["gather"] = Script(_script(sweep, folder, "gather", body, queue, processes=1))
    return scripts


def submit(sweep: Sweep, scripts: Mapping[str, Script]) -> dict[str, str]:
    """Submit the scripts, each after the ones before; returns the job numbers by name."""
    queue = Queue.of(sweep)
    jobs: dict[str, str] = {}
    for name, script in scripts.items():
        line = queue.submission(script.path, script.tasks, list(jobs.values()))
        try:
            done = subprocess.run(line, capture_output=True, text=True)
        except FileNotFoundError:
            raise InputError(
                f"sweep: {line[0]} is not on this machine; the scripts are in {script.path.parent}"
            ) from None
        if done.returncode:
            raise ConvergenceError(
                f"sweep: {shlex.join(line)}: {done.stderr.strip()}{_submitted(jobs)}"
            )
        jobs[name] = queue.numbered(done.stdout)
    return jobs


def _submitted(jobs: Mapping[str, str]) -> str:
    """Advice on the jobs before one that was refused."""
    if not jobs:
        return ""
    told = ", ".join(f"{name} as job {job}" for name, job in jobs.items())
    return (
        f". Submitted before: {told}. Cancel them before the sweep is submitted again, which would compute their "
        "members twice; what they finish is kept"
    )


def _script(
    sweep: Sweep, folder: Path, name: str, body: str, queue: Queue, processes: int | None = None
) -> Path:
    """Write one job script; returns its path."""
    jobs = folder / "jobs"
    jobs.mkdir(parents=True, exist_ok=True)
    try:
        text = Template(queue.template).substitute(
            name=f"{sweep.name}-{name}",
            logs=shlex.quote(str(jobs.resolve())),
            processes=processes or sweep.processes,
            warning=WARNING,
            directives=_directives(queue.directives),
            cache=shlex.quote(str((folder / "cache").resolve())),
            body=_environment() + body,
        )
    except (KeyError, ValueError) as error:
        raise InputError(
            f"sweep: queue.template: {error}: $name, $logs, $processes, $cache, $directives, $warning and "
            "$body are filled in; write $$ for a dollar of the shell"
        ) from None
    path = jobs / f"{name}.sh"
    write_text(path, text)
    path.chmod(0o755)
    return path


def _directives(settings: Mapping[str, Any]) -> str:
    """The lines of the [slurm] table: account, partition, time, ...; a flag is true or false."""
    lines = []
    for key, value in settings.items():
        if key in _OWN:
            advice = "give processes" if key == "ntasks" else "leave it out"
            raise InputError(f"sweep: slurm.{key} is set by the program: {advice}")
        line = "\n" not in str(value) and not isinstance(value, list | dict)
        if not _DIRECTIVE.fullmatch(key) or not line:
            raise InputError(f"sweep: slurm.{key} = {value!r} is not a one-line option of sbatch")
        if value is not False:
            lines.append(f"#SBATCH --{key}" + ("" if value is True else f"={value}"))
    return "\n".join(lines)


def _environment() -> str:
    """Shell code by which a job finds the program where this process does."""
    paths = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    if not paths:
        return ""
    whole = os.pathsep.join(str(Path(path).resolve()) for path in paths)
    return f"export PYTHONPATH={shlex.quote(whole)}\n"


def _members(sweep: Sweep, folder: Path, members: Sequence[Member], task: str) -> str:
    """Shell code that selects a member by its task number in the array."""
    lines = [f'case "${{{task}:-1}}" in']
    for number, member in enumerate(members, start=1):
        lines.append(f"{number}) {shlex.join(command(sweep, member, folder.resolve()))} & ;;")
    return "\n".join([*lines, "esac", "child=$!"])


def sweep(path: Path, out: Path | None, *, at_once: int, batch: bool, only_gather: bool) -> None:
    """Run the sweep defined in a file. Not collective: members are separate processes.

    Raises ConvergenceError, after everything is gathered, if a member failed: the same command runs
    that member again and reuses what is finished.
    """
    family = read(path)
    folder = out or Path("results") / family.name
    with held(folder):
        if batch:
            _queue(family, folder, path)
        else:
            _run_here(family, folder, at_once, only_gather)


def _run_here(family: Sweep, folder: Path, at_once: int, only_gather: bool) -> None:
    """Run all members locally, unless only gathering, then write the table and the page."""
    failed: list[str] = []
    if not only_gather:
        number, limit = concurrent(family, at_once)
        if limit:
            console.say(f"{number} member(s) at a time, limited by {limit}")
        ended = run_members(family, folder, number)
        failed = [member.line for member in ended if member.status]
    _gather(family, folder, failed)
    if failed:
        raise ConvergenceError(
            f"sweep: {len(failed)} of {len(family.members)} members failed, see above. The "
            "others are kept; the same command runs these again"
        )


def _gather(family: Sweep, folder: Path, failed: Sequence[str]) -> None:
    """Write the table and the page of the available results."""
    table = gather(family, folder)
    write(table, folder)
    page = write_page(table, folder, family.name, failed)
    for name in table.missing:
        console.say(f"  {name}: no results of a finished run of this scene")
    console.say(f"{page} and sweep.csv, sweep.h5 beside it")


def _queue(family: Sweep, folder: Path, source: Path) -> None:
    """Write the job scripts and submit them."""
    first, rest = shared_first(family)
    scripts = write_scripts(family, folder, first, rest, source)
    for script in scripts.values():
        console.say(f"{script.path}")
    jobs = submit(family, scripts)
    console.say("submitted: " + ", ".join(f"{name} as job {job}" for name, job in jobs.items()))


def shared_first(family: Sweep) -> tuple[list[Member], list[Member]]:
    """(one member per group that shares its static state and modes, all others)."""
    seen: set[str] = set()
    first: list[Member] = []
    rest: list[Member] = []
    for member in family.members:
        key = _group(family.load(member))
        (rest if key in seen else first).append(member)
        seen.add(key)
    return first, rest


def _group(scene: Scene) -> str:
    """One key for everything that the static state and the modes depend on."""
    from mpi4py import MPI

    from tireroad.runs.stages.stage import Job
    from tireroad.runs.stages.static import StaticStage

    static = StaticStage(job=Job(scene, Path("."), MPI.COMM_SELF))
    return stage_hash({"static": static.inputs(), "modal": asdict(scene.modes)})
