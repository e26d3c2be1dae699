"""Progress: silent when short, rate and time left when long, on the root process only."""

import logging
import time
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import pytest

from tireroad.runs.process import console


def late(bar: console.ProgressBar) -> None:
    """As if the bar had begun ten seconds ago."""
    bar._began -= 10.0
    bar._next -= 10.0


def test_short_things_show_nothing(capsys) -> None:
    with console.ProgressBar("modes", 100) as bar:
        for _ in range(100):
            bar.advance()
    assert capsys.readouterr() == ("", "")


def test_long_things_show_rate_and_time_left(capsys, monkeypatch) -> None:
    monkeypatch.setattr(console, "is_terminal", lambda: False)
    with console.ProgressBar("contact", 1000, "steps") as bar:
        late(bar)
        bar.note("residual 1e-9")
        bar.advance(250)
        bar._next = 0.0
        bar.update(250)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert lines[1].startswith("contact: 250 of 1000 steps, 25")
    assert "steps/s" in lines[1] and "30 s left" in lines[1] and "residual 1e-9" in lines[1]


def test_what_an_earlier_run_has_done_is_not_in_the_rate() -> None:
    with console.ProgressBar("contact", 1000, "steps", begun=500) as bar:
        late(bar)
        bar.advance(250)
        line = bar.line()
    assert line.startswith("contact: 750 of 1000 steps, 25 steps/s, 10 s left")


def test_what_is_logged_is_shown_while_stdout_is_replaced(capfd) -> None:
    """cffi replaces it while it compiles: that forms are being compiled stood in the log alone."""
    console.show_log("tireroad.of_this_test")
    with redirect_stdout(StringIO()):
        logging.getLogger("tireroad.of_this_test.part").warning("compiling")
    assert capfd.readouterr().out.splitlines() == ["compiling"]


def test_bar_on_a_terminal(capsys, monkeypatch) -> None:
    monkeypatch.setattr(console, "is_terminal", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    with console.ProgressBar("contact", 1000) as bar:
        late(bar)
        bar.advance(500)
        console.say("a line between")
        late(bar)
        bar.advance(100)
    out, err = capsys.readouterr()
    assert out == "a line between\n"
    assert "500 of 1000" in err and "600 of 1000" in err


def test_unknown_total(capsys, monkeypatch) -> None:
    monkeypatch.setattr(console, "is_terminal", lambda: False)
    with console.ProgressBar("factorisation") as bar:
        late(bar)
        bar.note("")
    assert "10 s so far" in capsys.readouterr().err


def test_other_processes_are_silent(capsys, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setattr(console._State, "root", False)
    with console.log_to(tmp_path / "log.txt"), console.ProgressBar("x", 10) as bar:
        late(bar)
        console.say("a")
        console.warn("b")
        console.log("c")
        bar.advance()
    assert capsys.readouterr() == ("", "")
    assert not (tmp_path / "log.txt").exists()


def test_log_keeps_what_was_said(capsys, tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    for text in ("first", "second"):
        with console.log_to(path):
            console.say(text)
            console.warn("careful")
            console.log("only here")
    console.say("after")
    kept = path.read_text()
    assert kept.index("first") < kept.index("second")
    assert kept.count("warning: careful") == 2 and kept.count("only here") == 2
    assert "after" not in kept and "only here" not in capsys.readouterr().out


def test_advance_costs_little() -> None:
    with console.ProgressBar("contact", 10**6) as bar:
        began = time.thread_time()
        for _ in range(20_000):
            bar.advance()
        spent = time.thread_time() - began
    assert spent / 20_000 < 5e-6


@pytest.mark.parametrize(
    ("value", "words"), [(12.4, "12 s"), (185, "3 min 05 s"), (7800, "2 h 10 min")]
)
def test_durations(value: float, words: str) -> None:
    assert console.seconds(value) == words
