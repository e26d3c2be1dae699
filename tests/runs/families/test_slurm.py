"""A sweep through a real Slurm of one node: shared stages first, the rest after, a table at the end."""

from __future__ import annotations

import csv
import subprocess
import time
from pathlib import Path

import pytest
from one_node import ended, slurm
from started import ROOT, environment
from tires import soft_torus

import tireroad
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.sweep.command import Queue, _directives, _environment

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "base"
"""
    + soft_torus(12, 4, order=2)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 8
[rotation]
speed = 20.0
[contact]
tread = "winkler"
[road]
kind = "sine"
[time]
duration = {duration}
step = 1e-4
checkpoint = 3600.0
"""
)
FAMILY = """
scene = "base.toml"
[[axis]]
key = "road.amplitude"
values = [1e-4, 2e-4, 3e-4]
[slurm]
time = "00:30:00"
"""


@pytest.fixture(scope="module")
def queue(tmp_path_factory):
    with slurm(tmp_path_factory.mktemp("slurm")) as found:
        yield environment() | {k: found[k] for k in ("PATH", "SLURM_CONF")}


def family(folder: Path, duration: float) -> Path:
    (folder / "base.toml").write_text(SCENE.format(duration=duration))
    (folder / "family.toml").write_text(FAMILY)
    return folder / "family.toml"


@pytest.mark.long
def test_a_sweep_through_slurm(tmp_path: Path, launch, queue) -> None:
    out = tmp_path / "out"
    sweep = family(tmp_path, 0.01)
    done = launch("-m", "runs", "sweep", sweep, "--out", out, "--slurm", env=queue)
    assert done.returncode == 0, done.stderr
    assert "submitted: first as job" in done.stdout
    ended(queue, 600)
    with (out / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 and all(row["modes: lowest mode (Hz)"] for row in rows)
    assert len({row["modes: lowest mode (Hz)"] for row in rows}) == 1
    # One member computed what all share; the others, in a later job, took it.
    logs = [file.read_text() for file in sorted((out / "jobs").glob("*.txt"))]
    assert sum("modes     done" in text for text in logs) == 1
    assert sum("modes     reused" in text for text in logs) == 2


@pytest.mark.long
def test_a_warning_requeues_the_job_and_it_goes_on(tmp_path: Path, launch, queue) -> None:
    """Slurm's signal before the time limit, sent by hand: checkpoint, requeue, and the same end."""
    out = tmp_path / "out"
    sweep = family(tmp_path, 6.0)
    done = launch("-m", "runs", "sweep", sweep, "--out", out, "--slurm", env=queue)
    job = done.stdout.partition("first as job ")[2].partition(",")[0]
    member = out / "members" / "1_amplitude-0.0001"
    _until(lambda: "greens    done" in _said(out))
    subprocess.run(["scancel", "--batch", "--signal=USR1", f"{job}_1"], env=queue, check=True)
    _until(lambda: "Restarts=1" in _shown(queue, job))
    # Slurm waits two minutes; at once it would still refuse the credential of the job as it was.
    sooner = ["scontrol", "update", f"JobId={job}_1", "StartTime=now+4seconds"]
    subprocess.run(sooner, env=queue, check=True)
    assert "stopped by SIGUSR1" in _said(out)
    for name in ("family-rest", "family-gather"):
        subprocess.run(["scancel", f"--name={name}"], env=queue, check=True)
    ended(queue, 600)
    results = tireroad.load(member)
    assert len(results["contact/time"]) == 60000


TEMPLATE = """#!/bin/sh
#PBS -N $name
#PBS -l select=1:ncpus=$processes
export TIREROAD_CACHE=$cache
$body
wait "$$child"
"""
QUEUE = """
[queue]
template = "pbs.sh"
task = "PBS_ARRAY_INDEX"
submit = "./qsub -V"
array = "-J 1-{count}"
after = "-W depend=afterany:{jobs}"
"""
LSF = """
[queue]
template = "pbs.sh"
task = "LSB_JOBINDEX"
submit = "./bsub -W 2:00"
number = "Job <([0-9]+)>"
array = "-J tires[1-{count}]"
after = "-w 'ended({jobs})'"
join = ") && ended("
"""
SUBMIT = """#!/bin/sh
echo "$*" >> submitted.txt
"""
PRINTS = {
    "qsub": 'echo "$(wc -l < submitted.txt).server"',
    "bsub": 'echo "Job <$(wc -l < submitted.txt)> is submitted to queue <normal>."',
}
WANTED = {
    "qsub": [
        "-V -J 1-1 out/jobs/first.sh",
        "-V -J 1-2 -W depend=afterany:1.server out/jobs/rest.sh",
        "-V -W depend=afterany:1.server:2.server out/jobs/gather.sh",
    ],
    "bsub": [
        "-W 2:00 -J tires[1-1] out/jobs/first.sh",
        "-W 2:00 -J tires[1-2] -w ended(1) out/jobs/rest.sh",
        "-W 2:00 -w ended(1) && ended(2) out/jobs/gather.sh",
    ],
}


@pytest.mark.parametrize(("table", "name"), [(QUEUE, "qsub"), (LSF, "bsub")])
def test_another_queue_by_a_template(tmp_path: Path, launch, table: str, name: str) -> None:
    sweep = family(tmp_path, 0.01)
    sweep.write_text(sweep.read_text().partition("[slurm]")[0] + table)
    (tmp_path / "pbs.sh").write_text(TEMPLATE)
    (tmp_path / name).write_text(SUBMIT + PRINTS[name])
    (tmp_path / name).chmod(0o755)
    done = launch("-m", "runs", "sweep", sweep, "--out", "out", "--slurm", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "submitted.txt").read_text().splitlines() == WANTED[name]
    script = (tmp_path / "out/jobs/rest.sh").read_text()
    task = {"qsub": "PBS_ARRAY_INDEX", "bsub": "LSB_JOBINDEX"}[name]
    assert "#PBS -N family-rest" in script and task in script
    assert subprocess.run(["sh", "-n", str(tmp_path / "out/jobs/rest.sh")]).returncode == 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("task", "tasks"), "[queue] needs task"),
        (('"pbs.sh"', '"other.sh"'), "queue.template"),
        (("array", 'number = "[0-9]+"\narray'), "queue.number"),
        (("{count}", "{n}"), "queue] submit, array or after"),
        (("{count}", "{count"), "queue] submit, array or after"),
        (("{jobs}", "{jobs} '"), "queue] submit, array or after"),
    ],
)
def test_mistakes_in_a_queue(tmp_path: Path, launch, change, words) -> None:
    sweep = family(tmp_path, 0.01)
    sweep.write_text(sweep.read_text().partition("[slurm]")[0] + QUEUE.replace(*change))
    (tmp_path / "pbs.sh").write_text("$nothing")
    done = launch("-m", "runs", "sweep", sweep, "--out", tmp_path / "out", "--slurm")
    assert done.returncode == 2 and words in done.stderr


