"""Settings that are searched for: from coarse to what meets the target, at little more than the least cost."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from wanted_scene import SCENE

from tireroad.contact.results.error_bars import orders
from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.folder import check_kept_scene
from tireroad.runs.files.trials import MARGIN, ErrorsByCause, Settings, Trial, worst
from tireroad.runs.process import console
from tireroad.runs.process.signals import Stopped
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.load import load
from tireroad.runs.scene.sections import torus
from tireroad.runs.search import journal
from tireroad.runs.search import search as searching
from tireroad.runs.search.journal import SearchJournal, to_resume
from tireroad.runs.search.search import Search
from tireroad.runs.search.settings import CAUSES, Ladders, applied, size_ratio

AT_FIRST = {"step": 0.04, "points": 0.2, "modes": 0.06, "mesh": 0.3}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "wanted.toml"
    path.write_text(SCENE)
    return path


def modelled(scene, settings: Settings) -> Trial:
    """A trial whose errors fall by their orders, and whose seconds are the work estimated."""
    first = Ladders.of(scene).first()
    history = {
        cause: AT_FIRST[cause] * size_ratio(cause, first, settings) ** orders(settings.order)[cause]
        for cause in CAUSES
    }
    seconds = estimate(applied(scene, settings)).work
    found = ErrorsByCause(history, dict.fromkeys(CAUSES, 0.0), (), dict.fromkeys(CAUSES, ()))
    return Trial(settings, seconds, sum(seconds.values()), found, "linear")


@pytest.fixture
def search(file, monkeypatch):
    """A search over the model; what it tried, and the scene whose results it left."""
    tried: list[Settings] = []
    final = []

    def attempt(self, settings):
        tried.append(settings)
        return modelled(self.scene, settings)

    monkeypatch.setattr(Search, "_tried", attempt)
    monkeypatch.setattr(Search, "_final", lambda self, scene: final.append(scene))
    monkeypatch.setattr(searching, "tell_error", lambda scene, done: None)

    def started(*sets: str):
        (file.parent / "out").mkdir(exist_ok=True)
        with console.quiet():
            Search(load(file, sets), file.parent / "out", MPI.COMM_SELF, []).run()

    return started, tried, final


def cheapest(scene, target: float) -> float:
    """Seconds of the cheapest settings of all that meet the target, tried one by one."""
    ladders = Ladders.of(scene)
    best = np.inf
    for rungs in np.ndindex(3, 6, 4, 6):
        settings = ladders.at(dict(zip(("step", "points", "modes", "mesh"), rungs, strict=True)))
        trial = modelled(scene, settings)
        if worst(trial.found.over(scene.accuracy))[0] <= 1:
            best = min(best, sum(trial.seconds.values()))
    return best


@pytest.mark.long
def test_it_ends_within_the_target_near_the_least_cost(file, search, monkeypatch) -> None:
    started, tried, final = search
    started()
    scene = load(file)
    last = modelled(scene, tried[-1])
    over = [worst(modelled(scene, one).found.over(scene.accuracy))[0] for one in tried]
    assert over[-1] <= 1 / MARGIN < min(over[:-1])
    monkeypatch.setattr(torus, "FINER", torus.FINER[:6])
    least = cheapest(scene, 0.05)
    spent = sum(sum(modelled(scene, one).seconds.values()) for one in tried)
    assert sum(last.seconds.values()) <= 2 * least
    assert spent <= 3 * least
    assert final == [applied(scene, tried[-1])]


def test_the_chosen_scene_needs_no_search_and_is_the_run_s(file, search) -> None:
    started, _, final = search
    started()
    chosen = load(file.parent / "out" / "chosen.toml")
    assert chosen == final[0]
    assert chosen.accuracy.target == 0.05 and not chosen.accuracy.searches


@pytest.mark.slow
def test_a_search_that_was_stopped_goes_on_and_a_looser_one_is_known(file, search, monkeypatch):
    started, tried, _ = search
    started()
    whole = list(tried)
    (file.parent / "out" / "search.json").unlink()
    tried.clear()
    attempt = Search._tried

    def stopped(self, settings):
        if tried:
            raise Stopped("SIGINT")
        return attempt(self, settings)

    with monkeypatch.context() as patched:
        patched.setattr(Search, "_tried", stopped)
        with pytest.raises(Stopped):
            started()
    started()
    assert tried == whole
    tried.clear()
    started("accuracy.target=0.9")
    assert tried == []  # its trials are those of before
    started("road.amplitude=3e-4")
    assert tried[0] == whole[0]  # another scene: anew


@pytest.mark.parametrize(
    ("sets", "why"), [("accuracy.trials=1", "trials"), ("accuracy.budget=1", "budget")]
)
def test_limits_end_it_with_what_was_reached(file, search, monkeypatch, sets, why) -> None:
    started, tried, final = search
    # No advice to search after a search:
    monkeypatch.setattr(searching, "tell_error", lambda scene, done: pytest.fail("told"))
    with pytest.raises(ConvergenceError, match=f"accuracy.{why}.*largest part: mesh"):
        started(sets)
    assert len(tried) == 1
    assert final == [applied(load(file, [sets]), tried[0])]


def test_a_folder_has_the_scene_of_its_results_and_resume_that_of_the_search(
    file, search, monkeypatch
):
    started, _, _ = search
    out = file.parent / "out"
    started()
    loose = (out / "scene.toml").read_text()
    assert (out / "chosen.toml").exists() and to_resume(out) == out / "scene.toml"
    (out / "summary.json").write_text("{}")  # the stages' results, which the model leaves out
    with pytest.raises(ConvergenceError):
        started("accuracy.target=0.001", "accuracy.trials=2")
    assert not (out / "chosen.toml").exists()
    assert (out / "scene.toml").read_text() == loose
    check_kept_scene(to_resume(out))
    again = load(to_resume(out))
    assert again == load(file, ["accuracy.target=0.001", "accuracy.trials=2"])
    assert not searching.searches(load(file, ["accuracy.search=false"]), None)
    journal.leave(out)
    assert to_resume(out) == out / "scene.toml"


def test_an_estimate_without_margin_does_where_limits_end_the_search(file, search) -> None:
    started, tried, final = search
    found = modelled(load(file), Ladders.of(load(file)).first()).found
    error = float(np.sqrt(sum(part**2 for part in found.history.values())))
    target = 0.5 * (1 + MARGIN) * error  # met, but not with the margin
    sets = f"accuracy.target={target}"
    started(sets, "accuracy.trials=1")
    assert final == [applied(load(file, [sets, "accuracy.trials=1"]), tried[0])]
    started(sets, "accuracy.trials=3")
    assert len(tried) > 1  # it goes on where it may


def test_what_fails_is_made_finer(file, monkeypatch, search) -> None:
    started, tried, _ = search
    attempt = Search._tried

    def failing(self, settings):
        trial = attempt(self, settings)
        unknown = {c: e for c, e in trial.found.history.items() if c != "mesh" or len(tried) > 2}
        found = replace(trial.found, history=unknown)
        return (
            replace(trial, failed="no balance", found=None)
            if len(tried) == 1
            else replace(trial, found=found)
        )

    monkeypatch.setattr(Search, "_tried", failing)
    started()
    assert tried[1].rungs == {"step": 1, "points": 0, "modes": 0, "mesh": 1}
    assert tried[2].rungs["mesh"] > 1  # the companion of the mesh had failed


@pytest.mark.long
def test_a_tiny_tire_from_its_scene_to_its_results(file, monkeypatch) -> None:
    """The real thing: one trial misses a hard target, and meets a loose one without being run again."""
    monkeypatch.setattr(torus, "ORDER", 2)
    out = file.parent / "out"
    out.mkdir()
    smooth = ["accuracy.up_to=70", "road.wavelength=0.25"]

    def started(*sets: str) -> None:
        scene = load(file, [*smooth, *sets])
        with console.quiet():
            searching.search(scene, out, MPI.COMM_SELF, fresh=False, petsc_options=[])

    with pytest.raises(ConvergenceError, match="accuracy.trials = 1 are done. Reached"):
        started("accuracy.target=0.001", "accuracy.trials=1")
    assert (out / "contact.h5").exists() and (out / "search" / "cache").exists()
    started("accuracy.target=0.5")
    stages = json.loads((out / "summary.json").read_text())["stages"]
    assert {stages[name]["status"] for name in ("static", "modes", "contact", "accuracy")} == {
        "reused"
    }
    assert load(out / "scene.toml") == load(out / "chosen.toml")
    assert not (out / "search").exists()
    assert len(SearchJournal(out, load(file, smooth)).trials) == 1


@pytest.mark.parametrize(
    "errors", [(0.02, 0.05, 0.02, 0.15), (0.02, 0.08, 0.02, 0.3), (0.2, 0.2, 0.2, 0.2)]
)
def test_no_rung_is_climbed_that_the_target_is_clearly_met_without(file, errors) -> None:
    """Points, cheaper, were refined before the mesh, which alone would have done."""
    scene = load(file, ["accuracy.target=0.15"])
    ladders = Ladders.of(scene)
    first = ladders.first()
    history = dict(zip(CAUSES, errors, strict=True))
    found = ErrorsByCause(history, dict.fromkeys(CAUSES, 0.0), (), dict.fromkeys(CAUSES, ()))
    trial = Trial(first, estimate(applied(scene, first)).work, 1.0, found, "linear")
    now = searching.planned(ladders, trial, 1)

    def predicted(settings: Settings) -> float:
        rates = orders(first.order)
        ends = [e * size_ratio(c, first, settings) ** rates[c] for c, e in history.items()]
        return float(np.linalg.norm(ends)) / 0.15

    assert predicted(now) <= searching.AIM < predicted(first)
    for cause, rung in now.rungs.items():
        if rung:
            lower = ladders.at(now.rungs | {cause: rung - 1})
            assert predicted(lower) > searching._CLEAR * searching.AIM, cause
