"""Cords that cannot stretch, in curved elements that bend: against closed forms of beams and rings."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from scipy import integrate, sparse
from scipy.sparse import linalg
from wheel_shapes import cylinder

from tireroad.fem import compat, kinematics
from tireroad.fem.tire.cords import Cords

RUBBER = 6e6


def hoop(stiffness: float) -> Cords:
    """Cords around the axle of a given membrane stiffness, N/m."""
    return Cords(name="hoop", angle=0.0, youngs_modulus=stiffness, area=1.0, spacing=1.0)


def elastic(body, C):
    """Hooke's law of Poisson's ratio 0: E/2 E : E, E the Green-Lagrange strain."""
    strain = (C - ufl.Identity(3)) / 2
    return RUBBER / 2 * ufl.inner(strain, strain)


def stiffness(body, more=0) -> sparse.csc_matrix:
    F = ufl.variable(kinematics.deformation_gradient(body.u))
    stress = ufl.diff(elastic(body, F.T * F), F)
    work = ufl.inner(stress, ufl.grad(body.test)) * body.dx + body.plies.work(body.u, body.test)
    form = compat.form(ufl.derivative(work + more, body.u, body.trial))
    matrix = fem.petsc.assemble_matrix(form)
    matrix.assemble()
    return sparse.csc_matrix(sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize()))


@pytest.mark.slow
@pytest.mark.parametrize(("order", "angle", "within"), [(2, 15.0, 0.01), (3, 15.0, 0.01)])
def test_bending_of_a_curved_strip_with_a_ply_off_its_middle(order, angle, within):
    """Moment of a sector bent by its end sections: E b int (r - r_p)^2 / r dr a unit turn per angle, the ply at r_p its
    neutral line (Winkler and Bach). Elements of 15 degrees, as along a tire's arc by default; the ply ten
    thousand times as stiff as the wall, on the outer face and a quarter below it."""
    radius, height, width = 0.1, 0.012, 0.01
    count = 4
    sector = np.radians(count * angle)
    for ply in (radius, radius - height / 4):
        counts = (count, 1 if ply == radius else 4, 1)
        body = cylinder(
            [hoop(1e4 * RUBBER * height)],
            [(0, 1)],
            radius=radius,
            height=height,
            width=width,
            counts=counts,
            sector=sector,
            order=order,
        )
        x = body.space.tabulate_dof_coordinates()
        if ply != radius:  # the face of one layer alone
            middles = _cell_radii(body)
            for sheet in body.plies.sheets:
                sheet.stiffness.x.array[np.abs(middles - (ply - height / 8)) > 1e-4] = 0.0
        K = stiffness(body)
        turn = np.arctan2(x[:, 0], -x[:, 2])
        held, moved = np.flatnonzero(turn < 1e-6), np.flatnonzero(turn > sector - 1e-6)
        n = len(x)
        fixed = np.zeros((n, 3), bool)
        fixed[held], fixed[moved], fixed[:, 1] = True, True, True
        # The far section moves as one: two translations and a turn about the axle.
        rigid = np.zeros((n, 3, 3))
        rigid[moved, 0, 0] = rigid[moved, 2, 1] = 1.0
        rigid[moved, 0, 2], rigid[moved, 2, 2] = -x[moved, 2], x[moved, 0]
        free = np.flatnonzero(~fixed.ravel())
        rigid = rigid.reshape(3 * n, 3)
        coupling = K @ rigid
        inner = linalg.spsolve(K[free][:, free], coupling[free])
        H = rigid.T @ coupling - coupling[free].T @ inner
        moment = H[2, 2] - H[2, :2] @ np.linalg.solve(H[:2, :2], H[:2, 2])
        r = np.linspace(radius - height, radius, 2001)
        density = (r - ply) ** 2 / r
        exact = RUBBER * width / sector * integrate.trapezoid(density, r)
        assert moment == pytest.approx(exact, rel=within), (order, ply)


def _cell_radii(body) -> np.ndarray:
    """Radius of the middle of each cell."""
    x = body.space.tabulate_dof_coordinates()
    radius = np.hypot(x[:, 0], x[:, 2])
    count = len(body.plies.sheets[0].owner)
    return np.array([radius[body.space.dofmap.cell_dofs(cell)].mean() for cell in range(count)])


@pytest.mark.long
def test_ring_modes_of_a_belt_under_tension():
    """In the plane, n = 2 to 7, on 100 segments around as by default:

    omega^2 = n^2 (n^2 - 1) / ((n^2 + 1) rho A) [(n^2 - 1) EI / R^4 + N / R^2],

    inextensional, N the tension that a follower pressure holds (from the second variation of bending energy,
    tension and enclosed area; it is Endo's formula at rest without N). The cords lie on the outer face, so EI = E b
    h^3 / 3, ten thousand times as stiff as the rubber."""
    radius, height, width, density = 0.3, 0.5e-3, 0.01, 1200.0
    cord = 1e4 * RUBBER * height
    body = cylinder(
        [hoop(cord)],
        [(0, 1)],
        radius=radius,
        height=height,
        width=width,
        counts=(100, 1, 1),
    )
    tension = 2e-5 * cord * width
    strain = tension / (cord * width)
    body.u.interpolate(lambda x: strain * np.array([x[0], 0 * x[1], x[2]]))
    pressure = tension / (width * radius)
    inner = body.faces[0]
    pushed = kinematics.pressure_virtual_work(body.u, body.test, inner.normal)
    K = stiffness(body, pressure * inner.integral(pushed, "full"))
    assert abs(K - K.T).max() < 1e-6 * abs(K).max()
    mass = fem.petsc.assemble_matrix(
        compat.form(density * ufl.inner(body.trial, body.test) * body.dx)
    )
    mass.assemble()
    M = sparse.csc_matrix(sparse.csr_matrix(mass.getValuesCSR()[::-1], shape=mass.getSize()))
    plane = np.flatnonzero(np.arange(K.shape[0]) % 3 != 1)
    K, M = (matrix[plane][:, plane] for matrix in ((K + K.T) / 2, M))
    n = np.arange(2, 8)
    area, bending = width * height, RUBBER * width * height**3 / 3
    exact = n**2 * (n**2 - 1) / ((n**2 + 1) * density * area)
    exact = exact * ((n**2 - 1) * bending / radius**4 + tension / radius**2)
    found = linalg.eigsh(K, 18, M, sigma=-0.3 * exact[0], return_eigenvectors=False)
    found = np.sort(found)[3:]  # three rigid motions in the plane
    np.testing.assert_allclose(np.sqrt(found[0:12:2]), np.sqrt(exact), rtol=0.01)
    np.testing.assert_allclose(np.sqrt(found[1:12:2]), np.sqrt(exact), rtol=0.01)
