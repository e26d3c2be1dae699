"""A state on the road as the start of another one, and what is told of the way to it."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import InitialState, place
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import Rolling

TILTED = RoadShape(camber=np.radians(4.0))
WANTED = {"load": None, "deflection": None, "road_height": None}


def pressed(body, speed, road, near=None, **given):
    """(state, what the next can start from, the loads told) of a tire that turns."""
    told = []
    loader = LoadStepper(Equilibrium(body, Rolling(speed=speed, damping=200.0), road), told.append)
    loader.inflate(2e5, near and near.inflated)
    place(loader, **WANTED | given, initial=near)
    state = static_state(loader.equilibrium, loader.touch)
    return state, InitialState.of(loader, loader), told


@pytest.mark.parametrize(
    ("road", "given"), [(FLAT, {"load": 300.0}), (TILTED, {"deflection": 0.005})]
)
def test_another_speed_takes_a_step_each_from_the_last_state(make_body, road, given) -> None:
    body = make_body()
    _, near, _ = pressed(body, 30.0, road, **given)
    state, _, told = pressed(body, 30.01, road, near, **given)
    assert [one.what for one in told] == ["inflation", "deflection"]
    assert max(one.step.iterations for one in told) <= 2
    exact, *_ = pressed(make_body(), 30.01, road, **given)
    for found, from_zero in ((state.displacement, exact.displacement), (state.force, exact.force)):
        assert np.abs(found - from_zero).max() < 1e-8 * np.abs(from_zero).max()
    assert state.touch_height == pytest.approx(exact.touch_height, rel=1e-12)


def test_a_start_from_which_nothing_converges_is_left(make_body) -> None:
    body = make_body()
    exact, near, _ = pressed(body, 30.0, FLAT, load=300.0)
    noise = np.random.default_rng(0).normal(scale=0.02, size=len(near.pressed))
    lost = replace(near, pressed=near.pressed + noise)
    state, _, told = pressed(body, 30.0, FLAT, lost, load=300.0)
    assert len(told) > 2  # in load steps
    assert np.abs(state.force - exact.force).max() < 1e-8 * exact.force.max()


@pytest.mark.parametrize("given", [{"load": 300.0}, {"deflection": 0.005}])
def test_a_tilted_wheel_is_told_of_as_the_scene_gives_it(make_body, given) -> None:
    """Load and deflection along the road's normal: in the wheel's axes they were cos 1.7 deg of that."""
    state, _, told = pressed(make_body(), 30.0, TILTED, **given)
    assert told[-1].load == pytest.approx(state.load, rel=1e-9)
    assert told[-1].value == pytest.approx(state.deflection, rel=1e-9)
    for name, value in given.items():
        assert getattr(state, name) == pytest.approx(value, rel=1e-9)
