"""Strain energies against formulas written anew, and their place in the section."""

import basix
import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import MATERIALS, compound
from tireroad.fem.tire.mesh import Region

F = np.array([[1.2, 0.1, -0.05], [0.2, 0.9, 0.1], [0.0, -0.15, 1.1]])


SMALL = {"youngs_modulus": 3e6, "poisson_ratio": 0.3}
LARGE = {"c10": 4e5, "bulk_modulus": 5e6}
PARAMETERS = {
    "linear": SMALL,
    "neo-hookean": SMALL,
    "mooney-rivlin": LARGE | {"c01": 1e5},
    "yeoh": LARGE | {"c20": -3e4, "c30": 2e4},
    "reduced-polynomial": LARGE | {"c20": -3e4, "c30": 2e4, "c40": -1e4, "c50": 3e3, "c60": -1e3},
    "polynomial": LARGE | {"c01": 1e5, "c20": 3e4, "c11": -2e4, "c02": 1e4},
    "arruda-boyce": {"mu": 4e5, "locking_stretch": 1.7, "bulk_modulus": 5e6},
    "ogden": {"moduli": (3e5, 2e5, -4e4), "powers": (1.3, 5.0, -2.6), "bulk_modulus": 5e6},
}


def expected(model: str, m) -> float:
    J, C = np.linalg.det(F), F.T @ F
    i1 = np.trace(C) * J ** (-2 / 3)
    i2 = (np.trace(C) ** 2 - np.trace(C @ C)) / 2 * J ** (-4 / 3)
    volume = m.bulk / 2 * (J - 1) ** 2
    if model == "neo-hookean":
        return m.shear / 2 * (i1 - 3) + volume
    if model == "mooney-rivlin":
        return m.c10 * (i1 - 3) + m.c01 * (i2 - 3) + volume
    if model == "yeoh":
        return m.c10 * (i1 - 3) + m.c20 * (i1 - 3) ** 2 + m.c30 * (i1 - 3) ** 3 + volume
    if model == "reduced-polynomial":
        series = (m.c10, m.c20, m.c30, m.c40, m.c50, m.c60)
        return sum(c * (i1 - 3) ** i for i, c in enumerate(series, 1)) + volume
    if model == "polynomial":
        linear = m.c10 * (i1 - 3) + m.c01 * (i2 - 3)
        second = m.c20 * (i1 - 3) ** 2 + m.c11 * (i1 - 3) * (i2 - 3) + m.c02 * (i2 - 3) ** 2
        return linear + second + volume
    if model == "arruda-boyce":
        series = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
        limit = m.locking_stretch**2
        chains = sum(c / limit ** (i - 1) * (i1**i - 3**i) for i, c in enumerate(series, 1))
        return m.mu * chains + volume
    if model == "ogden":
        stretches = np.sqrt(np.linalg.eigvalsh(C)) * J ** (-1 / 3)
        terms = zip(m.moduli, m.powers, strict=True)
        return sum(2 * mu / a**2 * (np.sum(stretches**a) - 3) for mu, a in terms) + volume
    E = (C - np.eye(3)) / 2
    return m.shear * np.sum(E * E) + (m.bulk - 2 * m.shear / 3) / 2 * np.trace(E) ** 2


@pytest.mark.parametrize("model", MATERIALS)
def test_energy_of_a_deformation(model):
    law = compound(model, 1.0, **PARAMETERS[model]).law
    cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    numbers = [fem.Constant(cube, getattr(law, name)) for name in law.coefficients]
    gradient = ufl.as_matrix(F.tolist())
    total = sum(law.energy(gradient.T * gradient, *numbers))
    energy = fem.assemble_scalar(compat.form(total * ufl.dx(cube, degree=0)))
    at_rest = ufl.Identity(3)
    energy -= fem.assemble_scalar(
        compat.form(sum(law.energy(at_rest, *numbers)) * ufl.dx(cube, degree=0))
    )
    # Ogden's is a sum of rational functions of the invariants.
    assert energy == pytest.approx(expected(model, law), rel=1e-7 if model == "ogden" else 1e-12)


