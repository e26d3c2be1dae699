"""Cords in the wall: against closed forms of laminates and nets, and their own derivatives."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy import integrate
from steel_cords import STEEL, cords
from wheel_shapes import cylinder

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import ROTATION, Operators
from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.state import cord_forces
from tireroad.fem.static.virtual_work import Rolling, static_residual, tangent
from tireroad.fem.tire.plies import Face


def stored(body) -> float:
    return fem.assemble_scalar(compat.form(body.plies.energy(body.u)))


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("angle", [0.0, 20.0, -20.0, 90.0])
def test_the_energy_of_a_given_motion(angle, side):
    """W = k/2 (|F a| - 1)^2 with a = cos e_circ + sin e_arc, +x to +y at the lowest point: exact in a small
    sector, whichever face of the cells the ply is on."""
    one = cords(angle)
    body = cylinder([one], [(0, side)], radius=1.0, height=0.01, width=0.01, sector=1e-3)
    F = np.eye(3) + np.array([[0.01, 0.03, 0.0], [0.0, 0.02, 0.0], [0.0, 0.0, -0.01]])
    body.u.interpolate(lambda x: (F - np.eye(3)) @ x)
    a = np.array([np.cos(one.angle), np.sin(one.angle), 0.0])
    area = 0.01 * 1e-3 * (1.0 if side else 0.99)
    # Two elements through the wall: the face is on both, inside and at the edge.
    middle = 0.01 * 1e-3 * 0.995
    expected = one.stiffness / 2 * (np.linalg.norm(F @ a) - 1) ** 2 * (area + middle)
    assert stored(body) == pytest.approx(expected, rel=2e-3)


@pytest.fixture
def belted(make_body):
    """A torus with a radial ply on its inner face and a pair of belts, slack in compression, with mass."""
    wires = {"density": 7850.0, "compression": 0.1}
    ply = cords(90, "ply", youngs_modulus=9.87e9, area=4.21e-7, spacing=1e-3)
    lines = [ply, cords(20, "belt 1", **wires), cords(-20, "belt 2", **wires)]
    edge, half = np.radians(40), np.radians(120)
    places = [
        PlyLine("ply", (-half, half), 0.0),
        PlyLine("belt 1", (-edge, edge), 0.5),
        PlyLine("belt 2", (-edge, edge), 1.0),
    ]

    def make(massless=False, **more):
        own = [replace(one, density=0.0) for one in lines] if massless else lines
        return make_body(layers=2, cords=own, plies=places, **more)

    return make


def test_cords_without_strain_have_their_full_modulus(belted):
    """Whatever rounding makes of their stretch: no sign of 1e-16 decides the tangent."""
    body = belted(segments=8, arc=6)
    tangents = []
    for size in (0.0, 1e-17):
        body.u.x.array[:] = size * np.random.default_rng(1).standard_normal(len(body.u.x.array))
        tangents.append(Operators(body, 0.0).stiffness.getValuesCSR()[2])
    assert np.abs(tangents[1] - tangents[0]).max() < 1e-9 * np.abs(tangents[0]).max()
    assert [one.compressed for one in cord_forces(body).values()] == [0.0] * 3


def test_the_tangent_is_the_derivative_of_the_force(belted):
    """Against central differences at a large motion with stretched and compressed cords: 1e-6."""
    body = belted(segments=8, arc=6)
    rng = np.random.default_rng(1)
    body.u.x.array[:] = 1e-4 * rng.standard_normal(len(body.u.x.array))
    there = body.u.x.array.copy()
    work = body.plies.work(body.u, body.test)
    force, matrix = compat.form(work), compat.form(tangent(body, work))
    direction = 1e-4 * rng.standard_normal(len(there))
    K = fem.petsc.assemble_matrix(matrix)
    K.assemble()
    right, left = K.createVecs()
    right.array[:] = direction
    K.mult(right, left)

    def at(step):
        body.u.x.array[:] = there + step * direction
        return fem.petsc.assemble_vector(force).array.copy()

    step = 1e-4
    difference = (at(step) - at(-step)) / (2 * step)
    assert np.linalg.norm(left.array - difference) < 1e-6 * np.linalg.norm(difference)
    assert np.abs((K - K.transpose().copy()).norm()) < 1e-12 * K.norm()


def test_the_face_rule_measures_the_surface(make_body):
    """Area of the outer face of the torus, of one and of the sum of its layers; normals all point outwards."""
    body = make_body(segments=24, arc=12, layers=1)
    face = Face(body.mesh, 1, 1, 2)
    half, reach = np.radians(120), 0.32 - 0.1
    exact = 2 * np.pi * 0.1 * (reach * 2 * half + 0.1 * 2 * np.sin(half))
    for kind in ("reduced", "full", "nodes"):
        area = fem.assemble_scalar(compat.form(face.integral(fem.Constant(body.mesh, 1.0), kind)))
        assert area == pytest.approx(exact, rel=2e-4), kind
    # Divergence theorem: int X . n = 3 V of the cone under the face; by closed form of Pappus's parts.
    X = ufl.SpatialCoordinate(body.mesh)
    across = face.integral(ufl.dot(X, face.normal), "full")
    flux = fem.assemble_scalar(compat.form(across))
    r = lambda t: reach + 0.1 * np.cos(t)  # noqa: E731
    t = np.linspace(-half, half, 20001)
    density = 2 * np.pi * r(t) * 0.1 * (r(t) * np.cos(t) + 0.1 * np.sin(t) ** 2)
    assert flux == pytest.approx(integrate.trapezoid(density, t), rel=1e-4)


def test_the_mass_of_the_cords(belted):
    """Lumped and by full integration rho A_c / s times the area, and every nodal mass positive."""
    body, bare = (belted(segments=24, arc=12, massless=less) for less in (False, True))
    lumped, without = (b.nodal_mass() for b in (body, bare))
    assert lumped.min() > 0
    per_area = 7850.0 * STEEL["area"] / STEEL["spacing"]
    edge = np.radians(40)
    area = sum(2 * np.pi * b * (0.22 * 2 * edge + b * 2 * np.sin(edge)) for b in (0.1, 0.094))
    assert (lumped - without)[::3].sum() == pytest.approx(per_area * area, rel=3e-4)
    one = fem.Constant(body.mesh, 1.0)
    total = fem.assemble_scalar(compat.form(body.inertia(one)))
    assert total == pytest.approx(lumped[::3].sum(), rel=1e-4)


def test_the_matrices_of_a_turning_tire_keep_their_identities(belted, csr):
    """With the cords' mass: a translation feels no rotation, a turn about the axle no body rate, and the
    matrices stay skew and symmetric."""
    body = belted(segments=16, arc=6, free=True)
    operators = Operators(body, 0.0)
    rotation = operators.rotation()
    matrices = {name: csr(getattr(rotation, name)) for name in ROTATION}
    places = body.space.tabulate_dof_coordinates()[: body.nodes]
    shift = np.tile([1.0, 0.0, 0.0], body.nodes)
    turn = np.cross([0.0, 1.0, 0.0], places).ravel()
    for name, sign in {"gyroscopic": -1, "body": -1, "convective": 1, "body_convective": 1}.items():
        matrix = matrices[name]
        size = abs(matrix).sum(axis=1).max()
        assert abs(matrix - sign * matrix.T).max() < 1e-13 * size, name
    scale = abs(matrices["gyroscopic"]).sum(axis=1).max()
    assert np.abs(matrices["gyroscopic"] @ shift).max() < 1e-12 * scale
    assert np.abs(matrices["body"] @ turn).max() < 1e-3 * scale * np.abs(turn).max()


def test_inflation_of_a_belted_tire_balances_and_its_tangent_is_symmetric(belted, csr):
    """Newton's method with predicted stresses reaches 0.2 MPa in one step: steel in soft rubber, slack
    in compression."""
    body = belted(segments=12, arc=8, grading="uniform")
    equilibrium = Equilibrium(body)
    equilibrium.pressure.value = 2e5
    step = equilibrium.solve()
    assert step.converged, step.reason
    assert step.iterations <= 10
    matrix = csr(Operators(body, 2e5).stiffness)
    assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()


@pytest.mark.parametrize("name", ["ply", "belt 1", "belt 2"])
def test_a_cord_lies_in_its_direction_whichever_cell_names_the_face(belted, name):
    """Twist of the tire about z, a motion that tells +20 from -20 degrees: each cord's energy against the sum
    over the ply's surface of k/2 (|F a| - 1)^2, a from the torus's own coordinates."""
    body = belted(segments=24, arc=16)
    number, depth = {"ply": (0, 0.012), "belt 1": (1, 0.006), "belt 2": (2, 0.0)}[name]
    one, half = body.plies.cords[number], np.radians(120 if name == "ply" else 40)
    grad = 0.01 * np.array([[0.0, 1.0, 0.2], [0.5, 0.3, 0.0], [0.1, -0.4, 0.6]])
    body.u.interpolate(lambda x: grad @ x)
    only = [np.where(sheet.owner == number, 1.0, 0.0) for sheet in body.plies.sheets]
    for sheet, mask in zip(body.plies.sheets, only, strict=True):
        sheet.stiffness.x.array[:] *= mask
    ring = np.linspace(0, 2 * np.pi, 120, endpoint=False)[:, None]
    t, weight = np.polynomial.legendre.leggauss(40)
    arc, wall = half * t, 0.1 - depth
    reach = 0.22 + wall * np.cos(arc)
    zero = 0 * ring * arc
    circ = np.stack([np.cos(ring) + zero, zero, np.sin(ring) + zero], axis=-1)
    outward = np.stack([np.sin(ring) + zero, zero, -np.cos(ring) + zero], axis=-1)
    along = np.cos(arc)[:, None] * np.eye(3)[1] - np.sin(arc)[:, None] * outward
    a = np.cos(one.angle) * circ + np.sin(one.angle) * along
    strain = np.linalg.norm(a @ (np.eye(3) + grad).T, axis=-1) - 1
    modulus = one.stiffness * np.where(strain < 0, one.compression, 1.0)
    density = (modulus / 2 * strain**2).mean(axis=0) * 2 * np.pi * reach * wall * half
    assert stored(body) == pytest.approx(density @ weight, rel=2e-3)


def test_cords_without_a_place_and_places_without_cords_are_refused(make_body):
    line = PlyLine("belt", (-0.5, 0.5), 0.5)
    with pytest.raises(InputError, match="cords 'other': the section has no ply"):
        make_body(plies=[line], cords=[cords(20), cords(20, "other")])
    with pytest.raises(InputError, match="ply 'belt' has no cords"):
        make_body(plies=[line])
    with pytest.raises(InputError, match="spacing must be above 0"):
        cords(20, spacing=0.0)


@pytest.mark.mpi
def test_any_number_of_processes_has_the_same_cords(belted):
    """Energy, force and mass of a body shared by all processes, against this process alone."""
    bodies = belted(segments=8, arc=6), belted(segments=8, arc=6, comm=MPI.COMM_WORLD)
    found = []
    for body in bodies:
        wave = lambda x: 1e-3 * np.array([x[0] * x[1], x[2] ** 2, x[0] - x[1]])  # noqa: E731
        body.u.interpolate(wave)
        body.u.x.scatter_forward()
        pressure = fem.Constant(body.mesh, 2e5)
        form = compat.form(static_residual(body, pressure, Rolling(speed=80.0, damping=50.0)))
        out = fem.petsc.assemble_vector(form)
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        total = body.comm.allreduce(stored(body))
        mass = body.everywhere(body.nodal_mass().reshape(-1, 3))
        found.append((total, body.everywhere(out.array.reshape(-1, 3)), mass))
    (energy, force, mass), (other, shared_force, shared_mass) = found
    assert other == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(shared_force, force, atol=1e-12 * np.abs(force).max())
    np.testing.assert_allclose(shared_mass, mass, rtol=1e-12)


def test_a_lifted_ply_keeps_its_cords(make_body):
    """Energy of a tire that grows by one part in a thousand, against the integral over the section's arc with
    cos alpha = r cos alpha_0 / r_0 and s = s_0 (r / r_0) sin alpha / sin alpha_0."""
    half, drum, steep = np.radians(120), 0.25, np.radians(70)
    one = cords(70.0, "ply", drum_radius=drum)
    body = make_body(segments=16, arc=24, cords=[one], plies=[PlyLine("ply", (-half, half), 1.0)])
    strain = 1e-3
    body.u.interpolate(lambda x: strain * np.array([x[0], 0 * x[1], x[2]]))
    arc = np.linspace(-half, half, 4001)
    radius = 0.22 + 0.1 * np.cos(arc)
    cosine = radius / drum * np.cos(steep)
    sine = np.sqrt(1 - cosine**2)
    spacing = one.spacing * radius / drum * sine / np.sin(steep)
    # e_arc turns by sin(arc) e_r: what grows is the radius alone.
    stretch = np.sqrt((cosine * (1 + strain)) ** 2 + sine**2 * (1 + strain * np.sin(arc) ** 2) ** 2)
    density = one.youngs_modulus * one.area / spacing / 2 * (stretch - 1) ** 2
    exact = integrate.trapezoid(density * 2 * np.pi * radius * 0.1, arc)
    assert stored(body) == pytest.approx(exact, rel=3e-3)
    with pytest.raises(InputError, match="cannot be lifted"):
        cords(20.0, drum_radius=0.25).at(np.array([0.32]))
