"""The loop's tire with the reduced nonlinear force, against nonlinear finite elements in time."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

import tireroad as tr
from tireroad.contact.loop import ContactProblem, Drive, DrivenTire, Loop
from tireroad.contact.setup import nodes_within
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import winkler_compliance
from tireroad.fem.matrices.compliance import multiply, on_own_rows, solve_all
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import at_nodes, reduced_force
from tireroad.fem.nonlinear.road import Feature, contact_points
from tireroad.fem.nonlinear.training import Settings, train
from tireroad.fem.tire.material import power_law
from tireroad.fem.transient import FullTire, NonlinearTire
from tireroad.fem.wheel import Turning
from tireroad.greens import large_motion
from tireroad.greens.basis import Basis
from tireroad.greens.large_motion import LargeTire, large_response
from tireroad.greens.recursion import Recursion

pytestmark = [pytest.mark.slow, pytest.mark.mpi]

INFLATION, BED = 2e5, 2e8  # Pa, N/m3
DAMPING, STEP, LAST = (200.0, 0.0), 2e-4, 0.016  # s
RISE, RISEN = 12e-3, 8e-3  # m, s


class Case:
    """A soft torus on the road, its modes, its points on springs, its trained force and its response."""

    def __init__(self, comm):
        made = tr.torus(
            segments=12,
            elements_arc=4,
            order=2,
            footprint_size=0.3,
            youngs_modulus=2e7,
            comm=comm,
        )
        self.state = tr.press(made, inflation=INFLATION, deflection=6e-3)
        self.standing = tr.modes(made, self.state, count=240)
        self.operators = self.standing.motions.operators
        force = RestoringForce(self.operators, INFLATION)
        points = contact_points(made.lattice, self.state, BED, (0.012, 0.02), 0.14, 0.05)
        settings = Settings(share=0.02, kept=5e-3, tolerance=3e-3)
        self.trained = train(force, points, [Feature(rise=16e-3)], settings)
        self.patch = nodes_within(self.state, 0.03)
        count = len(self.state.points)
        up, along, across = (nodes(self.patch.index, count, k) for k in (2, 0, 1))
        self.points = sparse.vstack([up, along, across]).tocsr()
        rolling = tr.roll(self.standing, Turning(speed=0.0, damping=DAMPING))
        self.restoring, self.wheel = force, rolling.wheel
        basis, modes = Basis.of(rolling.states), self.standing.basis.modes
        given = self.points, force, self.trained.force, self.trained.vectors
        self.response = large_response(rolling.wheel, basis, modes, *given)

    def linear(self, rows=slice(None), step=STEP, ahead=False):
        response = self.response.between(rows, rows).resolved(step)
        comm = self.operators.body.comm
        return Recursion(response=response, step=step, scheme="linear", comm=comm, look_ahead=ahead)

    def large(self, ahead=False):
        return LargeTire(self.linear(ahead=ahead), self.trained.force, self.points.shape[0])

    def loop(self, tire, coefficient=0.0):
        patch, count = self.patch, len(self.patch.points)
        tread = winkler_compliance(patch.area, BED)
        solver, friction = ActiveSet(tire.same_step[:count, :count] + tread), None
        if coefficient:
            law = BrushLaw(1e5, coefficient, kind="spring")
            brush = Brush(law, patch.points[:, 0], patch.line, 0.0, STEP)
            friction = BrushFriction(brush, tire.same_step, None)
        return Loop(tire, ContactProblem(patch, tire.same_step, solver, friction))


def rising(time):
    part = np.clip(time / RISEN, 0.0, 1.0)
    return RISE * part * part * (3 - 2 * part)


DRIVE = Drive(lambda x, y: np.zeros(x.shape), rising, 0.0)


def forces(loop, step=STEP, last=LAST, done=0):
    """Vertical force (n,) N on the tire after each step."""
    blocks = loop.roll(DRIVE, step, round(last / step), done=done)
    return np.concatenate([block.total_force[:, 2] for block in blocks])


@pytest.fixture(scope="module")
def case():
    return Case(MPI.COMM_SELF)


@pytest.fixture(scope="module")
def shared():
    return Case(MPI.COMM_WORLD)


def test_its_static_response_is_that_of_the_finite_elements(case):
    """Forces at points and on the vectors; readings at points, at nodes of kept cells, and along the vectors."""
    force, operators, count = case.trained.force, case.operators, case.points.shape[0]
    vectors, own = case.trained.vectors, on_own_rows(case.operators, case.points)
    some = [0, count // 3 + 4, count - 2]
    shapes = np.hstack([solve_all(operators.stiffness, own[:, some]), vectors])
    found = case.response.static() + case.response.residual
    columns = [*some, *range(count, count + vectors.shape[1])]
    inside = at_nodes(case.restoring, shapes, force.nodes)
    for rows, wanted in ((slice(count), own.T @ shapes), (slice(-len(inside), None), inside)):
        assert np.allclose(found[rows][:, columns], wanted, rtol=0, atol=1e-7 * abs(wanted).max())
    along = found[count : -len(inside)][:, columns[len(some) :]]
    assert np.allclose(along, np.eye(vectors.shape[1]), atol=1e-7)


@pytest.mark.parametrize(("exponent", "speed"), [(0.15, 0.0), (0.0, 40.0)])
def test_vectors_loads_at_rest_and_rolling_and_with_moduli_over_frequency(exponent, speed):
    """-K V s moves the standing tire by -V s, whatever its modes' moduli; the rolling one by -K_Omega^-1 K V s."""
    rubber = {"youngs_modulus": 2e7, "poisson_ratio": 0.45, "dynamic": 1.3}
    material = tr.compound("neo-hookean", 1200.0, **rubber, spectrum=power_law(exponent))
    given = {"segments": 10, "elements_arc": 4, "order": 2, "comm": MPI.COMM_SELF}
    made = tr.torus(material=material, **given)
    state = tr.press(made, inflation=INFLATION, deflection=6e-3)
    standing = tr.modes(made, state, count=60)
    operators = standing.motions.operators
    assert (standing.basis.projection.rise is not None) == (exponent > 0)
    restoring = RestoringForce(operators, INFLATION)
    points = nodes(np.array([4, 12, 22]), len(state.points)).tocsr()
    shapes = solve_all(operators.stiffness, on_own_rows(operators, points[:2]))
    lower = np.linalg.cholesky(shapes.T @ multiply(operators.stiffness, shapes))
    vectors = np.linalg.solve(lower, shapes.T).T
    force = reduced_force(restoring, vectors, np.arange(0, 40, 7), np.ones(6))
    rolling = tr.roll(standing, Turning(speed=speed, damping=DAMPING))
    basis, modes = Basis.of(rolling.states), standing.basis.modes
    found = large_response(rolling.wheel, basis, modes, points, restoring, force, vectors)
    whole = (found.static() + found.residual)[5:, 3:]
    pushed = sparse.csr_matrix(multiply(operators.stiffness, vectors))
    moved = vectors if not speed else solve_all(rolling.wheel.rotating_stiffness, pushed)
    wanted = at_nodes(restoring, moved, force.nodes)
    assert np.allclose(whole, wanted, rtol=0, atol=1e-7 * abs(wanted).max())


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_a_rise_in_time_is_that_of_nonlinear_elements(case, friction):
    given = {"operators": case.operators, "damping": DAMPING, "step": STEP}
    given |= {"outputs": case.points, "loads": case.points}
    exact = forces(case.loop(NonlinearTire(inflation=INFLATION, **given), friction))
    straight = forces(case.loop(FullTire(rotation=None, speed=0.0, **given), friction))
    large = case.large()
    found = forces(case.loop(large, friction))
    size = np.sqrt(np.mean((exact - case.state.load) ** 2))
    off, far = (np.sqrt(np.mean((one - exact) ** 2)) / size for one in (found, straight))
    assert off < 0.04
    assert far > 0.09
    assert large.evaluations < 5 * len(found)


