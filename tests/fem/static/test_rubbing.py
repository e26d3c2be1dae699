"""Friction in the static state: closed forms on a roller, and what must hold on a tire."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import place
from tireroad.fem.static.road import FLAT
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.tests.validation import contact_closed_forms

LOAD = 1500.0
TURNING = Rolling(speed=40.0)


def pressed(body, friction, rolling=AT_REST, road=FLAT):
    """(state, loader) of a torus under LOAD."""
    loader = LoadStepper(Equilibrium(body, rolling, road), lambda progress: None)
    loader.inflate(2e5)
    loader = place(loader, LOAD, None, None, friction)
    return static_state(loader.equilibrium, loader.touch), loader


@pytest.fixture
def make(make_body):
    return lambda **more: make_body(**({"segments": 16, "arc": 8, "footprint_size": 0.3} | more))


def check_balance(state, loader, friction: float) -> None:
    """Node by node the forces of wall and air are those of the road, and lie in the cone."""
    assert state.load == pytest.approx(LOAD, rel=1e-8)
    out = loader.equilibrium._assemble_residual().reshape(-1, 3)
    face = loader.body.surface
    assert np.abs(out[face.local] - state.push[face.place]).max() < 1e-8 * state.force.max()
    size = np.linalg.norm(state.pull, axis=1)
    assert (size <= friction * state.force * (1 + 1e-7)).all()
    assert size.max() > 0.04 * state.force.max()


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.05, 0.8])
def test_pressed_on_the_road_it_is_in_balance_with_forces_within_the_cone(make, friction) -> None:
    state, loader = pressed(make(), Friction(coefficient=friction, steps=4))
    check_balance(state, loader, friction)
    # Fore and aft, left and right are alike.
    assert np.abs(state.pull.sum(axis=0)).max() < 1e-8 * LOAD
    # The footprint cannot spread as it would: what sticks makes the tire stiffer.
    plain, _ = pressed(make(), None)
    assert state.deflection < plain.deflection
    assert plain.pull is None


@pytest.mark.slow
def test_hardly_any_friction_is_none(make) -> None:
    state, _ = pressed(make(), Friction(coefficient=1e-9, steps=2))
    plain, _ = pressed(make(), None)
    assert np.abs(state.displacement - plain.displacement).max() < 1e-9
    assert np.abs(state.force - plain.force).max() < 1e-5


@pytest.mark.long
def test_pushed_sideways_and_back_it_keeps_some_force(make) -> None:
    """The way counts: what slipped on the way there does not slip back at once."""
    _, loader = pressed(make(), Friction(coefficient=0.3, steps=2))
    problem, sliding = loader.equilibrium, loader.equilibrium.road.sliding
    forces = []
    for where in (2e-3, 0.0):
        sliding.commit()
        sliding.place[0] = where
        assert problem.solve(problem.road.height, load=LOAD).converged
        forces.append(problem.road.pull[:, 0].sum())
    assert forces[0] > 0.1 * 0.3 * LOAD
    assert forces[1] < -0.01 * forces[0]


@pytest.mark.long
def test_steps_of_the_way_there_are_fine_enough(make) -> None:
    """Pressed straight down, hardly any node turns round: 4 steps do as 16."""
    body = make()
    few, many = (
        pressed(body, Friction(coefficient=0.3, steps=steps))[0].deflection for steps in (4, 16)
    )
    assert many == pytest.approx(few, rel=1e-6)


@pytest.mark.long
def test_rolling_it_is_free_or_driven_or_drifts(make) -> None:
    body = make()
    state, loader = pressed(body, Friction(coefficient=0.8), TURNING)
    check_balance(state, loader, 0.8)
    assert abs(state.pull[:, 0].sum()) < 1e-4 * LOAD
    assert state.rolling_radius() == state.travel
    for slip in ((0.01, 0.0), (0.0, 0.01)):
        other, _ = pressed(body, Friction(coefficient=0.8, slip=slip), TURNING)
        force = other.pull.sum(axis=0)
        # Driving pushes the tire forward; drifting to the left it is pushed to the right.
        axis = slip.index(0.01)
        assert np.sign(force[axis]) == (1, -1)[axis] and abs(force[axis]) > 0.1 * LOAD
        assert abs(force[1 - axis]) < 0.2 * abs(force[axis])
        assert other.travel == pytest.approx(state.travel, rel=1e-6)
    # The moment about the vertical of a drifting tire turns it back: its force acts behind the middle.
    middle = state.force @ state.positions[:, 0] / LOAD
    behind = other.pull[:, 1] @ (other.positions[:, 0] - middle) / force[1]
    assert behind < 0


@pytest.mark.slow
def test_what_sticks_keeps_its_distance_on_the_road(make) -> None:
    """Along a streamline, nodes that stick lie apart by the travel in the angle between them."""
    body = make()
    state, loader = pressed(body, Friction(coefficient=5.0), TURNING)
    road = loader.equilibrium.road
    slid = road.sliding.slid()
    assert road.sticks.sum() >= 0.5 * road.active.sum()
    assert np.abs(slid[road.sticks]).max() < 1e-12
    assert np.abs(slid[road.active & ~road.sticks]).max(initial=1.0) > 1e-9


@pytest.mark.long
def test_pushed_sideways_as_cattaneo_and_mindlin_say() -> None:
    for pushed in contact_closed_forms.standing(contact_closed_forms.STIFF):
        half, stuck = contact_closed_forms.STATIC_HALF, np.sqrt(1 - pushed.share)
        x = pushed.x / half
        over = np.sqrt(np.maximum(1 - x**2, 1e-12))
        exact = 1 - np.sqrt(np.maximum(stuck**2 - x**2, 0.0)) / over
        far = np.abs(pushed.used - exact) * pushed.normal
        assert far.sum() < 0.03 * (pushed.used * pushed.normal).sum()
        assert pushed.in_the_middle == pytest.approx(1 - stuck, rel=0.03)


@pytest.mark.long
def test_it_rolls_as_carter_says() -> None:
    for share, force in contact_closed_forms.rolling(contact_closed_forms.STIFF, (0.2, 0.6)):
        assert force == pytest.approx(1 - (1 - share) ** 2, rel=0.045)


@pytest.mark.long
def test_a_thin_layer_that_sticks_is_a_brush() -> None:
    thick, thin = (
        contact_closed_forms.over_brush(replace(contact_closed_forms.LAYER, thickness=h))
        for h in (4e-3, 2e-3)
    )
    assert 1.0 < thin < 1.12
    assert 2 * thin - thick == pytest.approx(1.0, abs=0.04)
