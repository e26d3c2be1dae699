"""Load-deflection curve and stiffness of the stuck footprint: other methods, identities, rigid limit, mesh."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import solve_all
from tireroad.fem.matrices.operators import Operators, rigid_motions
from tireroad.fem.matrices.road_stiffness import road_stiffness
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import load_curve, slopes

pytestmark = pytest.mark.slow

PRESSURE = 2e5


def loaded(body, deflection):
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(PRESSURE)
    loader.deflect(deflection)
    return loader


def patch(loader):
    """Own nodes in contact, and the centre of pressure on the road."""
    body, force = loader.body, loader.equilibrium.contact_force()
    places = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    total, moment = body.comm.allreduce(force.sum()), body.comm.allreduce(force @ places)
    return np.flatnonzero(force > 0), moment / total


def stiffness(loader):
    return road_stiffness(loader.body, PRESSURE, *patch(loader))


def test_curve_is_that_of_single_runs_and_its_tangent_that_of_differences(make_body):
    """Loads as from runs of their own; the slope against central differences of 0.1 mm steps."""
    tire = {"segments": 16, "arc": 6, "footprint_size": 0.4}
    loader = LoadStepper(Equilibrium(make_body(**tire)), lambda progress: None)
    loader.inflate(PRESSURE)
    wanted = [0.004, 0.0079, 0.008, 0.0081]
    curve = load_curve(loader, wanted)
    for point in (curve[0], curve[2]):
        alone = loaded(make_body(**tire), point.deflection)
        assert point.load == pytest.approx(alone.load(), rel=1e-8)
    slope = (curve[3].load - curve[1].load) / 2e-4
    assert curve[2].tangent == pytest.approx(slope, rel=1e-3)
    areas = [point.footprint.area for point in curve]
    assert np.all(np.diff(areas) > 0)
    assert curve[0].pressure == pytest.approx(curve[0].load / areas[0])


def test_vertical_tangent_is_that_of_the_equilibrium_and_sticking_is_stiffer(make_body):
    """Assembled apart, without Newton's stress prediction; friction adds constraints (Rayleigh)."""
    loader = loaded(make_body(segments=16, arc=12, footprint_size=0.3), 0.012)
    found = stiffness(loader)
    assert found.frictionless == pytest.approx(loader.equilibrium.road_stiffness(), rel=1e-8)
    assert found.matrix[2, 2] > found.frictionless
    assert found.asymmetry < 1e-9
    assert np.linalg.eigvalsh((found.matrix + found.matrix.T) / 2).min() > 0


def test_stiffness_is_the_inverse_of_the_flexibility_under_tangential_forces(make_body):
    """Another method: unit forces on every dof in contact, and the plate's constraint on their answers."""
    loader = loaded(make_body(segments=12, arc=6, footprint_size=0.3), 0.012)
    body = loader.body
    nodes, centre = patch(loader)
    operators = Operators(body, PRESSURE)
    touching = np.flatnonzero(np.isin(operators.unknowns.free // 3, nodes))
    unit = np.zeros((len(operators.mass), len(touching)))
    unit[touching, np.arange(len(touching))] = 1.0
    flexibility = solve_all(operators.stiffness, sparse.csc_matrix(unit))
    places = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(places - centre)[operators.unknowns.free][touching]
    expected = motions.T @ np.linalg.solve(flexibility[touching], motions)
    assert stiffness(loader).matrix == pytest.approx(expected, rel=1e-6, abs=1e-6 * expected.max())


def test_a_free_rim_and_no_pressure_leave_no_stiffness(make_body):
    """Rigid limit: what nothing holds follows the plate."""
    body = make_body(segments=12, arc=4, free=True)
    points = body.lattice.points(body.ids)
    low = np.flatnonzero((points[:, 2] < -0.27) & np.isin(np.arange(body.nodes), body.tread))
    held = road_stiffness(make_body(segments=12, arc=4), 0.0, low, np.array([0, 0, -0.32]))
    free = road_stiffness(body, 0.0, low, np.array([0, 0, -0.32]))
    assert np.abs(free.matrix).max() < 1e-6 * np.abs(held.matrix).max()


def test_symmetric_tire_has_no_coupling_across_its_mirror_planes(make_body):
    """x, rotation about y, and z do not push sideways; pulling sideways does not turn about z."""
    found = stiffness(loaded(make_body(segments=16, arc=12, footprint_size=0.3), 0.012)).matrix
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    assert np.abs((found / scale)[np.ix_([1, 3, 5], [0, 2, 4])]).max() < 1e-7
    assert abs(found[1, 5] / scale[1, 5]) < 1e-7


@pytest.mark.long
def test_finer_elements_come_down_to_a_limit(make_body):
    """Lateral stiffness of three meshes: softer with refinement, and by less each time."""
    values = [
        stiffness(loaded(make_body(segments=n, arc=k, footprint_size=0.3), 0.01)).lateral
        for n, k in ((12, 6), (20, 10), (32, 16))
    ]
    steps = np.abs(np.diff(values))
    assert steps[1] < 0.6 * steps[0]
    assert steps[1] < 0.06 * values[-1]


def test_slopes_of_a_known_curve():
    """F = k d^1.5: closed form, to 1 % inside from six points."""
    d = np.linspace(0.004, 0.024, 6)
    found = slopes(d, 1e6 * d**1.5, d[1:-1])
    assert found == pytest.approx(1.5e6 * d[1:-1] ** 0.5, rel=0.01)
    assert slopes(d[:2], 2e5 * d[:2], d[:2]) == pytest.approx([2e5, 2e5])


def test_too_few_nodes_are_refused(make_body):
    with pytest.raises(InputError, match="at least three"):
        road_stiffness(make_body(), PRESSURE, np.array([5]), np.zeros(3))


@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(make_body):
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        loader = loaded(make_body(segments=12, arc=6, footprint_size=0.3, comm=comm), 0.012)
        found.append(stiffness(loader).matrix)
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-6 * found[0].max())
