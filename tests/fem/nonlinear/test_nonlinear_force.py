"""The nonlinear force: its sign and order, its cells on any number of processes, its weights, its training."""

import numpy as np
import pytest
from mpi4py import MPI
from nonlinear_tire import pressed, smooth
from scipy.optimize import nnls

from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import multiply, solve_all
from tireroad.fem.nonlinear.cells import cell_forms
from tireroad.fem.nonlinear.quasi_static import Elements, Linear, Reduced, climb
from tireroad.fem.nonlinear.reduced import at_nodes, outside, reduced_force, sizes
from tireroad.fem.nonlinear.road import Feature, contact_points
from tireroad.fem.nonlinear.training import (
    CellTangents,
    Settings,
    decomposed,
    half_turn,
    nonnegative,
    train,
)
from tireroad.fem.static.virtual_work import tangent


@pytest.fixture(scope="module")
def tire():
    return pressed(MPI.COMM_SELF)


@pytest.fixture(scope="module")
def shared():
    return pressed(MPI.COMM_WORLD)


def test_it_vanishes_with_its_slope_and_is_the_gradient_of_its_energy(tire):
    force, _ = tire
    motion = smooth(force, 1.0)[:, 0]
    assert not force.change(0 * motion).any()
    small, large = (force.nonlinear(size * motion[:, None])[:, 0] for size in (1e-4, 2e-4))
    assert np.linalg.norm(small) > 0
    assert np.linalg.norm(large - 4 * small) < 0.02 * np.linalg.norm(large)
    # Against the energy, whose cubic part is r's work.
    at, step = 4e-3 * motion, 1e-6 * motion
    slope = (force.energy(at + step) - force.energy(at - step)) / 2
    assert slope == pytest.approx(step @ (force.at_rest + force.change(at)), rel=1e-6)


def test_its_tangent_is_its_derivative(tire):
    force, _ = tire
    motions = smooth(force, 3e-3)
    matrix = force.tangent(motions[:, 0], motions[:, 0])
    there = force.change(motions[:, 0] + 1e-5 * motions[:, 1])
    back = force.change(motions[:, 0] - 1e-5 * motions[:, 1])
    found = multiply(matrix, motions[:, 1:2])[:, 0]
    assert np.allclose((there - back) / 2e-5, found, rtol=0, atol=1e-6 * np.abs(found).max())


@pytest.mark.mpi
def test_all_cells_give_the_assembled_force_and_every_process_the_same(shared):
    """Node order, quadrature, moduli and pressure of single cells, against dolfinx's own assembly."""
    force, _ = shared
    comm = force.body.comm
    V, motion = smooth(force, 1.0), smooth(force, 4e-3) @ np.array([1.0, -0.5, 0.3])
    number = np.sort(np.concatenate(comm.allgather(cell_forms(force.body, force.work, 1).number)))
    whole = reduced_force(force, V, number, np.ones(len(number)))
    at_kept = at_nodes(force, motion[:, None], whole.nodes)[:, 0]
    wanted = summed(comm, V.T @ force.nonlinear(motion[:, None]))[:, 0]
    size = np.abs(summed(comm, V.T @ force.change(motion))).max()
    found = whole.evaluate(at_kept)
    assert np.allclose(found, wanted, rtol=0, atol=1e-9 * size)
    assert len(set(comm.allgather(found.tobytes()))) == 1
    # Twice the weight, twice the force; and some cells alone are their part of it.
    some = number[::3]
    parts = [
        reduced_force(force, V, one, np.full(len(one), 2.0))
        for one in (some, np.setdiff1d(number, some))
    ]
    total = sum(part.evaluate(at_nodes(force, motion[:, None], part.nodes)[:, 0]) for part in parts)
    assert np.allclose(total, 2 * wanted, rtol=0, atol=1e-9 * size)


def test_cells_stiffness_is_that_of_small_motions(tire):
    """The moduli of both sides: dynamic ones, in the cells as in the matrix of the modes."""
    force, _ = tire
    cells = cell_forms(force.body, tangent(force.body, force.work), 2)
    motion = smooth(force, 1.0)[:, 0]
    rest = force.body.u.x.array
    here = (force.local(motion) - rest)[cells.place]
    size = here.shape[1]
    product = np.einsum("cij,cj->ci", cells(rest).reshape(-1, size, size), here)
    total = np.zeros(len(rest))
    np.add.at(total, cells.place.ravel(), product.ravel())
    wanted = multiply(force.operators.stiffness, motion[:, None])[:, 0]
    found = total[force.operators.unknowns.free]
    assert np.allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


def test_the_jacobian_is_the_change_of_the_tangent(tire):
    """By differences of the cells, from the cells' stiffnesses, and from the assembled matrices."""
    force, _ = tire
    vectors, motion = smooth(force, 1.0), smooth(force, 4e-3)[:, 0]
    number = np.sort(cell_forms(force.body, force.work, 1).number)
    whole = reduced_force(force, vectors, number, np.ones(len(number)))
    here = at_nodes(force, motion[:, None], whole.nodes)[:, 0]
    assert len(whole.evaluate(here)) == 3
    found = whole.jacobian(here, whole.vectors)
    matrix = force.tangent(motion, motion)
    inside = vectors.T @ multiply(matrix, vectors)
    wanted = inside - vectors.T @ multiply(force.operators.stiffness, vectors)
    assert np.allclose(found, wanted, rtol=0, atol=1e-4 * np.abs(wanted).max())
    found = CellTangents(force).between(vectors, motion)
    assert np.allclose(found, inside, rtol=0, atol=1e-10 * np.abs(inside).max())