@pytest.mark.parametrize("model", MATERIALS)
def test_moduli_are_the_curvature_of_the_energy(model):
    """Simple shear g at small g costs G g^2 / 2; equal stretch 1 + e costs 9 K e^2 / 2."""
    law = compound(model, 1.0, **PARAMETERS[model]).law
    cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    numbers = [fem.Constant(cube, getattr(law, name)) for name in law.coefficients]

    def energy(gradient: np.ndarray) -> float:
        deformed = ufl.as_matrix(gradient.tolist())
        total = sum(law.energy(deformed.T * deformed, *numbers))
        return fem.assemble_scalar(compat.form(total * ufl.dx(cube, degree=0)))

    has_shear, stretched, e = np.eye(3), np.eye(3) * (1 + 1e-4), 1e-4
    has_shear[0, 1] = e
    at_rest = energy(np.eye(3))
    assert energy(has_shear) - at_rest == pytest.approx(law.shear * e**2 / 2, rel=1e-3)
    assert energy(stretched) - at_rest == pytest.approx(9 * law.bulk * e**2 / 2, rel=1e-3)
    assert law.youngs == pytest.approx(2 * law.shear * (1 + law.poisson), rel=1e-12)


@pytest.mark.parametrize("model", MATERIALS)
def test_every_parameter_reaches_the_energy(model):
    law = compound(model, 1.0, **PARAMETERS[model]).law
    for name, value in PARAMETERS[model].items():
        more = tuple(1.1 * v for v in value) if isinstance(value, tuple) else 1.1 * value
        changed = compound(model, 1.0, **PARAMETERS[model] | {name: more}).law
        assert any(getattr(law, c) != getattr(changed, c) for c in law.coefficients), name


@pytest.mark.parametrize(
    ("model", "parameters", "words"),
    [
        ("gent", {}, "take one of arruda-boyce, linear, mooney-rivlin, neo-hookean"),
        ("ogden", {"moduli": (1e5, 2e5)}, "powers needs one for each of moduli"),
        ("ogden", {"moduli": (1e5, -2e5), "powers": (1.0, 2.0)}, "sum above 0"),
        ("ogden", {"powers": (30.0,)}, "30 are beyond what the elements carry"),
        ("neo-hookean", {"poisson_ratio": 0.5}, "poisson_ratio must be .*not 0.5"),
        ("neo-hookean", {"youngs_modulus": 0.0}, "youngs_modulus must be"),
        ("yeoh", {"c01": 1e5}, "unknown parameter c01; valid: c10"),
    ],
)
def test_bad_materials_are_refused(model, parameters, words):
    with pytest.raises(InputError, match=words):
        compound(model, 1.0, **parameters)


@pytest.mark.mpi
@pytest.mark.parametrize("mesh", [(8, 5, 1), (9, 6, 2), (10, 11, 3)])
def test_regions_have_their_volume_on_every_mesh(make_body, mesh):
    """Pappus: an annular sector turned about the axle, to what elements of order 3 make of circles."""
    tread, soft = (compound("yeoh", rho, c10=1e6, bulk_modulus=1e8) for rho in (900.0, 800.0))
    regions = [
        Region(material=tread, arc=(0, np.radians(40)), depth=(0.5, 1.0)),
        Region(material=soft, arc=(0, np.radians(30)), depth=(0.5, 1.0), side="left"),
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
    rubber = compound("yeoh", 1.0, c10=1e6, bulk_modulus=1e8)
    with pytest.raises(InputError, match="region 0.* no part of the wall"):
        make_body(regions=[Region(material=rubber, arc=np.radians([121.0, 130.0]))])


def test_nodes_of_an_edge_are_lobatto_points():
    points = basix.create_element(
        basix.ElementFamily.P, basix.CellType.interval, 3, basix.LagrangeVariant.gll_warped
    ).points
    np.testing.assert_allclose(np.sort(points[:, 0])[1], (1 - 1 / np.sqrt(5)) / 2, rtol=1e-12)
