"""Submits a sweep to Slurm, or through a template to another batch system, as job scripts.

Members share stages through the cache in the sweep's folder. The first job computes one member of
each group that shares a static state and modes; after it, array jobs run the rest, and a last job
gathers.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.sweep.definition import Sweep
from tireroad.runs.sweep.local import command
from tireroad.runs.sweep.members import Member

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
        given = dict(sweep.queue)
        if not given:
            return cls(directives=sweep.slurm)
        missing, unknown = sorted(_TABLE - given.keys()), sorted(given.keys() - _TABLE - _MORE)
        if missing or unknown:
            wrong = f"needs {missing[0]}" if missing else f"has no key {unknown[0]}"
            raise InputError(
                f"sweep: [queue] {wrong}; its keys are {', '.join(sorted(_TABLE | _MORE))}"
            )
        path = sweep.folder / str(given["template"])
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"sweep: queue.template {path} cannot be read: {error}") from None
        if not _has_group(str(given.get("number", cls.number))):
            raise InputError(
                f"sweep: queue.number = {given['number']!r} is no pattern with a group in round brackets, as in "
                '"Job <([0-9]+)>"'
            )
        words: dict[str, Any] = {key: str(value) for key, value in given.items()}
        found = cls(**words | {"template": text})
        try:
            found.submission(path, 1, ["1"])
        except (LookupError, ValueError) as error:
            raise InputError(
                f"sweep: [queue] submit, array or after is no command line with {{count}} and {{jobs}} in their places: {error!r}"
            ) from None
        return found

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
        found = re.search(self.number, said)
        if found is None:
            raise ConvergenceError(
                f"sweep: {self.submit} printed {said.strip()!r}, in which queue.number = {self.number!r} finds no job"
            )
        return found.group(1)


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
    """What to do about the jobs before one that was refused."""
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


def _directives(given: Mapping[str, Any]) -> str:
    """The lines of the [slurm] table: account, partition, time, ...; a flag is true or false."""
    lines = []
    for key, value in given.items():
        if key in _OWN:
            advice = "give processes" if key == "ntasks" else "leave it out"
            raise InputError(f"sweep: slurm.{key} is set by the program: {advice}")
        line = "\n" not in str(value) and not isinstance(value, list | dict)
        if not _DIRECTIVE.fullmatch(key) or not line:
            raise InputError(f"sweep: slurm.{key} = {value!r} is no option of sbatch on one line")
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
