"""Roads that are no level plane: camber and drums."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import place
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.state import static_state

SHAPES = {
    "camber": RoadShape(camber=np.radians(4.0)),
    "drum": RoadShape(drum_radius=0.85),
    "inside": RoadShape(drum_radius=0.9, inside=True),
    "both": RoadShape(camber=np.radians(-3.0), drum_radius=0.85),
}


def pressed(make_body, road, comm=MPI.COMM_SELF, **given):
    """(state, loader) of the tire under 1500 N, or as given."""
    equilibrium = Equilibrium(make_body(comm=comm, segments=16, footprint_size=0.3), shape=road)
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(2e5)
    wanted = {"load": None, "deflection": None, "road_height": None} | (given or {"load": 1500.0})
    place(loader, **wanted)
    return static_state(equilibrium, loader.touch), loader


@pytest.mark.parametrize("name", SHAPES)
def test_slopes_are_those_of_the_height(name) -> None:
    road, step = SHAPES[name], 1e-6
    x, y = np.array([-0.2, 0.0, 0.1, 0.79, 0.9]), np.array([0.05, -0.02, 0.0, 0.01, 0.1])
    along = (road.height(x + step, y) - road.height(x - step, y)) / (2 * step)
    across = (road.height(x, y + step) - road.height(x, y - step)) / (2 * step)
    assert np.allclose(road.slopes(x, y), [along, across], atol=1e-7)
    frames = road.frames(x, y)
    assert np.allclose(frames @ frames.transpose(0, 2, 1), np.eye(3))
    assert np.allclose(np.linalg.det(frames), 1.0)
    tangents = np.stack([[np.ones(5), 0 * x, along], [0 * x, np.ones(5), across]])  # 2, 3, 5
    assert np.allclose(np.einsum("nj,tjn->tn", frames[:, 2], tangents), 0.0, atol=1e-7)


@pytest.mark.parametrize("name", SHAPES)
def test_rolled_out_distances_are_those_on_the_surface(name) -> None:
    """A place moved along the frame's first vector moves by as much in xi, along the second in eta; up, in neither; the first
    turns towards the normal as `bending` says."""
    road, step = SHAPES[name], 1e-6
    x, y = np.array([-0.2, 0.0, 0.1]), np.array([0.05, -0.02, 0.0])
    places = np.stack([x, y, road.height(x, y)], axis=-1)
    frames = road.frames(x, y)
    for axis, moved in ((0, [1, 0]), (1, [0, 1])):
        ends = [road.unrolled(places + sign * step * frames[:, axis]) for sign in (1, -1)]
        assert np.allclose((ends[0] - ends[1]) / (2 * step), moved, atol=1e-7)
    assert np.allclose(road.unrolled(places + 0.1 * road.up), road.unrolled(places))
    ahead, back = (places + sign * step * frames[:, 0] for sign in (1, -1))
    turned = (road.frames(*ahead.T[:2]) - road.frames(*back.T[:2]))[:, 0] / (2 * step)
    assert np.allclose(turned, road.bending(x)[:, None] * frames[:, 2], atol=1e-6)


def test_a_drum_is_a_circle() -> None:
    x = np.linspace(-0.3, 0.3, 7)
    z = SHAPES["drum"].height(x, 0 * x)
    assert np.allclose(np.hypot(x, z + 0.85), 0.85)
    assert np.allclose(SHAPES["inside"].height(x, 0 * x), 0.9 - np.sqrt(0.81 - x**2))


@pytest.mark.long
@pytest.mark.parametrize("name", SHAPES)
def test_pressed_on_it_the_tire_is_in_balance_with_what_is_normal_to_it(name, make_body) -> None:
    """The forces of wall and air are, dof by dof, those of the road along its normal; nothing is inside it."""
    road = SHAPES[name]
    state, loader = pressed(make_body, road)
    assert state.load == pytest.approx(1500.0, rel=1e-8)
    touching = state.force > 0
    height = state.seen[:, 2] - state.road_height
    assert touching.sum() > 3 and np.abs(height[touching]).max() < 1e-15
    assert height[~touching].min() > 0
    equilibrium = loader.equilibrium
    equilibrium.road.active[:] = False  # the plain forces
    out = equilibrium._assemble_residual().reshape(-1, 3)
    face = loader.body.surface
    assert np.abs(out[face.local] - state.push[face.place]).max() < 1e-9 * state.force.max()
    normal = state.frames[:, 2] * state.normal_force[:, None]
    assert np.allclose(normal, state.push, atol=1e-9)


@pytest.mark.slow
def test_a_drum_of_a_kilometre_is_a_plane(make_body) -> None:
    plane, _ = pressed(make_body, FLAT, deflection=0.008)
    drum, _ = pressed(make_body, RoadShape(drum_radius=1e3), deflection=0.008)
    assert drum.load == pytest.approx(plane.load, rel=1e-3)
    assert drum.load != plane.load


@pytest.mark.long
def test_what_a_drum_does_to_the_footprint(make_body) -> None:
    """Shorter and softer on it, longer and stiffer inside it; fore and aft alike."""
    states = [
        pressed(make_body, road, deflection=0.01)[0]
        for road in (SHAPES["drum"], FLAT, SHAPES["inside"])
    ]
    loads = [state.load for state in states]
    lengths = [state.footprint().length for state in states]
    assert loads == sorted(loads) and lengths == sorted(lengths)
    push = states[0].push.sum(axis=0)
    assert abs(push[0]) < 1e-9 * push[2]


@pytest.mark.slow
def test_camber_loads_the_side_it_leans_to(make_body) -> None:
    """To the right, -y, and as its mirror image to the left; the load is along the road's normal."""
    right, left = (
        pressed(make_body, RoadShape(camber=sign * np.radians(4.0)))[0] for sign in (1, -1)
    )
    middle = [state.force @ state.positions[:, 1] / state.force.sum() for state in (right, left)]
    # The torus's section is a circle of 0.1 m: it touches where that has turned by the angle.
    assert middle[0] == pytest.approx(-0.1 * np.sin(np.radians(4.0)), rel=0.2)
    assert middle[1] == pytest.approx(-middle[0], rel=1e-6)
    push = right.push.sum(axis=0)
    assert np.linalg.norm(push) == pytest.approx(1500.0, rel=1e-8)
    assert push[1] / push[2] == pytest.approx(np.tan(np.radians(4.0)))


@pytest.mark.slow
@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(make_body) -> None:
    alone, _ = pressed(make_body, SHAPES["both"])
    shared, _ = pressed(make_body, SHAPES["both"], comm=MPI.COMM_WORLD)
    assert np.abs(shared.force - alone.force).max() < 1e-7 * alone.force.max()