def test_options_of_sbatch(monkeypatch) -> None:
    """A flag was written as --exclusive=True; a second --signal would have replaced the program's."""
    given = {"time": "1:00", "exclusive": True, "hold": False}
    assert _directives(given) == "#SBATCH --time=1:00\n#SBATCH --exclusive"
    for key, told in (("signal", "leave it out"), ("ntasks", "give processes")):
        with pytest.raises(InputError, match=f"slurm.{key} is set by the program: {told}"):
            _directives({key: "4"})
    with pytest.raises(InputError, match="not a one-line option of sbatch"):
        _directives({"partition": ["a", "b"]})
    monkeypatch.setenv("PYTHONPATH", "/a b:/c")
    assert _environment() == "export PYTHONPATH='/a b:/c'\n"
    monkeypatch.delenv("PYTHONPATH")
    assert _environment() == ""


def test_a_queue_that_prints_no_number() -> None:
    assert Queue().numbered("31;cluster\n") == "31"
    with pytest.raises(ConvergenceError, match="finds no job"):
        Queue(number="Job <([0-9]+)>").numbered("out of licences")


def _said(out: Path) -> str:
    return "".join(file.read_text() for file in (out / "jobs").glob("*first*.txt"))


def _shown(queue, job: str) -> str:
    line = ["scontrol", "show", "job", f"{job}_1"]
    return subprocess.run(line, env=queue, capture_output=True, text=True).stdout


def _until(condition, seconds: float = 300) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.2)


@pytest.mark.long
def test_in_a_step_of_srun(tmp_path: Path, queue) -> None:
    """`srun --pty bash`: one process starts as in a plain shell, -n 2 by mpirun; several without MPI are told so."""
    (tmp_path / "scene.toml").write_text(
        soft_torus(12, 4, order=2) + "[static]\nload = 300.0\nerror_estimate = false\n"
    )
    launcher, script = ROOT / "tireroad", tmp_path / "size.py"
    script.write_text("from mpi4py import MPI\nprint('size', MPI.COMM_WORLD.size)\n")

    def step(tasks: int, *arguments: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["srun", "-n", str(tasks), "--overcommit", *map(str, arguments)],
            env=queue,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
        )

    assert "dolfinx" in step(1, launcher, "info").stdout
    assert "size 1" in step(1, launcher, "python", script).stdout
    for count in (1, 2):
        done = step(1, launcher, "run", "scene.toml", "--until", "static", "--fresh", "-n", count)
        assert done.returncode == 0, done.stderr
        assert (
            f'"processes": {count}' in (tmp_path / "results" / "scene" / "summary.json").read_text()
        )
    refused = step(2, launcher, "info")
    assert refused.returncode == 2 and refused.stderr.count("2 processes without MPI") == 1
