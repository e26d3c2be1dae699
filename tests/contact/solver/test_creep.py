"""A tread that creeps: against published rolling cylinders, its elastic limits, and in time."""

import numpy as np
import pytest

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.laws.viscoelastic import Viscoelastic
from tireroad.contact.tread.memory import TreadMemory, creep_of, steady
from tireroad.fem.errors import InputError
from tireroad.tests.validation.contact_closed_forms import (
    CREEP_SPEED,
    DX,
    DY,
    PUBLISHED,
    cylinder,
    influence,
    matrix,
    pressed,
    rolled_strip,
)


@pytest.mark.parametrize(("time", "published"), PUBLISHED.items())
def test_published_pressure_of_rolling_cylinders(time, published) -> None:
    """Within 2 % (1.1 % at 0.009 s, a grid four times finer changes 0.02 %); most of it in front between the limits."""
    patch, pressure = cylinder(), rolled_strip(time)
    assert pressure.max() == pytest.approx(published, rel=0.012)
    x = patch.points[:, 0]
    centre = float(x @ pressure / pressure.sum())
    if time in (0.009, 0.045):
        assert centre > 0.2e-3
    else:
        assert abs(centre) < 0.02e-3


@pytest.mark.long
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_rolled_in_time_it_comes_to_the_steady_state(share) -> None:
    """Steps of a point, and of 0.3 of it, where material is read between the points."""
    patch, creep = cylinder(), (np.array([0.6, 0.4]), np.array([0.003, 0.01]))
    exact = pressed(ActiveSet(matrix(patch) @ steady(creep, patch, CREEP_SPEED)), patch.gap)
    step = share * DX / CREEP_SPEED
    memory = TreadMemory(creep, influence, patch, CREEP_SPEED, step)
    solver = ActiveSet(matrix(patch) * memory.at_once)
    for k in range(int(0.06 / step)):
        past = memory.predict()[0]
        pressure = pressed(solver, patch.gap + past)
        memory.advance(pressure * DX * DY * 1e6)
        if k == 40:
            again = TreadMemory(creep, influence, patch, CREEP_SPEED, step)
            again.set_state(memory.state())
            assert (again.predict() == memory.predict()).all()
    assert np.abs(pressure - exact).max() < (1e-6 if share == 1.0 else 0.01) * exact.max()


def test_standing_it_creeps_to_its_relaxed_modulus() -> None:
    patch, creep = cylinder(), (np.array([0.5]), np.array([0.01]))
    memory, force = TreadMemory(creep, influence, patch, 0.0, 1e-3), patch.gap[::-1] * 1e6
    for _ in range(100):
        past = memory.predict()[0]
        memory.advance(force)
    whole = past + memory.at_once * matrix(patch) @ force
    grown = 1.0 + 0.5 * (1.0 - np.exp(-10.0))
    first = (
        0.5 * (1 - (1 - np.exp(-0.1)) / 0.1) * np.exp(-9.9)
    )  # the first force came up over a step
    assert whole == pytest.approx((grown - first) * (matrix(patch) @ force), rel=2e-4)


def test_relaxation_as_creep() -> None:
    """One term by hand; of three E(s) J(s) = 1 at any s."""
    size, lag = creep_of([0.5], [1.0])
    assert [*size, *lag] == pytest.approx([1.0, 2.0])
    share, time = np.array([0.2, 0.3, 0.1]), np.array([1e-3, 1e-2, 1.0])
    size, lag = creep_of(share, time)
    for s in (0.1, 3.0, 1e3):
        modulus = 1 - (share / (1 + s * time)).sum()
        assert modulus * (1 + (size / (1 + s * lag)).sum()) == pytest.approx(1.0, rel=1e-12)
    for bad in (([0.5, 0.5], [1.0, 2.0]), ([0.2], [1.0, 2.0]), ([0.2, 0.2], [1.0, 1.0])):
        with pytest.raises(InputError):
            creep_of(*bad)
        with pytest.raises(InputError):
            Viscoelastic(relaxation=bad[0], relaxation_time=bad[1])