def test_a_half_turned_motion_has_the_half_turned_force(tire):
    force, _ = tire
    turn = half_turn(force)
    assert turn is not None
    motions = smooth(force, 4e-3)
    assert np.allclose(turn(turn(motions)), motions, rtol=0, atol=1e-15)
    assert np.linalg.norm(turn(motions) - motions) > 0.1 * np.linalg.norm(motions)
    one, other = force.nonlinear(turn(motions)), turn(force.nonlinear(motions))
    assert np.linalg.norm(one - other) < 1e-6 * np.linalg.norm(one)


def test_weights_are_found_where_few_cells_carry_all():
    rng = np.random.default_rng(1)
    G = rng.normal(size=(60, 30))
    true = np.zeros(30)
    true[[3, 8, 20]] = 2.0, 0.5, 7.0
    b = G @ true
    weights, error = nonnegative(G.T @ G, G.T @ b, b @ b, 1e-7)
    assert np.allclose(weights, true, atol=1e-5)
    assert error <= 1e-7
    # Where no weights reach it, those are found that are nearest.
    far = rng.normal(size=60)
    weights, error = nonnegative(G.T @ G, G.T @ far, far @ far, 0.0)
    assert np.allclose(weights, nnls(G, far)[0], atol=1e-8)


def test_vectors_lack_of_no_state_more_than_asked(tire):
    force, _ = tire
    K = force.operators.stiffness
    motions = smooth(force, 1.0) @ np.array([[1.0, 0.2, 0.05], [0.1, 1.0, 0.02], [0, 1e-3, 0.3]])
    answers = motions[:, [1, 2, 0]]
    forces, straight = multiply(K, answers), motions + answers
    vectors, _ = decomposed(force, motions, answers, 0.05, 10)
    assert np.allclose(vectors.T @ multiply(K, vectors), np.eye(vectors.shape[1]), atol=1e-8)
    rest = answers - vectors @ (vectors.T @ forces)
    lacking = np.einsum("ns,ns->s", rest, multiply(K, rest))
    size = np.einsum("ns,ns->s", straight, multiply(K, straight))
    assert np.allclose(sizes(force, motions, answers) ** 2, size)
    off = outside(force, vectors, answers, forces)
    assert np.allclose(off**2, lacking, atol=1e-7 * size.max())
    assert (off <= 0.05 * np.sqrt(size)).all()


def test_features_have_the_slopes_they_say():
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-0.1, 0.1, size=(2, 200))
    step = 1e-6
    for road in (
        Feature(rise=0.01),
        Feature(height=0.01, length=0.05, position=0.02),
        Feature(height=-0.02, length=0.08, ramp=0.03, across=(-0.05, 0.02)),
    ):
        here = road.at(x, y)
        for axis, move in enumerate(((step, 0.0), (0.0, step))):
            up, down = road.at(x + move[0], y + move[1]), road.at(x - move[0], y - move[1])
            assert np.allclose(
                (up.height - down.height) / (2 * step), here.slope[:, axis], atol=1e-7
            )
            slope = (up.slope - down.slope) / (2 * step)
            near = np.abs(slope - here.curvature[:, axis]) < 1e-2
            assert near.all(axis=1).mean() > 0.97  # but at the ends of flanks, where it jumps
        turned = road.turned().at(-x, -y)
        assert np.allclose(turned.height, here.height)
        assert np.allclose(turned.slope, -here.slope)


@pytest.mark.slow
@pytest.mark.mpi
def test_the_trained_tire_stands_as_the_elements_do(shared):
    """Rises and a bar that were not trained, against Newton's method; the linear tire is several times farther off."""
    force, state = shared
    points = contact_points(force.body.lattice, state, 2e8, (0.012, 0.02), 0.14, 0.05)
    elements = Elements(force, points)
    bar = Feature(height=6e-3, length=0.04, position=0.02, ramp=0.03)
    trained = train(
        force,
        points,
        [
            Feature(rise=0.012),
            bar.times(0.8),
            Feature(height=6e-3, length=0.04, position=0.04, ramp=0.03),
        ],
        Settings(share=0.02, kept=5e-3, tolerance=3e-3),
    )
    shapes = solve_all(force.operators.stiffness, elements.columns)
    compliance = elements.seen(shapes)
    kept = at_nodes(force, shapes, trained.force.nodes)
    reduced = Reduced(
        points,
        compliance,
        elements.seen(trained.vectors),
        lambda load, s: trained.force.evaluate(kept @ load - trained.force.vectors @ s),
    )
    linear = Linear(points, compliance)
    assert np.allclose(points.rest.sum(), state.load)
    for road in (Feature(rise=0.010), bar, bar.turned()):
        motion = climb(elements, road, np.zeros(len(force.at_rest)), 3)
        true = elements.standing(motion, road).total()
        found = climb(reduced, road, reduced.rest(), 3).total()
        straight = climb(linear, road, linear.rest(), 3).total()
        size = np.abs(true).max()
        assert np.abs(found - true).max() < 0.02 * size, str(road)
        assert np.abs(straight - true).max() > 2 * np.abs(found - true).max(), str(road)
