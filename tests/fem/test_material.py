"""Strain energies against formulas written anew, and their place in the section."""

import basix
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import LAWS, Material
from tireroad.fem.tire.wall import Region

F = np.array([[1.2, 0.1, -0.05], [0.2, 0.9, 0.1], [0.0, -0.15, 1.1]])


def expected(m: Material) -> float:
    J, C = np.linalg.det(F), F.T @ F
    i1 = np.trace(C) * J ** (-2 / 3)
    i2 = (np.trace(C) ** 2 - np.trace(C @ C)) / 2 * J ** (-4 / 3)
    volume = m.bulk / 2 * (J - 1) ** 2
    if m.model == "neo-hookean":
        return m.shear / 2 * (i1 - 3) + volume
    if m.model == "mooney-rivlin":
        return m.c10 * (i1 - 3) + m.c01 * (i2 - 3) + volume
    if m.model == "yeoh":
        return m.c10 * (i1 - 3) + m.c20 * (i1 - 3) ** 2 + m.c30 * (i1 - 3) ** 3 + volume
    E = (C - np.eye(3)) / 2
    return m.shear * np.sum(E * E) + (m.bulk - 2 * m.shear / 3) / 2 * np.trace(E) ** 2


@pytest.mark.parametrize("model", LAWS)
def test_energy_of_a_deformation(model):
    small = {"youngs_modulus": 3e6, "poisson_ratio": 0.3}
    large = {"c10": 4e5, "c01": 1e5, "c20": -3e4, "c30": 2e4, "bulk_modulus": 5e6}
    material = Material(model, 1.0, **(small if model in ("linear", "neo-hookean") else large))
    cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    law = LAWS[model]
    numbers = [fem.Constant(cube, getattr(material, name)) for name in law.coefficients]
    gradient = ufl.as_matrix(F.tolist())
    total = sum(law.energy(gradient.T * gradient, *numbers))
    energy = fem.assemble_scalar(compat.form(total * ufl.dx(cube)))
    assert energy == pytest.approx(expected(material), rel=1e-12)


def test_unknown_model_is_refused():
    with pytest.raises(InputError, match="known are linear, neo-hookean"):
        Material("ogden", 1.0)


@pytest.mark.mpi
@pytest.mark.parametrize("mesh", [(8, 5, 1), (9, 6, 2), (10, 11, 3)])
def test_regions_have_their_volume_on_every_mesh(make_body, mesh):
    """Pappus: an annular sector turned about the axle, to what elements of order 3 make of circles."""
    tread, soft = (Material("yeoh", rho, c10=1e6, bulk_modulus=1e8) for rho in (900.0, 800.0))
    regions = [
        Region(tread, (0, np.radians(40)), depth=(0.5, 1.0)),
        Region(soft, (0, np.radians(30)), depth=(0.5, 1.0), side="left"),
    ]
    segments, arc, layers = mesh
    body = make_body(3, segments, arc, layers, regions=regions, comm=MPI.COMM_WORLD)

    def found(rho):
        inside = ufl.conditional(ufl.lt(abs(body.wall.density - rho), 1), 1.0, 0.0) * body.dx
        return body.comm.allreduce(fem.assemble_scalar(compat.form(inside)))

    def sector(low, high):
        a, b = 0.094, 0.1
        area, moment = (b**2 - a**2) / 2, (b**3 - a**3) / 3
        return 2 * np.pi * (0.22 * area * (high - low) + moment * (np.sin(high) - np.sin(low)))

    ends = np.radians([-40, -30, 0, 40])
    assert found(800.0) == pytest.approx(sector(*ends[1:3]), rel=3e-4)
    assert found(900.0) == pytest.approx(sector(*ends[:2]) + sector(*ends[2:]), rel=3e-4)


def test_a_region_that_holds_no_element_is_refused(make_body):
    rubber = Material("yeoh", 1.0, c10=1e6, bulk_modulus=1e8)
    with pytest.raises(InputError, match="region 0.* no part of the wall"):
        make_body(regions=[Region(rubber, np.radians([121.0, 130.0]))])


def test_nodes_of_an_edge_are_lobatto_points():
    points = basix.create_element(
        basix.ElementFamily.P, basix.CellType.interval, 3, basix.LagrangeVariant.gll_warped
    ).points
    np.testing.assert_allclose(np.sort(points[:, 0])[1], (1 - 1 / np.sqrt(5)) / 2, rtol=1e-12)