def test_without_motion_it_is_at_rest_and_small_motions_are_linear(case):
    count = case.points.shape[0]
    still = Drive(lambda x, y: np.zeros(x.shape), lambda t: 0.0, 0.0)
    tire = case.large()
    blocks = case.loop(tire).roll(still, STEP, 5)
    assert all(np.allclose(block.change, 0.0, atol=1e-9 * case.state.load) for block in blocks)
    assert not tire.s.any()
    shaking = Drive(DRIVE.height, lambda t: 1e-5 * np.sin(400 * t), 0.0)
    found = []
    for one in (case.large(), case.linear(slice(count))):
        steps = case.loop(one).roll(shaking, STEP, 40)
        found.append(np.concatenate([block.change for block in steps]))
    assert abs(found[0] - found[1]).max() < 5e-3 * abs(found[1]).max()


def test_it_begins_at_rest_under_forces_that_always_were(case):
    """Where the linear tire does, and stays there while these act on; from there on its force is nonlinear."""
    count = case.points.shape[0]
    force = np.zeros(count)
    touching = np.flatnonzero(case.patch.force > 0)
    force[touching] = 0.2 * case.patch.force[touching]
    tire = case.large()
    begun = tire.start_steady(force)
    assert np.array_equal(begun, case.linear(slice(count)).start_steady(force))
    for share in (1.0,) * 20 + (3.0,) * 20:
        free = tire.predict()
        while (again := tire.settle(share * force)) is not None:
            free = again
        moved = free + tire.same_step @ (share * force)
        tire.advance(share * force)
        if share == 1.0:
            assert abs(moved - begun).max() < 1e-9 * abs(begun).max()
            assert not tire.stored
    assert np.linalg.norm(tire.s) > 0.05 and tire.stored


