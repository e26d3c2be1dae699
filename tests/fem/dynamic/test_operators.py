"""The matrices' identities (physics, section 3), on a mesh that nothing holds."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.sparse import diags
from scipy.sparse.linalg import eigsh

from tireroad.fem import compat
from tireroad.fem.matrices.operators import ROTATION, Operators
from tireroad.fem.static.equilibrium import Equilibrium


@pytest.fixture
def free_ring(make_body, csr):
    body = make_body(segments=12, arc=4, free=True)
    operators = Operators(body, 0.0)
    rotation = operators.rotation()
    matrices = {name: csr(getattr(rotation, name)) for name in ROTATION}
    matrices["stiffness"] = csr(operators.stiffness)
    return body, operators, matrices


def norm(matrix) -> float:
    return abs(matrix).sum(axis=1).max()


def field(body, values) -> np.ndarray:
    return values(*body.space.tabulate_dof_coordinates()[: body.nodes].T).ravel()


def test_symmetry_to_rounding(free_ring):
    *_, matrices = free_ring
    for name, sign in {
        "gyroscopic": -1,
        "body": -1,
        "convective": 1,
        "body_convective": 1,
        "stiffness": 1,
    }.items():
        matrix = matrices[name]
        assert norm(matrix - sign * matrix.T) < 1e-13 * norm(matrix), name


def test_inertia_couples_like_components_alone(free_ring):
    """Zeros that the pattern of the mesh would hold are not kept: products take a third of the time."""
    *_, matrices = free_ring
    for name in ROTATION:
        assert (matrices[name].data != 0).all(), name
    for name in ("gyroscopic", "convective"):
        entries = matrices[name].tocoo()
        assert (entries.row % 3 == entries.col % 3).all(), name
        assert 3 * matrices[name].nnz <= matrices["stiffness"].nnz, name


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pressure_on_clamped_edges_is_symmetric_in_every_order(make_body, csr, order):
    """At order 3 a rule of 2 x order leaves 7e-8, more than the lowest modes are stiff."""
    body = make_body(order=order, segments=8, arc=4)
    equilibrium = Equilibrium(body)
    equilibrium.pressure.value = 2e5
    assert equilibrium.solve().converged
    matrix = csr(Operators(body, 2e5).stiffness)
    assert norm(matrix - matrix.T) < 1e-13 * norm(matrix)


@pytest.mark.parametrize("axis", range(3))
def test_a_translation_feels_no_rotation(free_ring, axis):
    body, _, matrices = free_ring
    shift = np.tile(np.eye(3)[axis], body.nodes)
    for name in ("gyroscopic", "convective"):
        assert abs(matrices[name] @ shift).max() < 1e-12 * norm(matrices[name]), name


def test_convection_takes_energy_out(free_ring):
    *_, matrices = free_ring
    for name in ("convective", "body_convective"):
        some = np.random.default_rng(0).standard_normal((len(matrices[name].indptr) - 1, 5))
        assert ((some * (matrices[name] @ some)).sum(axis=0) < 0).all()


@pytest.mark.parametrize(
    ("motion", "allowed"),
    [
        (lambda x, y, z: np.stack([z, 0 * x, -x], axis=1), 2e-3),
        (lambda x, y, z: np.stack([x, y + 0 * x, z], axis=1), 2e-3),
        (lambda x, y, z: np.stack([0 * x, x**2 + z**2, 0 * x], axis=1), 2e-3),
    ],
    ids=["turn about the axle", "radial", "along the axle"],
)
def test_the_rolling_material_sees_no_axisymmetric_motion(free_ring, motion, allowed):
    body, operators, matrices = free_ring
    moved = field(body, motion)
    # In units of the rate 1 rad/s: the force over that of the inertia of a unit rate.
    scale = np.linalg.norm(operators.mass * moved)
    assert np.linalg.norm(matrices["body"] @ moved) < allowed * scale
    assert np.linalg.norm(matrices["gyroscopic"] @ moved) > 10 * allowed * scale or (
        np.allclose(moved.reshape(-1, 3)[:, [0, 2]], 0)
    )


@pytest.mark.mpi
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_diagonal_mass_is_positive_and_all_there(make_body, order):
    body = make_body(order, 16, 8, comm=MPI.COMM_WORLD, free=True)
    mass = Operators(body, 0.0).mass
    assert mass.min(initial=1.0) > 0
    half = np.radians(120)
    sheet = [0.22 * r**2 * half + 2 / 3 * r**3 * np.sin(half) for r in (0.1, 0.088)]
    total = 1200.0 * 2 * np.pi * (sheet[0] - sheet[1])
    assert body.comm.allreduce(mass.sum()) / 3 == pytest.approx(
        total, rel={1: 0.1, 2: 1e-3, 3: 1e-4}[order]
    )


@pytest.mark.slow
def test_frequencies_of_the_diagonal_mass_close_in_on_the_consistent_ones(make_body, csr):
    errors = []
    for segments, arc in ((8, 4), (16, 8)):
        body = make_body(2, segments, arc)
        operators = Operators(body, 0.0)
        u, v = ufl.TrialFunction(body.space), ufl.TestFunction(body.space)
        weighted = body.wall.density * ufl.inner(u, v) * body.dx
        assembled = fem.petsc.assemble_matrix(compat.form(weighted))
        assembled.assemble()
        consistent = csr(assembled)[operators.unknowns.free][:, operators.unknowns.free]
        stiffness = csr(operators.stiffness).tocsc()
        squares = [
            eigsh(stiffness, 10, mass.tocsc(), sigma=0, return_eigenvectors=False)
            for mass in (diags(operators.mass), consistent)
        ]
        errors.append(abs(np.sqrt(squares[0] / squares[1]) - 1).max())
    assert errors[0] < 0.06
    assert errors[1] < errors[0] / 3
