"""Friction in the static state on tilted roads and drums: tangent, limits, mirror images, sums."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import place
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling

LOAD, FRICTION = 1500.0, 0.3
TURNING = Rolling(speed=40.0)
BOTH = RoadShape(camber=np.radians(-3.0), drum_radius=0.85)
SHAPES = {
    "camber": RoadShape(camber=np.radians(4.0)),
    "drum": RoadShape(drum_radius=0.85),
    "inside": RoadShape(drum_radius=0.9, inside=True),
    "both": BOTH,
}


@pytest.fixture
def pressed(make_body):
    """(state, loader) of a torus under LOAD; `friction` None: none."""

    def press(road=FLAT, rolling=AT_REST, friction=FRICTION, comm=MPI.COMM_SELF, **more):
        body = make_body(segments=12, arc=6, footprint_size=0.25, comm=comm)
        loader = LoadStepper(Equilibrium(body, rolling, road), lambda progress: None)
        loader.inflate(2e5)
        has_friction = friction and Friction(**({"coefficient": friction, "steps": 3} | more))
        loader = place(loader, LOAD, None, None, has_friction)
        return static_state(loader.equilibrium, loader.touch), loader

    return press


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rolling", "road"),
    [
        (AT_REST, BOTH),
        (TURNING, SHAPES["inside"]),
        pytest.param(TURNING, BOTH, marks=pytest.mark.long),
    ],
    ids=["standing", "rolling inside", "rolling"],
)
def test_the_tangent_is_that_of_central_differences(pressed, rolling, road) -> None:
    """Of the balance that Newton's method solves, its stick, slip and ways held: in a random direction, drum, camber and
    the turning of normals included."""
    more = {"slip": (0.01, 0.005)} if rolling.speed else {}
    _, loader = pressed(road, rolling, **more)
    problem, contact, body = loader.equilibrium, loader.equilibrium.road, loader.body
    assert (contact.active & ~contact.sticks).sum() >= 2
    if not rolling.speed:
        assert contact.sticks.any()
    problem._before.x.array[:] = body.u.x.array
    problem._assemble_tangent()
    problem._unrolled.tangent(problem.matrix)
    joined = problem._system._joined(problem.matrix)
    direction = np.random.default_rng(5).normal(size=joined.getLocalSize()[0])
    direction[contact.held] = 0.0
    direction[problem._rim] = 0.0
    steps = [PETSc.Vec().createWithArray(direction), *joined.createVecs()]
    joined.mult(steps[0], steps[2])
    moved = direction
    if problem._system._carried is not None:
        problem._system._carried.mult(steps[0], steps[1])
        moved = steps[1].array_r.copy()
    change, start = problem._unrolled.spread(moved), body.u.x.array.copy()
    ends = []
    for size in (1e-7, -1e-7):
        body.u.x.array[:] = start + size * change
        ends.append(contact.rows(problem._residual().copy()))
    free = np.setdiff1d(np.arange(len(direction)), np.concatenate([contact.held, problem._rim]))
    found = ((ends[0] - ends[1]) / 2e-7)[free]
    here = contact._along[contact.active].ravel()
    scale = np.abs(found).max()
    assert np.abs(found - steps[2].array_r[free]).max() < 1e-6 * scale
    seen = np.isin(free, here)
    assert seen.any() and np.abs(found[seen]).max() > 1e-3 * scale


@pytest.mark.long
@pytest.mark.parametrize("rolling", [AT_REST, TURNING], ids=["standing", "rolling"])
@pytest.mark.parametrize("name", SHAPES)
def test_in_balance_with_forces_within_the_cone(pressed, name, rolling) -> None:
    """Forces of wall and air are, node by node, those of the road; none is larger than mu N; the load is the one wanted."""
    state, loader = pressed(SHAPES[name], rolling)
    assert state.load == pytest.approx(LOAD, rel=1e-8)
    out = loader.equilibrium._assemble_residual().reshape(-1, 3)
    face = loader.body.surface
    assert np.abs(out[face.local] - state.push[face.place]).max() < 1e-8 * state.force.max()
    size = np.linalg.norm(state.pull, axis=1)
    assert (size <= FRICTION * state.normal_force * (1 + 1e-7)).all()
    assert np.linalg.norm(state.pull.sum(axis=0)) <= FRICTION * state.normal_force.sum()
    # Tangential to the surface, and the normal part is what `normal_force` says.
    normal = state.frames[:, 2]
    assert np.abs((state.push * normal).sum(axis=1) - state.normal_force).max() < 1e-9 * LOAD
    touching = state.force > 0
    assert np.abs(state.seen[touching, 2] - state.road_height).max() < 1e-14
    if rolling.speed:  # no drag: normal forces on a drum's slopes count
        assert abs(state.push[:, 0].sum()) < 1e-4 * LOAD


@pytest.mark.long
@pytest.mark.parametrize("rolling", [AT_REST, TURNING], ids=["standing", "rolling"])
def test_camber_to_the_left_is_the_mirror_image_of_that_to_the_right(pressed, rolling) -> None:
    right, left = (
        pressed(RoadShape(camber=sign * np.radians(4.0)), rolling)[0] for sign in (1, -1)
    )
    forces = [state.pull.sum(axis=0) for state in (right, left)]
    assert forces[0][1] == pytest.approx(-forces[1][1], rel=1e-6)
    assert forces[0][0] == pytest.approx(forces[1][0], abs=1e-4 * LOAD)
    assert right.deflection == pytest.approx(left.deflection, rel=1e-9)
    # Towards the side to which it leans (-y): camber thrust. Standing it is smaller.
    assert forces[0][1] < -0.02 * LOAD


@pytest.mark.long
def test_small_slopes_are_none(pressed) -> None:
    """A drum of 10 km and a camber of 1e-6 rad: the level road's forces, to what the slope is."""
    level = pressed()[0]
    for road in (RoadShape(drum_radius=1e4), RoadShape(camber=1e-6)):
        state = pressed(road)[0]
        assert state.deflection == pytest.approx(level.deflection, rel=1e-4)
        assert np.abs(state.pull - level.pull).max() < 1e-3 * np.abs(level.pull).max()
        assert np.abs(state.pull - level.pull).max() > 0


@pytest.mark.slow
def test_on_a_drum_what_sticks_keeps_its_distance_around_it(pressed) -> None:
    """Along a streamline, nodes that stick lie apart by the travel in the angle between them, along the drum's arc."""
    state, loader = pressed(SHAPES["drum"], TURNING, friction=5.0)
    road = loader.equilibrium.road
    grid = road.shape.unrolled(state.positions).reshape(*state.shape, 2)
    stuck = np.zeros(len(state.points), dtype=bool)
    stuck[loader.body.surface.place] = np.isin(
        loader.body.surface.local, loader.body.tread[road.sticks]
    )
    where, ring = np.argwhere(stuck.reshape(state.shape)), loader.body.lattice.ring
    assert len(where) > 3
    for i, j in where:
        step = grid[(i + 1) % len(ring), j] - grid[i, j]
        angle = (ring[(i + 1) % len(ring)] - ring[i]) % (2 * np.pi)
        assert step == pytest.approx([angle * state.travel, 0.0], abs=1e-10)


@pytest.mark.slow
@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(pressed) -> None:
    alone, shared = (
        pressed(BOTH, TURNING, comm=comm)[0] for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert np.abs(shared.pull - alone.pull).max() < 1e-6 * np.abs(alone.pull).max()
