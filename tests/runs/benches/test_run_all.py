"""Benchmarks and validations one after the other: where they are written, and what a stop leaves."""

import json
import math
import os

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.process.mpi import ending
from tireroad.runs.process.signals import STOPPED, Stopped
from tireroad.runs.scene.load import load
from tireroad.runs.validation import tables
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts import rolling_cases
from tireroad.tests.validation import large_rolling


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


def test_a_run_that_does_not_find_free_rolling_is_no_reference(tmp_path) -> None:
    """It would begin at rest, as a wheel that is driven, beside others that roll freely."""
    for case in rolling_cases.RADIAL[:2]:
        assert case.scene(tmp_path, 0.1).rotation.free_rolling is True


def test_cases_are_chosen_by_all_words_of_one_of_several() -> None:
    found = rolling_cases.chosen(rolling_cases.RADIAL, ["radial texture 30", "quick-static cleat"])
    assert [str(case) for case in found] == [
        "radial, texture, 30 rad/s",
        *(f"quick-static, cleat, {speed} rad/s" for speed in (30, 60, 90)),
    ]
    assert rolling_cases.chosen(rolling_cases.CASES, []) == list(rolling_cases.CASES)
    with pytest.raises(InputError, match="words are 30, .*texture"):
        rolling_cases.chosen(rolling_cases.CASES, ["radial gravel"])


def test_only_a_benchmark_of_cases_can_choose(tmp_path, monkeypatch) -> None:
    asked = []

    def of_cases(kept=None, only=()):
        asked.append((kept, only))
        return [Table("t", [], [])]

    whole = type("M", (), {"ABOUT": "it", "run": staticmethod(lambda: [Table("t", [], [])])})
    some = type("M", (), {"ABOUT": "it", "run": staticmethod(of_cases)})
    monkeypatch.setattr(tables, "modules", lambda package: {"whole": whole, "some": some})
    tables.run_all("tireroad.tests.bench", ["some"], tmp_path / "out.json", only=["a b"])
    assert asked == [(tmp_path / "out.kept", ["a b"])]
    with pytest.raises(InputError, match="whole has no cases"):
        tables.run_all("tireroad.tests.bench", ["whole"], None, only=["a"])
    with pytest.raises(InputError, match="name it"):
        tables.run_all("tireroad.tests.bench", [], None, only=["a"])


def test_bars_and_holes_are_chosen_by_words_and_lie_before_the_points(tmp_path) -> None:
    """A road begins before the foremost point: a bar under it would have a vertical edge there."""
    (one,) = large_rolling.chosen(["bar 25 4000"])
    assert str(one) == "bar 25 x 50 mm, 4000 N, friction 0"
    assert large_rolling.chosen(["hole 2000"]) == []
    assert large_rolling.chosen([]) == list(large_rolling.CASES)
    for case in large_rolling.CASES:
        path = tmp_path / "scene.toml"
        path.write_text(case.scene())
        scene = load(path)
        if isinstance(case, large_rolling.Cobblestones):
            continue
        reach = case.reach or 1.5 * abs(case.height) + 5e-3
        foremost = math.sqrt(2 * large_rolling.RADIUS * (0.02 + reach))
        assert scene.road.surface.position > foremost
        assert scene.road.surface.position - large_rolling.SPEED * scene.time.duration < foremost
