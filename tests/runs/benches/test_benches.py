"""Every benchmark of rolling on a tire too small to mean anything, and the page of what it measured."""

import json
from html.parser import HTMLParser

import numpy as np
import pytest

from tireroad.runs.files.trials import Settings, Trial
from tireroad.runs.scene.sections import torus
from tireroad.runs.search.settings import CAUSES
from tireroad.runs.validation import tables
from tireroad.runs.validation.tables import Table
from tireroad.runs.validation.tables_page import _shown, drawn, page
from tireroad.tests.bench import scaling, skipping
from tireroad.tests.bench.accuracy import (
    accuracy_on_demand,
    error_bars,
    headline,
    pareto,
)
from tireroad.tests.bench.accuracy.rough_road import Mesh
from tireroad.tests.bench.parts import apart
from tireroad.tests.bench.parts.floors import exponent
from tireroad.tests.bench.parts.rolling_cases import Case

pytestmark = pytest.mark.slow

TINY = Mesh(10, 5, 0.5)
VOID = {"meta", "img", "link", "br"}


class Tags(HTMLParser):
    """Opened and closed tags in balance; images and outside addresses counted."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.images, self.outside = 0, []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        self.images += tag == "img"
        for name in ("src", "href"):
            if name in given and not given[name].startswith(("data:", "#")):
                self.outside.append(given[name])
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def check_page(tables: list[Table], images: int) -> str:
    text = page({"some": tables}, {"some": "what it is"})
    tags = Tags()
    tags.feed(text)
    assert tags.open == [] and tags.outside == []
    assert tags.images == images
    for table in tables:
        assert all(len(row) == len(table.columns) for row in table.rows)
    return text


@pytest.mark.long
def test_pareto_names_its_front(tmp_path, monkeypatch) -> None:
    for name, value in (
        ("STEPS", (2e-4, 4e-4)),
        ("DURATION", 0.04),
        ("FINEST", 1e-4),
        ("ORDER", 2),
    ):
        monkeypatch.setattr(pareto, name, value)
    first, meshes, every = pareto.tables(
        tmp_path, (TINY, Mesh(12, 5, 0.5)), (8, 16), 24, (4e-4,), Mesh(12, 4, 0.5)
    )
    names = [name for name, _ in first.columns]
    cost, error = names.index("run time per simulated second"), names.index("larger error")
    best = [row for row in first.rows if row[0]]
    full = [row for row in first.rows if not row[0]]
    assert [row[0] for row in best] == ["A", "B", "C", "D", "E", "F", "G", "H"][: len(best)]
    assert len(full) == 1 and full[0][names.index("residual")] == pareto.FULL
    for row in every.rows:  # nothing lies below and to the left of the front
        if row[0] == str(TINY) and row[2] != pareto.FULL:
            beaten = [b for b in best if b[cost] <= row[cost - 1] and b[error] <= row[error - 1]]
            assert beaten
    assert len(every.rows) == 2 * len(pareto.RESIDUALS) * 2 + 1 + 1 * 2 * 1
    check_page([first, meshes, every], images=2)


def test_front_is_what_no_other_beats() -> None:
    def choice(cost, error):
        return pareto.Choice("", 0, "", 0, 0.0, cost, error, error / 2)

    given = [choice(1, 9), choice(2, 9), choice(2, 5), choice(3, 6), choice(4, 1), choice(0.5, 20)]
    assert [(c.cost, c.worst) for c in pareto.front(given)] == [(0.5, 20), (1, 9), (2, 5), (4, 1)]
    assert "5 s a simulated second" in pareto._named(2.0, [choice(5, 1)], [])
    assert "10 times as long" in pareto._named(2.0, [choice(5, 1)], [choice(50, 1)])
    assert "off by 4 %" in pareto._named(2.0, [choice(5, 1)], [choice(50, 4)])
    assert "none of these" in pareto._named(0.5, [choice(5, 1)], [])


@pytest.mark.long
def test_headline_tells_the_cheapest_within_the_error(tmp_path) -> None:
    table = headline.table(tmp_path, TINY, 20, 0.1, ((10, 2500), (None, 10000)))
    coarse, fine = table.rows
    assert fine[5] < 2.0 and fine[6] < 2.0  # only the step differs from the reference
    assert coarse[3] <= 10 < fine[3]
    assert fine[8] == pytest.approx(10 * fine[7])
    within = [row for row in table.rows if max(row[5:7]) <= headline.TARGET]
    assert ("none" if not within else "Headline: one simulated second") in table.notes[0]
    check_page([table], images=1)


@pytest.mark.long
def test_skipping_changes_nothing_but_the_time(tmp_path) -> None:
    keys = {"modes": 16, "residual": "static", "duration": 0.1, "step": 2e-4}
    table = skipping.table(tmp_path, TINY, keys)
    ratios = {(row[0], row[1]): row[4] for row in table.rows}
    assert len(ratios) == len(table.rows) == 8
    assert ratios["stages known from another road", "whole run"] > 2
    changed = [float(row[5].split()[0]) for row in table.rows if row[5]]
    assert len(changed) == 3 and max(changed) < 0.1
    check_page([table], images=1)


@pytest.mark.long
def test_scaling_on_small_sizes(tmp_path) -> None:
    sizes = scaling.unknowns(tmp_path, (TINY, Mesh(12, 6, 0.5)), 12)
    assert sizes.rows[0][0] < sizes.rows[1][0]
    assert all(np.isfinite(row[:8]).all() and min(row[:8]) > 0 for row in sizes.rows)
    loop = scaling.loop((4, 6), (40, 60), (40, 80))
    assert [row[0] for row in loop.rows] == ["points"] * 2 + ["states"] * 2 + ["steps"] * 2
    check_page([scaling.machine_rates(), sizes, loop], images=2)


@pytest.mark.long
def test_efficiency_over_processes(tmp_path, monkeypatch) -> None:
    """Twice as fast on the same mesh, and as fast on twice the mesh, is an efficiency of 1."""
    alone = scaling._on(tmp_path, "strong", TINY, 12, 1)
    assert alone[:2] == ["strong", 1] and min(alone[2:]) > 0 and sum(alone[3:6]) == alone[6]

    def run(folder, kind, mesh, modes, count):
        seconds = alone[6] / (1 if kind == "weak" else count) * (2 if count == 4 else 1)
        return [kind, count, mesh.segments, *alone[3:6], seconds, *alone[7:]]

    monkeypatch.setattr(scaling, "_on", run)
    table = scaling.processes(tmp_path, TINY, 12, 5)
    found = {(row[0], row[1]): row[-1] for row in table.rows}
    assert found == {
        ("strong", 1): 1, ("strong", 2): 1, ("strong", 4): 0.5, ("weak", 2): 1, ("weak", 4): 0.5,
    }  # fmt: skip
    assert [row[2] for row in table.rows if row[0] == "weak"] == [20, 40]
    check_page([table], images=1)


def test_exponent_of_a_power_law() -> None:
    sizes = [10.0, 20.0, 40.0]
    assert exponent(sizes, [3 * s**1.7 for s in sizes]) == pytest.approx(1.7)


def test_kept_as_json_and_page(tmp_path, monkeypatch) -> None:
    given = [
        Table("a < b", [("n", "-"), ("time", "s")], [[1, 1e-5], [2, 2.0]], ["so & so"],
              {"x": "n", "y": ["time"], "log": "xy", "targets": [(1.0, "asked: 1 s")]}),
        Table("long", [("word", ""), ("n", "-")], [["w", k] for k in range(40)]),
    ]  # fmt: skip
    module = type("M", (), {"ABOUT": "it", "run": staticmethod(lambda: given)})
    monkeypatch.setattr(tables, "modules", lambda package: {"it": module})
    tables.run_all("tireroad.tests.bench", ["it"], tmp_path / "out.json")
    data = json.loads((tmp_path / "out.json").read_text())
    assert data["results"]["it"][0]["rows"] == [[1, 1e-5], [2, 2.0]] and "core" in data["machine"]
    text = (tmp_path / "out.html").read_text()
    assert "a &lt; b" in text and "so &amp; so" in text and "1·10⁻⁵" in text
    assert "Table 2: long (40 rows)" in text and text.count("<details>") == 1


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (True, "yes"), (None, ""), (1234.5, "1234"), (0.01234, "0.0123"),
     (2.5e-5, "2.5·10⁻⁵"), (-3.2e7, "-3.2·10⁷"), (float("nan"), "nan"), ("w", "w"), (17, "17")],
)  # fmt: skip
def test_figures_as_they_are_read(value, text) -> None:
    assert _shown(value) == text


def test_a_table_without_a_picture() -> None:
    assert drawn(Table("t", [("n", "-")], [[1]])) is None


@pytest.mark.long
def test_error_bars_are_compared_with_a_finer_run(tmp_path) -> None:
    coarse = {"segments": 16, "arc": 8, "order": 2, "modes": 16, "pitch": 0.01, "step": 4e-4}
    fine = coarse | {"modes": 24, "step": 2e-4, "pitch": 0.008}
    cases = [Case("soft", "texture", 40.0)]
    given = cases, coarse, fine, 0.05, tmp_path / "kept"
    shares, causes, every = error_bars.tables(tmp_path / "runs", *given)
    assert {row[1] for row in shares.rows} >= {"mean", "deviation", "all"}
    assert {row[0] for row in causes.rows} == {"step", "points", "modes", "mesh"}
    assert all(row[4] >= 0 and row[5] >= 0 for row in every.rows)
    check_page([shares, causes, every], 0)
    again = error_bars.tables(tmp_path / "again", *given)  # from what was kept: nothing is run
    assert again[2].rows == every.rows and not (tmp_path / "again").exists()


@pytest.mark.long
def test_a_search_is_held_against_all_settings_and_not_run_twice(tmp_path, monkeypatch) -> None:
    fine = {"segments": 16, "arc": 8, "order": 2, "modes": 40, "pitch": 0.008, "step": 5e-4}
    changed = {"FINE": fine, "TARGET": 0.9, "UP_TO": 70.0, "DURATION": 0.08}
    for name, value in changed.items():
        monkeypatch.setattr(accuracy_on_demand, name, value)
    wanted = "accuracy.target=0.9", "accuracy.up_to=70"
    monkeypatch.setattr(accuracy_on_demand, "WANTED", wanted)
    monkeypatch.setattr(torus, "ORDER", 2)
    monkeypatch.setattr(
        apart, "apart", lambda task, *given: task(*given)
    )  # another process knows of none of these
    grid = {"mesh": (0,), "modes": (0,), "points": (0, 1), "step": (0, 1)}
    given = [Case("soft", "texture", 30.0)], grid, tmp_path / "kept"
    found = accuracy_on_demand.tables(tmp_path / "runs", *given)
    ((_, _, true, met, cost, best, search),) = found[1].rows
    assert met and 0 < true <= 90 and best <= cost <= search
    again = accuracy_on_demand.tables(tmp_path / "again", *given)
    assert again[1].rows == found[1].rows and not (tmp_path / "again").exists()


def test_searches_are_judged_by_the_least_cost() -> None:
    rungs = dict.fromkeys(CAUSES, 0)
    seconds = {"static": 5.0, "modes": 3.0, "contact": 1.0, "accuracy": 2.0}
    trials = [
        Trial(Settings((16, 8), 3, 200.0, "static", 0.01, 1e-3, rungs | finer), seconds, 11.0)
        for finer in ({}, {"step": 1}, {"step": 1, "mesh": 1})
    ]
    # The finer step computes the loop and its error bars anew, the finer mesh everything.
    assert accuracy_on_demand._spent(trials) == 11.0 + 3.0 + 11.0
    target = accuracy_on_demand.TARGET
    found = [
        accuracy_on_demand.Outcome("a", True, 0.9 * target, 0.8 * target, 12.0, 8.0, 20.0),
        accuracy_on_demand.Outcome("b", False, 2.0 * target, 3.0 * target, 10.0, None, 30.0),
    ]
    tables = [accuracy_on_demand._summary(found), accuracy_on_demand._every(found)]
    assert [row[1] for row in tables[0].rows] == [50.0, 1.5, 1.5, 2.5, 2.5]
    check_page(tables, 0)
