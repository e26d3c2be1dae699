"""A sweep through Slurm, or another queue by a template: scripts on disk, then submitted.

Members share stages through the cache in the sweep's folder. A first job computes one member of each
group that shares a static state and modes; an array job runs the rest when it has ended, and a last
job gathers.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.sweep.definition import Member, Sweep
from tireroad.runs.sweep.local import command

WARNING = 120  # s before the time limit at which a job is told to checkpoint
_DIRECTIVE = re.compile(r"[A-Za-z][A-Za-z0-9-]*")
SCRIPT = Template("""\
#!/bin/bash
#SBATCH --job-name=$name
#SBATCH --output=$logs/$name-%A_%a.txt
#SBATCH --ntasks=$processes
#SBATCH --signal=B:USR1@$warning
#SBATCH --requeue
$directives
# A warning before the time limit: the run writes a checkpoint, and the job is queued again.
export TIREROAD_CACHE=$cache OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
child=
again() { [ -n "$$child" ] && kill -USR1 "$$child"; }
trap again USR1
$body
wait "$$child"
status=$$?
while kill -0 "$$child" 2>/dev/null; do wait "$$child"; status=$$?; done
if [ "$$status" = 4 ]; then
    scontrol requeue "$${SLURM_ARRAY_JOB_ID:+$${SLURM_ARRAY_JOB_ID}_}$${SLURM_ARRAY_TASK_ID:-$$SLURM_JOB_ID}"
fi
exit "$$status"
""")


def write_scripts(
    sweep: Sweep, folder: Path, first: Sequence[Member], rest: Sequence[Member], source: Path
) -> dict[str, Path]:
    """The scripts of the jobs, by name: `first`, `rest` (where there are any) and `gather`."""
    scripts = {}
    for name, members in (("first", first), ("rest", rest)):
        if members:
            scripts[name] = _script(sweep, folder, name, _members(sweep, folder, members))
    again = [sys.executable, "-P", "-m", "tireroad.runs", "sweep", str(source.resolve())]
    body = f"{shlex.join([*again, '--out', str(folder.resolve()), '--gather'])} &\nchild=$!"
    scripts["gather"] = _script(sweep, folder, "gather", body, processes=1)
    return scripts


def submit(scripts: Mapping[str, Path], counts: Mapping[str, int]) -> dict[str, str]:
    """Hand the scripts to sbatch, each after the ones before; the job numbers by name."""
    jobs: dict[str, str] = {}
    for name, script in scripts.items():
        line = ["sbatch", "--parsable"]
        if name in counts:
            line.append(f"--array=1-{counts[name]}")
        if jobs:
            line.append(f"--dependency=afterany:{':'.join(jobs.values())}")
        try:
            done = subprocess.run([*line, str(script)], capture_output=True, text=True)
        except FileNotFoundError:
            raise InputError(
                f"sweep: sbatch is not on this machine; the scripts are in {script.parent}"
            ) from None
        if done.returncode:
            raise ConvergenceError(f"sweep: {' '.join(line)} {script}: {done.stderr.strip()}")
        jobs[name] = done.stdout.strip().partition(";")[0]
    return jobs


def _script(sweep: Sweep, folder: Path, name: str, body: str, processes: int | None = None) -> Path:
    """Write one job script; its path."""
    jobs = folder / "jobs"
    jobs.mkdir(parents=True, exist_ok=True)
    text = SCRIPT.substitute(
        name=f"{sweep.name}-{name}",
        logs=shlex.quote(str(jobs.resolve())),
        processes=processes or sweep.processes,
        warning=WARNING,
        directives=_directives(sweep.slurm),
        cache=shlex.quote(str((folder / "cache").resolve())),
        body=body,
    )
    path = jobs / f"{name}.sh"
    write_text(path, text)
    path.chmod(0o755)
    return path


def _directives(given: Mapping[str, Any]) -> str:
    """The lines of the [slurm] table: account, partition, time, ..."""
    lines = []
    for key, value in given.items():
        if not _DIRECTIVE.fullmatch(key) or "\n" in str(value):
            raise InputError(f"sweep: slurm.{key} = {value!r} is no option of sbatch on one line")
        lines.append(f"#SBATCH --{key}={value}")
    return "\n".join(lines)


def _members(sweep: Sweep, folder: Path, members: Sequence[Member]) -> str:
    """The shell's choice of a member by the number of its task in the array."""
    lines = ['case "$SLURM_ARRAY_TASK_ID" in']
    for number, member in enumerate(members, start=1):
        lines.append(f"{number}) {shlex.join(command(sweep, member, folder))} & ;;")
    return "\n".join([*lines, "esac", "child=$!"])
