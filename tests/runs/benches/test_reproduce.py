"""The command `reproduce`: verdicts come from numbers; names, files and exit statuses."""

import csv
import json
import math

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.tread.compliance import rectangle_potential
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.cli import REPRODUCE
from tireroad.runs.scene.load import load
from tireroad.tests.thesis.claim import UNEXPLAINED, Claim, verdict
from tireroad.tests.thesis.command import known, reproduce
from tireroad.tests.thesis.figure import FIGURES, Figure, chosen
from tireroad.tests.thesis.figures import half_space
from tireroad.tests.thesis.runner import FOLDER


def claim(found: float, thesis: float = 2.0, relation: str = "equal", **more) -> Claim:
    given = {"what": "a", "unit": "m", "source": "here", "tolerance": 0.1} | more
    return Claim(thesis=thesis, found=found, relation=relation, **given)


@pytest.mark.parametrize(
    ("relation", "thesis", "found", "agrees"),
    [
        ("equal", 2.0, 2.19, True),
        ("equal", 2.0, 1.79, False),
        ("equal", -2.0, -2.19, True),
        ("equal", 0.0, 0.09, True),  # absolute where the thesis has 0
        ("equal", 0.0, -0.11, False),
        ("below", 2.0, 1.79, True),
        ("below", 2.0, 1.9, False),  # not by more than the tolerance
        ("above", 2.0, 2.21, True),
        ("above", 2.0, 2.1, False),
        ("equal", 2.0, math.nan, False),
        ("above", 2.0, math.inf, False),
    ],
)
def test_agreement(relation: str, thesis: float, found: float, agrees: bool) -> None:
    one = claim(found, thesis, relation, because="of b")
    assert one.agrees is agrees
    assert one.verdict == ("agrees" if agrees else "differs because of b")


def test_differing_without_a_cause_is_said() -> None:
    assert UNEXPLAINED in claim(3.0).verdict


def test_right_value_is_held_to_the_same_tolerance() -> None:
    assert claim(3.0).is_right is None
    assert claim(3.0, right=3.2).is_right is True
    assert claim(3.0, right=3.4).is_right is False


@pytest.mark.parametrize("wrong", [{"relation": "like"}, {"tolerance": -1.0}, {"source": ""}])
def test_claims_that_compare_nothing(wrong: dict) -> None:
    with pytest.raises(ValueError):
        claim(1.0, **wrong)


def test_verdict_of_a_figure() -> None:
    assert verdict((claim(2.0), claim(2.1))) == "agrees"
    assert verdict((claim(2.0), claim(3.0), claim(4.0))) == "differs in 2 of 3"


def test_every_figure_that_numbers_can_reproduce_is_there_and_in_the_help() -> None:
    figures = [
        f"figure-{one}"
        for one in [
            "4.2",
            "4.3",
            "4.4",
            "4.5",
            "5.5",
            "6.2",
            "6.3",
            "6.5",
            "7.1",
            "7.2",
            "7.3",
            "7.4",
            "C.1",
            "C.2",
            "D.1",
        ]
    ]
    assert list(known()) == figures + [f"table-B.{k}" for k in (1, 2, 3, 4)]
    for name in (
        "figure-4.2 to figure-4.5",
        "figure-7.1 to figure-7.4",
        "figure-D.1",
        "table-B.1 to table-B.4",
    ):
        assert name in REPRODUCE


def test_a_figure_that_gives_up_does_not_end_the_others(tmp_path, monkeypatch) -> None:
    def gives_up(scenes) -> None:
        raise ConvergenceError("no balance")

    known()
    broken = Figure(name="figure-5.5", title="broken", thesis="-", compute=gives_up)
    monkeypatch.setitem(FIGURES, "figure-5.5", broken)
    with pytest.raises(ConvergenceError, match=r"1 of 2 gave up: figure-5\.5: no balance"):
        reproduce(["figure-5.5", "figure-D.1"], tmp_path / "out", MPI.COMM_SELF)
    found = json.loads((tmp_path / "out" / "reproduce.json").read_text())["figures"]
    assert [one["verdict"] for one in found] == ["not computed", "differs in 1 of 5"]
    assert found[0]["shows"] == "no balance"


def test_unknown_name_names_the_nearest() -> None:
    figures = known()
    with pytest.raises(InputError, match=r"did you mean figure-4\.2\?"):
        chosen(["figur-4.2"], figures)
    assert [one.name for one in chosen(["table-B.1", "figure-4.2"], figures)] == [
        "figure-4.2",
        "table-B.1",
    ]
    assert len(chosen([], figures)) == len(figures)


@pytest.mark.parametrize("scene", sorted(path.name for path in FOLDER.glob("*.toml")))
def test_scenes_are_valid(scene: str) -> None:
    assert load(FOLDER / scene).name.startswith("thesis-")


def test_printed_formula_has_only_its_third_term_wrong() -> None:
    x = np.array([-2.3, 0.0, 0.4, 5.0])
    exact = rectangle_potential(x, 0.3, 1.0, 2.0)
    assert half_space.printed(x, 0.3, 1.0, 2.0, put_right=True) == pytest.approx(exact, rel=1e-12)
    assert np.abs(half_space.printed(x, 0.3, 1.0, 2.0) / exact - 1).min() > 0.1


@pytest.mark.long
def test_two_cheap_ones_end_to_end(launch, tmp_path) -> None:
    command = "-m", "runs", "reproduce", "table-B.2", "figure-D.1", "--out", tmp_path / "out"
    done = launch(*command, processes=2)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "out" / "reproduce.json").read_text())
    assert [one["name"] for one in found["figures"]] == ["figure-D.1", "table-B.2"]
    assert found["processes"] == 2
    oscillator = {one["what"]: one for one in found["figures"][0]["claims"]}
    assert oscillator["first eigenvalue, real part"]["found"] == pytest.approx(-0.5, abs=1e-12)
    assert oscillator["first eigenvalue, real part"]["verdict"] == "agrees"
    second = oscillator["second eigenvalue, real part"]  # (D.4) has the wrong sign
    assert (second["verdict"], second["is_right"]) == ("differs", True)
    with (tmp_path / "out" / "reproduce.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(one["claims"]) for one in found["figures"])
    page = (tmp_path / "out" / "reproduce.html").read_text()
    assert "data:image/svg+xml" in page and "differs" in page and "http" not in page
