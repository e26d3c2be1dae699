"""The nonlinear problem: its tangent, its road, and the same answer on any number of processes."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.material import compound


def loaded(make_body, load=400.0, comm=MPI.COMM_SELF, rolling=None, **more):
    equilibrium = Equilibrium(make_body(comm=comm, **more), rolling or Rolling())
    steps = []
    loader = LoadStepper(equilibrium, steps.append)
    loader.inflate(2e5)
    loader.carry(load)
    return static_state(equilibrium, loader.touch), steps, loader


def test_the_road_carries_the_load_and_only_pushes(make_body):
    state, steps, loader = loaded(make_body, segments=16, footprint_size=0.3)
    assert state.load == pytest.approx(400.0, rel=1e-8)
    assert state.force.min() == 0.0
    touching = state.force > 0
    assert state.gap[~touching].min() > 0
    height = state.positions[touching, 2] - state.road_height
    assert abs(height).max() < 1e-15
    assert steps[-1].step.residual < 1e-12
    assert loader.newton_steps == sum(step.step.iterations for step in steps)


def test_a_standing_tire_keeps_both_mirror_planes(make_body):
    state, *_ = loaded(make_body, segments=16, footprint_size=0.3)
    force = state.force.reshape(state.shape)
    np.testing.assert_allclose(force, force[:, ::-1], atol=1e-9 * force.max())
    np.testing.assert_allclose(force[1:], force[:0:-1], atol=1e-9 * force.max())


@pytest.mark.slow
def test_damping_of_the_rolling_shape_tilts_the_footprint_forward(make_body):
    """Thesis, figures 7.2 and 7.3; turning the other way it tilts the other way."""
    arms = []
    for speed in (60.0, -60.0):
        state, *_ = loaded(
            make_body, segments=16, footprint_size=0.3, rolling=Rolling(speed=speed, damping=500.0)
        )
        arms.append(state.force @ state.positions[:, 0] / state.load)
    assert arms[0] > 1e-4
    assert arms[1] == pytest.approx(-arms[0], rel=1e-6)


def test_the_way_to_a_deflection_does_not_matter(make_body):
    equilibrium = Equilibrium(make_body())
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(2e5)
    loader.deflect(0.004)
    load, shape = loader.load(), equilibrium.body.u.x.array.copy()
    loader.deflect(0.007)
    assert equilibrium.solve(loader.touch + 0.004).converged
    assert loader.load() == pytest.approx(load, rel=1e-9)
    np.testing.assert_allclose(equilibrium.body.u.x.array, shape, atol=1e-10)


def test_a_step_that_fails_leaves_the_state_as_it_was(make_body):
    equilibrium = Equilibrium(make_body())
    equilibrium.pressure.value = 2e5
    assert equilibrium.solve().converged
    before = equilibrium.body.u.x.array.copy()
    equilibrium.pressure.value = -1e9
    step = equilibrium.solve()
    assert not step.converged
    np.testing.assert_array_equal(equilibrium.body.u.x.array, before)


def test_the_road_finds_its_height_for_a_load(make_body):
    """Load and height in one Newton loop; the height then gives the load back."""
    equilibrium = Equilibrium(make_body(segments=16, footprint_size=0.3))
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(2e5)
    loader.deflect(0.002)
    step = equilibrium.solve(equilibrium.road_height, load=1.3 * loader.load())
    wanted = loader.load()
    assert step.converged
    assert step.iterations <= 4
    loader.deflect(0.002)
    assert loader.load() * 1.3 == pytest.approx(wanted, rel=1e-9)


def test_a_road_below_the_tire_finds_no_height(make_body):
    equilibrium = Equilibrium(make_body(segments=8, arc=2))
    step = equilibrium.solve(-1.0, load=100.0)
    assert not step.converged
    assert "meets no resistance" in step.reason


def test_a_factorisation_out_of_memory_says_so(make_body):
    """ICNTL(23) gives MUMPS one MB."""
    options = PETSc.Options("static_")
    options["mat_mumps_icntl_23"] = 1
    try:
        equilibrium = Equilibrium(make_body(segments=16, arc=10))
        equilibrium.pressure.value = 2e5
        with pytest.raises(ConvergenceError, match="MUMPS could not factorise.*INFOG"):
            equilibrium.solve()
    finally:
        options.delValue("mat_mumps_icntl_23")


def test_no_load_below_zero(make_body):
    loader = LoadStepper(Equilibrium(make_body(segments=8, arc=2)), lambda progress: None)
    loader.inflate(0.0)
    with pytest.raises(InputError, match="positive load"):
        loader.carry(-1.0)


@pytest.mark.parametrize("ratio", [0.3, 0.49, 0.4995])
def test_newton_steps_do_not_grow_towards_incompressibility(make_body, ratio):
    rubber = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=ratio)
    _, steps, _ = loaded(make_body, material=rubber)
    assert max(step.step.iterations for step in steps) <= 8


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize(
    "rolling",
    [
        Rolling(),
        Rolling(speed=60.0, damping=500.0),
        Rolling(speed=60.0, damping=0.0, stiffness_damping=1e-4),
    ],
)
def test_the_same_state_on_any_number_of_processes(make_body, rolling):
    alone, *_ = loaded(make_body, rolling=rolling)
    shared, *_ = loaded(make_body, comm=MPI.COMM_WORLD, rolling=rolling)
    np.testing.assert_allclose(shared.displacement, alone.displacement, atol=1e-10)
    np.testing.assert_allclose(shared.force, alone.force, atol=1e-7 * alone.load)
    assert shared.touch_height == pytest.approx(alone.touch_height, rel=1e-12)
