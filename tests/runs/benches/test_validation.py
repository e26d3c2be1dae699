"""What `validate` measures with: distances in a band, runs judged by the reference, both tires of a scene."""

import numpy as np
import pytest

from tireroad.contact.loop import ContactProblem, Loop
from tireroad.contact.model import step_solver
from tireroad.contact.results.spectra import distance
from tireroad.runs.validation.full_elements import FullHistory, follow
from tireroad.runs.validation.tables import modules
from tireroad.tests.validation import closed_forms, passenger, rolling, schemes
from tireroad.tests.validation.comparison import Choice, Comparison, Tires
from tireroad.tests.validation.moved_road import SCENE

DURATION = 0.1


def signal(step: float, amplitude: float = 1.0, fast: float = 0.0) -> np.ndarray:
    """A tone of 100 Hz on an offset, and one of 9.95 kHz."""
    t = step * np.arange(1, round(DURATION / step) + 1)
    values = 500 + amplitude * np.sin(2 * np.pi * 100 * t) + fast * np.sin(2 * np.pi * 9950 * t)
    return values[:, None] * np.ones(3)


@pytest.mark.parametrize("steps", [(1e-4, 1e-4), (2.5e-5, 1e-4), (1e-4, 2.5e-5)])
def test_distance_is_that_of_the_band_whatever_the_steps(steps) -> None:
    one, other = signal(steps[0]), signal(steps[1], 1.02)
    far = distance(one, other, DURATION)
    assert far.mean == pytest.approx(0.02, rel=1e-2)
    assert far.worst == pytest.approx(0.02, rel=1e-2)


def test_what_lies_above_the_band_does_not_count_nor_fold_down() -> None:
    assert distance(signal(5e-5), signal(5e-5, fast=3.0), DURATION).mean < 1e-3
    # Thinned out to 1e-4 s, 9.95 kHz would be seen at 50 Hz.
    assert distance(signal(5e-5), signal(2.5e-5, fast=3.0), DURATION).mean < 1e-3


def made(step: float, amplitude: float, seconds: float) -> FullHistory:
    return FullHistory(step, {"contact force": signal(step, amplitude)}, seconds, 0.1)


def test_the_fastest_run_within_an_error_is_held_against_full_elements_within_it() -> None:
    full = [made(2e-4, 1.03, 5.0), made(1e-4, 1.004, 10.0), made(5e-5, 1.0, 20.0)]
    found = Comparison(full, ("contact force",))
    assert [run.error for run in found.full] == pytest.approx([0.03, 0.004, 0.004 / 3], rel=0.03)
    found.add(Choice(10, "none", 1e-4), made(1e-4, 1.2, 0.01))
    found.add(Choice(50, "static", 1e-4), made(1e-4, 1.008, 0.05))
    found.add(Choice(90, "static", 1e-4), made(1e-4, 1.002, 0.1))
    *_, best, its, _, gain, pays, reached = found.verdict("road", 0.01, 100.0, 30.0)
    assert (best, gain, reached) == ("50 static, 0.0001 s", 200.0, "yes")
    assert pays == pytest.approx(0.1 * 30.0 / (10.0 - 0.05), rel=1e-2)
    assert its == pytest.approx(0.8, rel=0.03)
    assert found.verdict("road", 0.01, 300.0, 30.0)[-1] == "no"
    slow = Comparison(full, ("contact force",))
    slow.add(Choice(50, "static", 1e-4), made(1e-4, 1.008, 10.0))
    assert slow.verdict("road", 0.01, 1.0, 30.0)[-2] == "never"
    *_, gain, _, reached = found.verdict("road", 1e-4, 30.0, 30.0)
    assert (gain, reached) == (200.0, "no")
    table = found.table("title")
    assert all(len(row) == len(table.columns) for row in table.rows)


def test_every_validation_says_what_it_is_about() -> None:
    known = modules("tireroad.tests.validation")
    assert {"point_force", "moved_road", "rolling", "axle", "closed_forms", "stability"} <= set(
        known
    )
    assert all(module.ABOUT for module in known.values())
    assert hasattr(rolling, "run_large")


@pytest.fixture(scope="module")
def tires(tmp_path_factory) -> Tires:
    """A small motion of the road under a coarse standing tire."""
    mesh = {"segments": 12, "elements_arc": 4, "duration": 0.02}
    return Tires(SCENE.format(amplitude=1e-5, modes=120, **mesh), tmp_path_factory.mktemp("tires"))


