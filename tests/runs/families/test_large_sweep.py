"""Sweeps with more members than an array job of the batch system may have tasks."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_slurm import FAMILY, PRINTS, QUEUE, SUBMIT, TEMPLATE, family

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.sweep import command
from tireroad.runs.sweep.definition import read as read_sweep


def test_a_sweep_larger_than_an_array_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Divided into several; where one is refused, what waits already is named. Submitted again, it ran twice."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command, "MOST", 2)
    file = family(tmp_path, 0.01)
    numbers = ", ".join(f"{k}e-4" for k in range(1, 7))
    more = FAMILY.replace("1e-4, 2e-4, 3e-4", numbers).partition("[slurm]")[0]
    file.write_text(more + QUEUE)
    (tmp_path / "pbs.sh").write_text(TEMPLATE)
    (tmp_path / "qsub").write_text(SUBMIT + PRINTS["qsub"])
    (tmp_path / "qsub").chmod(0o755)
    sweep = read_sweep(file)
    scripts = command.write_scripts(sweep, Path("out"), sweep.members[:1], sweep.members[1:], file)
    assert list(scripts) == ["first", "rest", "rest-2", "rest-3", "gather"]
    assert [script.tasks for script in scripts.values()] == [1, 2, 2, 1, None]
    texts = [script.path.read_text() for script in scripts.values()]
    for member in sweep.members:
        assert sum(f"/{member.name} " in text + " " for text in texts) == 1
    jobs = command.submit(sweep, scripts)
    last = (tmp_path / "submitted.txt").read_text().splitlines()[-1]
    assert last.startswith(f"-V -W depend=afterany:{':'.join(list(jobs.values())[:-1])} ")
    refuses = 'case "$*" in *rest-2*) echo "Invalid job array specification" >&2; exit 1;; esac\n'
    (tmp_path / "qsub").write_text(SUBMIT + refuses + PRINTS["qsub"])
    with pytest.raises(ConvergenceError, match=r"specification\. Submitted before: first as job"):
        command.submit(sweep, scripts)
