"""Cases of a bench in processes of their own: one that fails is named, and the others go on."""

import json
import operator
import signal

import pytest

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.scene.load import load
from tireroad.runs.validation import tables
from tireroad.runs.validation.tables_page import page
from tireroad.tests.bench.accuracy import error_bars
from tireroad.tests.bench.parts import apart, kept, rolling_cases
from tireroad.tests.bench.parts.effectivity import shares
from tireroad.tests.bench.parts.rolling_cases import CASES, Case


def test_what_another_process_gives(capfd) -> None:
    assert apart.apart(operator.truediv, 6, 4) == 1.5
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("task", "given", "why"),
    [
        (operator.truediv, (1, 0), "exit status 1: ZeroDivisionError: division by zero"),
        (signal.raise_signal, (signal.SIGKILL,), "ended by SIGKILL, as for want of memory"),
        (load, ("/nowhere.toml", ()), "exit status 2: .*nowhere.toml"),
    ],
)
def test_why_another_process_failed(task, given, why) -> None:
    with pytest.raises(ConvergenceError, match=why):
        apart.apart(task, *given)


def test_a_case_that_fails_is_named_and_the_others_go_on(tmp_path, monkeypatch) -> None:
    cases, begun = CASES[:3], []

    def instead(task, case: Case, *_given) -> list[dict]:
        begun.append(case)
        if case == cases[1] and len(begun) < 4:
            raise ConvergenceError("exit status 2: too little memory")
        return [{"of": str(case)}]

    monkeypatch.setattr(apart, "apart", instead)
    given = (
        tmp_path,
        tmp_path / "kept",
        error_bars.judged,
        lambda case: (case.speed, {"a": (1, 2)}),
        str,
    )
    found, failed = kept.every_case(cases, *given)
    assert begun == list(cases) and list(found) == [cases[0], cases[2]]
    assert failed == [f"{cases[1]}: exit status 2: too little memory"]
    found, failed = kept.every_case(
        cases, *given
    )  # what was found is kept, what failed is tried again
    assert begun[3:] == [cases[1]] and list(found) == list(cases) and not failed
    monkeypatch.setitem(rolling_cases.ROADS, cases[0].road, 'kind = "flat"')
    kept.every_case(cases, *given)  # another road: nothing that was kept is of it
    assert begun[4:] == [case for case in cases if case.road == cases[0].road]


def test_what_was_not_measured_ends_with_a_status(tmp_path, monkeypatch) -> None:
    table = shares([], "none.", ["a tire: too little memory"])
    module = type("M", (), {"ABOUT": "it", "run": staticmethod(lambda: [table])})
    monkeypatch.setattr(tables, "modules", lambda package: {"it": module})
    with pytest.raises(ConvergenceError, match="not measured: a tire: too little memory"):
        tables.run_all("tireroad.tests.bench", ["it"], tmp_path / "out.json")
    (table_kept,) = json.loads((tmp_path / "out.json").read_text())["results"]["it"]
    assert table_kept["failed"] == table.failed
    assert "not measured: a tire: too little memory" in page({"it": [table]}, {"it": "it"})
