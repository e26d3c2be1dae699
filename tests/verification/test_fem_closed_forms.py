"""The finite elements against closed forms: a thick Mooney tube and a thin free ring.

Both are cylinders about the axle: a torus whose section circle is so large that the strip of it in
use is flat.
"""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import eigsh, spsolve

from tireroad.fem import compat
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.virtual_work import Rolling, static_residual, tangent
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Torus

FLAT = 1e3  # m, radius of the section circle


def cylinder(outer, thickness, width, segments, layers, material, order=2) -> Body:
    half = width / 2 / FLAT
    section = Torus(
        outer_radius=outer,
        minor_radius=FLAT,
        thickness=thickness,
        half_angle=half,
        segments=segments,
        elements_arc=1,
        elements_thickness=layers,
        order=order,
        grading="uniform",
    )
    return Body(MPI.COMM_SELF, section, material)


def csr(matrix):
    return sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize())


def inflated_radius(segments: int, layers: int, order: int, pressure: float) -> float:
    """Inner radius of the inflated thick tube in plane strain; Newton with four load steps."""
    rubber = compound("mooney-rivlin", 1000.0, c10=4e5, c01=1e5, bulk_modulus=1e12)
    body = cylinder(0.30, 0.05, 0.02, segments, layers, rubber, order)
    constant = fem.Constant(body.mesh, 0.0)
    residual = static_residual(body, constant, Rolling())
    forces, matrix = (compat.form(f) for f in (residual, tangent(body, residual)))
    points = body.space.tabulate_dof_coordinates()
    held = np.zeros((body.nodes, 3), dtype=bool)
    held[:, 1] = True  # plane strain
    held[abs(points[:, 0]) < 1e-9, 0] = True  # quarter symmetry: no rigid motion
    held[abs(points[:, 2]) < 1e-9, 2] = True
    free = np.flatnonzero(~held.ravel())
    for constant.value in pressure * np.linspace(0.25, 1, 4):
        for _ in range(12):
            out = fem.petsc.assemble_vector(forces).array[free]
            assembled = fem.petsc.assemble_matrix(matrix)
            assembled.assemble()
            step = spsolve(csr(assembled)[free][:, free].tocsc(), -out)
            body.u.x.array[free] += step
            if abs(step).max() < 1e-12:
                break
    inner = np.hypot(points[:, 0], points[:, 2]) < 0.25 + 1e-4
    moved = points + body.u.x.array.reshape(-1, 3)
    return float(np.hypot(moved[inner, 0], moved[inner, 2]).mean())


def mooney_pressure(a: float) -> float:
    """Inner radius a -> pressure: 2 (C1 + C2) [ln(aB / bA) + (a^2 - A^2)(a^-2 - b^-2) / 2]."""
    A, B = 0.25, 0.30
    b = np.sqrt(a * a + B * B - A * A)
    return 2 * 0.5e6 * (np.log(a * B / (b * A)) + (a * a - A * A) * (a**-2 - b**-2) / 2)


@pytest.mark.parametrize(("radius", "pressure"), [(0.26, 22569.0), (0.275, 50385.0)])
def test_thick_incompressible_mooney_tube(radius, pressure):
    assert mooney_pressure(radius) == pytest.approx(pressure, rel=1e-4)
    errors = []
    for segments in (8, 16):
        found = inflated_radius(segments, segments // 8, 2, pressure)
        errors.append(abs(mooney_pressure(found) / pressure - 1))
    assert errors[0] < 1e-2
    assert errors[1] < 1e-3
    assert errors[1] < errors[0] / 4


def ring_frequencies(ratio: float, segments: int) -> np.ndarray:
    """In-plane bending of a free ring, n = 2, 3, 4, Hz."""
    R = 0.3
    h = ratio * R
    steel = compound("linear", 1200.0, youngs_modulus=480e6, poisson_ratio=0.3)
    body = cylinder(R + h / 2, h, h, segments, 1, steel)
    body.rim = np.array([], dtype=np.int32)
    operators = Operators(body, 0.0)
    stiffness, mass = csr(operators.stiffness).tocsc(), sparse.diags(operators.mass).tocsc()
    squares, shapes = eigsh(stiffness, 24, mass, sigma=-1.0)
    shapes = shapes.reshape(body.nodes, 3, -1)
    axial = (shapes[:, 1] ** 2).sum(axis=0) / (shapes**2).sum(axis=(0, 1))
    plane = np.sort(squares[(axial < 0.5) & (squares > 1.0)])
    return np.sqrt(plane[:6:2]) / 2 / np.pi


def test_thin_free_ring_at_rest():
    n, ratio, R = np.arange(2, 5), 0.01, 0.3
    exact = np.sqrt(n**2 * (n**2 - 1) ** 2 / (n**2 + 1) * 480e6 / 1200 * ratio**2 / 12) / R
    found = ring_frequencies(ratio, 144) * 2 * np.pi
    assert abs(found / exact - 1).max() < 1e-3
