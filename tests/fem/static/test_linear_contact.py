"""What the road holds after a linearised step, by columns of a factor that was made with other nodes held."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static import tangent
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.tangent import LinearContact, held_step
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.material import compound

SOFT = compound("neo-hookean", 1100.0, youngs_modulus=5e6, poisson_ratio=0.49)
# Its tangent is not symmetric: columns of the matrix are not its rows.
ROLLING = Rolling(speed=40.0, damping=2000.0, stiffness_damping=0.0)


def inflated(make_body, comm=MPI.COMM_SELF, rolling=AT_REST):
    body = make_body(segments=9, material=SOFT, comm=comm)
    loader = LoadStepper(Equilibrium(body, rolling), lambda _: None)
    loader.inflate(1.5e5)
    return loader


def taken(equilibrium, active):
    """The tangent of the present state, factorised with some nodes held; how they close on the road."""
    equilibrium.road.active, equilibrium.road.force[:] = active.copy(), 0.0
    assert equilibrium._take_tangent()
    return equilibrium._system


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize(("load", "rolling"), [(None, AT_REST), (300.0, AT_REST), (300.0, ROLLING)])
def test_columns_are_as_good_as_a_factorisation(make_body, monkeypatch, load, rolling):
    """Nodes added and nodes let go, with and without a load: the step, forces and height of a fresh factor."""
    loader = inflated(make_body, MPI.COMM_WORLD, rolling)
    problem, road = loader.equilibrium, loader.equilibrium.road
    height = loader.touch + 4e-3
    road.height = height
    gap = road.gap()
    level = np.unique(np.round(np.concatenate(problem.body.comm.allgather(gap)), 9)) + 1e-8
    some, others = gap < level[5], (gap > level[1]) & (gap < level[9])  # in the factor, in the step
    out = problem._assemble_residual().copy()
    system = taken(problem, others)
    wanted = held_step(problem.body.comm, system, road, (out, system.gap_closure, load))
    reaction, rise, road.height = wanted[1], road.height - height, height
    monkeypatch.setattr(tangent, "_ROUNDS", 0)
    system = taken(problem, some)
    contact = LinearContact(problem.body.comm, system, road)
    road.active = others.copy()
    found = contact.step(out, system.gap_closure, load)
    everywhere = problem.body.comm.allreduce(abs(wanted[0]).max(), op=MPI.MAX)
    np.testing.assert_allclose(found[0], wanted[0], atol=1e-9 * everywhere)
    np.testing.assert_allclose(found[1], reaction, rtol=1e-7, atol=1e-6)
    assert road.height - height == pytest.approx(rise, abs=1e-12)
    both = (int((some & ~others).sum()), int((others & ~some).sum()))
    assert min(problem.body.comm.allreduce(np.array(both))) > 0


@pytest.mark.slow
def test_the_step_leaves_no_node_pulled_and_none_below_the_road(make_body):
    """Complementarity of the linearised problem itself: forces only push, gaps are open, one of both is 0."""
    loader = inflated(make_body)
    problem, road = loader.equilibrium, loader.equilibrium.road
    road.height = loader.touch + 15e-3
    out = problem._assemble_residual().copy()
    system = taken(problem, road.gap() < 0)
    before = int(road.active.sum())
    motion, reaction = LinearContact(problem.body.comm, system, road).step(
        out, system.gap_closure, None
    )
    gap = road.gap() + motion[road.dofs]
    assert 0 < road.active.sum() < before  # what penetrates is more than what will touch
    assert reaction.min() > 0
    assert abs(gap[road.active]).max() < 1e-12 and gap[~road.active].min() > 0


@pytest.mark.slow
@pytest.mark.parametrize("rolling", [AT_REST, ROLLING])
def test_the_same_state_with_no_more_tangents(make_body, monkeypatch, rolling):
    """As where each change of the sets costs a tangent."""
    ways = []
    for settle in (True, False):
        if not settle:
            monkeypatch.setattr(Equilibrium, "_make_contact", lambda self: None)
        loader = inflated(make_body, rolling=rolling)
        loader.carry(400.0)
        ways.append(loader)
    settled, plain = ways
    assert settled.newton_steps <= plain.newton_steps
    assert settled.deflection == pytest.approx(plain.deflection, rel=1e-9)
    found, wanted = (one.body.displacement() for one in ways)
    np.testing.assert_allclose(found, wanted, atol=1e-9 * abs(wanted).max())


@pytest.mark.slow
@pytest.mark.mpi
def test_the_predicted_state_errs_by_the_square_of_the_rise(make_body):
    """From a state in balance to another height of the road by its tangent, as long as no node comes or goes."""
    loader = inflated(make_body, MPI.COMM_WORLD)
    problem = loader.equilibrium
    loader.deflect(5e-3)
    assert problem.road_stiffness() > 0  # the tangent of the state itself
    start, kept, height = (
        problem.body.u.x.array.copy(),
        problem.road.snapshot(),
        problem.road.height,
    )
    sizes, errors = (2e-6, 1e-6), []
    for size in sizes:
        problem.body.u.x.array[:] = start
        problem.road.restore(kept)
        problem.road.height = height
        assert problem.predict(height + size)
        assert problem.road.height == pytest.approx(height + size, abs=1e-15)
        errors.append(problem._error(None))
    assert 3.5 < errors[0] / errors[1] < 4.5
    problem.body.u.x.array[:] += 1e-6
    assert not problem.predict(height)  # of another state the tangent is not


@pytest.mark.slow
def test_a_node_that_left_the_road_comes_back_to_it(make_body):
    """One that the factor holds, was lifted since, and is held again: it moves by its gap."""
    loader = inflated(make_body)
    problem, road = loader.equilibrium, loader.equilibrium.road
    loader.deflect(5e-3)
    problem.road_stiffness()
    node = np.flatnonzero(road.active)[road.force[road.active].argmax()]
    contact = LinearContact(problem.body.comm, problem._system, road)
    lifted = 1e-5
    problem.body.u.x.array[road.dofs[node]] += lifted
    motion, _ = contact.step(problem._assemble_residual().copy(), None, None)
    assert motion[road.dofs[node]] == pytest.approx(-lifted, rel=1e-9)