def test_prescribed_forces_and_readings_beside_the_contact(case):
    """The first point is loaded and the last one read; with the same forces on all points they move as one tire."""
    count = case.points.shape[0]
    # The points of the contact, of the prescribed force, and what is read.
    order = np.r_[1 : count - 1, 0, count - 1]
    given = case.points[order], case.restoring, case.trained.force, case.trained.vectors
    basis = Basis.of(tr.roll(case.standing, Turning(speed=0.0, damping=DAMPING)).states)
    response = large_response(case.wheel, basis, case.standing.basis.modes, *given, count - 1)
    linear = Recursion(
        response=response.resolved(STEP), step=STEP, scheme="linear", comm=MPI.COMM_SELF
    )
    history = 400.0 * np.linspace(0.0, 1.0, 9)[:, None] ** 2
    inner = LargeTire(linear, case.trained.force, count - 1)
    driven = DrivenTire(inner, history, np.array([[0.0, 0.0, 1.0]]), seen=count - 2)
    whole = case.large()
    force = np.zeros(count)
    for pushed in history[1:, 0]:
        force[0], force[1 : count - 1] = pushed, 0.01 * pushed
        free = driven.predict()
        while (again := driven.settle(force[1 : count - 1])) is not None:
            free = again
        driven.advance(force[1 : count - 1])
        moved = whole.predict()
        while (again := whole.settle(force)) is not None:
            moved = again
        moved = moved + whole.same_step @ force
        whole.advance(force)
        seen = free + driven.same_step @ force[1 : count - 1]
        assert np.allclose(seen, moved[1 : count - 1], rtol=0, atol=2e-3 * abs(moved).max())
        assert np.allclose(driven.reading, moved[-1:], rtol=0, atol=2e-3 * abs(moved).max())
    assert np.allclose(inner.s, whole.s, atol=2e-3 * np.linalg.norm(whole.s))


def test_derivatives_taken_anew_lead_to_the_same_forces(case, monkeypatch):
    by_updates = forces(case.loop(case.large()))
    monkeypatch.setattr(large_motion, "STALE", 1)
    tire = case.large()
    found = forces(case.loop(tire))
    assert tire.derivatives > 20
    assert abs(found - by_updates).max() < 2e-3 * abs(found).max()


def test_it_goes_on_from_a_snapshot_with_the_same_bits(case):
    whole = forces(case.loop(case.large()))
    broken, again = (case.loop(case.large()) for _ in range(2))
    forces(broken, last=LAST / 2)
    again.restore(broken.snapshot())
    assert np.array_equal(forces(again, done=40), whole[40:])


@pytest.mark.parametrize("ahead", [False, True])
def test_the_same_on_any_number_of_processes(shared, case, ahead):
    one, several = forces(case.loop(case.large())), forces(shared.loop(shared.large(ahead)))
    # The states of the training differ by what they are solved to.
    assert abs(one - several).max() < 2e-3 * abs(one).max()
    assert len(set(MPI.COMM_WORLD.allgather(several.tobytes()))) == 1
