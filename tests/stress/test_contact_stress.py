"""The stress list of `validate stability`, each case over its first steps: whole, or refused with a reason."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import Drive, roll
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.greens.recursion import Recursion
from tireroad.tests.validation.cases import RollingStrip, oval_patch
from tireroad.tests.validation.stability import (
    CRITICAL,
    RolledCase,
    cases,
    one_mode,
    rolled,
    thrown_up,
)

pytestmark = pytest.mark.slow

CASES = [replace(case, steps=min(case.steps, 400)) for case in cases()]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_case_ends_whole_or_refused(case) -> None:
    ended = rolled(case)
    if "critical" in case.name and case.strip.speed > CRITICAL and ended.refused:
        assert "positive definite" in ended.refused or "without bound" in ended.refused
    else:
        assert not ended.refused and np.isfinite(ended.load) and ended.residual < 1e-9
    assert ended.row[-1] != "not caught"


def test_one_mode_one_point() -> None:
    ended = one_mode()
    assert not ended.refused and ended.left and 0.9 < ended.growth < 1.1


def test_thousands_of_steps_gain_no_energy() -> None:
    ended = thrown_up(5000)
    rise = ended.said.split("by more than ")[1].split()[0]
    assert ended.left and float(rise) < 1e-12


def test_what_is_not_finite_counts_as_not_caught() -> None:
    assert RolledCase("made up", 1, float("nan"), 0.0, 0.0, False).row[-1] == "not caught"


def test_states_that_turn_far_in_a_step_are_static_or_blow_up() -> None:
    """Undamped, bouncing on a stiff tread: the default keeps its energy, without it there is no bound."""
    patch, step = oval_patch((9, 7), (0.015, 0.02), 500.0), 1e-4
    tread = half_space_compliance(patch.points[:, :2], patch.half_sizes, 1e8, 0.45)
    whole = RollingStrip(damping=0.0, wave_speed=250.0).response(patch.points, 40, 8, residual=10)
    assert np.abs(whole.eigenvalue).max() * step > 4.0

    def bump(t: float) -> float:
        return 6e-3 * (1 - np.cos(2 * np.pi * 60 * t)) if t < 1 / 60 else 0.0

    growth = []
    for response in (whole.resolved(step), whole):
        tire = Recursion(response=response, step=step, scheme="linear", comm=MPI.COMM_SELF)
        solver = ActiveSet(tire.same_step + tread)
        energy = []
        for instant in roll(tire, solver, patch, Drive(Flat().height, bump, 0.0), step, 3000):
            if instant.time > 1 / 60:
                energy.append((np.abs(tire.state) ** 2).sum())
        growth.append(max(energy) / energy[0])
    assert growth[0] < 1.1 and growth[1] > 100


def test_overdamped_strip_has_its_own_static_answer() -> None:
    """Poles and static flexibility of the made-up tire agree whatever its damping."""
    points = np.array([[0.0, 0.0, 0.0], [0.03, 0.02, 0.0]])
    soft = RollingStrip(damping=1.0).response(points, 4, 3).static()
    for damping in (100.0, 2e3, 1e5):
        hard = RollingStrip(damping=damping).response(points, 4, 3)
        assert np.allclose(hard.static(), soft, rtol=1e-5, atol=0)
        # A unit impulse starts with the rate 1/m of the kept waves: g'(0) = Re[C s P].
        rate = ((hard.output * hard.eigenvalue) @ hard.input).real
        light = RollingStrip(damping=1.0).response(points, 4, 3)
        assert np.allclose(rate, ((light.output * light.eigenvalue) @ light.input).real)