@pytest.mark.slow
def test_full_elements_in_contact_go_on_from_a_checkpoint_with_the_same_bits(tires) -> None:
    trial, step = tires.trial, 2e-4
    patch, drive = trial.setup.patch, trial.setup.drive

    def loop() -> Loop:
        tire, *_ = tires.full(step)
        p = len(patch.index)
        solver = step_solver(trial.spec, patch, tire.same_step[:p, :p])
        return Loop(tire, ContactProblem(patch, tire.same_step, solver))

    def forces(of: Loop, steps: int, done: int = 0) -> np.ndarray:
        return np.concatenate([block.force for block in of.roll(drive, step, steps, done=done)])

    whole = forces(loop(), 40)
    broken, again = loop(), loop()
    forces(broken, 25)
    again.restore(broken.snapshot())
    assert np.array_equal(forces(again, 40, 25), whole[25:])
    assert np.ptp(whole[25:].sum(axis=1)) > 0.1


def test_modes_linear_and_large_motions_agree_where_all_should(tires) -> None:
    trial, step = tires.trial, 2e-4
    linear = follow(trial, *tires.full(step)).values["contact force"]
    large = follow(trial, *tires.nonlinear(step)).values["contact force"]
    modal = follow(trial, *tires.modal(Choice(120, "attachment", step))).values["contact force"]
    assert np.ptp(linear[:, 2]) > 1.0
    assert distance(large, linear, 0.02).worst < 2e-3
    assert distance(linear, modal, 0.02).worst < 5e-3
    few = follow(trial, *tires.modal(Choice(10, "none", step))).values["contact force"]
    assert distance(linear, few, 0.02).worst > 0.05


def test_the_scheme_that_is_chosen_is_held_against_a_finer_step(tires) -> None:
    """All schemes come nearer to the finer step, linear and damped forces by their second order; the one that is
    chosen is the best where the steps resolve the contact."""
    response = tires.response(30, "static")
    exact = schemes._follow(tires, response, 2.5e-5, "linear")
    rows = [schemes._row(tires, response, exact, 1e7, "static", step) for step in (4e-4, 1e-4)]
    for _, _, _, _, chosen, its, *off in rows:
        assert its == off[schemes.SCHEMES.index(chosen)]
    coarse, fine = (dict(zip(schemes.SCHEMES, map(float, row[-3:]), strict=True)) for row in rows)
    for scheme in ("linear", "damped"):
        assert fine[scheme] < coarse[scheme] / 4
    assert rows[1][4] == "linear" and fine["constant"] > 3 * fine["damped"] > 3 * fine["linear"]


@pytest.mark.slow
def test_waves_of_the_turning_ring_are_told_by_their_shapes(monkeypatch) -> None:
    """Endo's: 1 % as the ring is, and plainly off without Coriolis and centrifugal forces. Taken for the nearest of all
    60 frequencies, only the lower branch would show that."""
    assert all(
        found == pytest.approx(exact, rel=0.01) for *_, found, exact in closed_forms._ring(50.0)
    )
    plain = closed_forms.matrices
    monkeypatch.setattr(closed_forms, "matrices", lambda *given: plain(*given[:-1], "doppler"))
    off = [abs(found / exact - 1) for *_, found, exact in closed_forms._ring(50.0)]
    assert min(off) > 0.05


def test_the_passenger_tire_is_compared_band_by_band() -> None:
    """A row a band, a column a history: forces a tenth larger are 0.83 dB off, and the worst is said."""
    step, random = 2e-4, np.random.default_rng(3).standard_normal((2000, 3))

    def history(axle: float) -> FullHistory:
        return FullHistory(step, {"contact force": random, "axle force": axle * random}, 0.8, 0.0)

    table = passenger.compared_table("tire", {"252 modes": history(1.1)}, history(1.0))
    assert [name for name, _ in table.columns] == ["force", "band", "252 modes"]
    bands = ["125", "160", "200", "250", "315", "400", "500", "worst"]
    assert [row[1] for row in table.rows] == bands * 2
    assert {row[2] for row in table.rows[:8]} == {0.0}
    assert [row[2] for row in table.rows[8:]] == pytest.approx([0.83] * 8, abs=0.005)
    assert "252 modes 2, the reference 2" in table.notes[1]
