"""Benchmarks and validations one after the other: where they are written, and what a stop leaves."""

import json
import os

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.process.mpi import ending
from tireroad.runs.process.signals import STOPPED, Stopped
from tireroad.runs.validation import tables
from tireroad.runs.validation.tables import Table


def test_a_stop_says_what_is_kept(tmp_path, monkeypatch) -> None:
    """Tables were written at the end only, while the message spoke of what was kept."""

    def stopped(kept=None):
        raise Stopped("SIGTERM")

    done = type("M", (), {"ABOUT": "it", "run": staticmethod(lambda: [Table("t", [], [])])})
    late = type("M", (), {"ABOUT": "late", "run": staticmethod(stopped)})
    monkeypatch.setattr(tables, "modules", lambda package: {"done": done, "late": late})
    out = tmp_path / "not yet" / "out.json"
    for at, told in ((out, f"kept are done in {out}; "), (None, "nothing is kept; with --out")):
        with ending() as end:
            tables.run_all("tireroad.tests.bench", [], at)
        assert end.status == STOPPED and f"stopped by SIGTERM: {told}" in end.message
    assert list(json.loads(out.read_text())["results"]) == ["done"]
    out.with_suffix(".kept").mkdir()
    with ending() as end:
        tables.run_all("tireroad.tests.bench", [], out)
    assert "the same command continues" in end.message


@pytest.mark.parametrize("name", ["page.html", ".", "file/out.json", "pipe"])
def test_a_name_that_cannot_be_written_is_refused_before_the_work(
    tmp_path, monkeypatch, name
) -> None:
    (tmp_path / "file").touch()
    os.mkfifo(tmp_path / "pipe")
    module = type("M", (), {"ABOUT": "it", "run": staticmethod(lambda: pytest.fail("it ran"))})
    monkeypatch.setattr(tables, "modules", lambda package: {"it": module})
    with pytest.raises(InputError, match="--out"):
        tables.run_all("tireroad.tests.bench", [], tmp_path / name)
