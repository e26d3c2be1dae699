"""Cords against closed forms: a strip, a net under pressure, a wavy ring."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy import optimize
from steel_cords import STEEL, cords
from wheel_shapes import cylinder

from tireroad.fem import compat
from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.sections.torus import Torus
from tireroad.fem.static.state import cord_forces
from tireroad.fem.static.virtual_work import tangent
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound


def test_a_strip_of_two_belts_in_soft_rubber():
    """Laminate of +-20 degrees, inextensible cords: Ex = 4 G (cot^4 - cot^2 + 1), nu_xy = cot^2.

    Plane stress, rubber of Poisson's ratio 0.4999; both belts on one face of the cells, which is how plies
    on each other are laid."""
    G, height, alpha = 2e6, 0.004, np.radians(20.0)
    stiff = {"youngs_modulus": 1e7 * G, "area": 1e-6, "spacing": 1e-3}
    both = [cords(20.0, **stiff), cords(-20.0, **stiff)]
    radius, width, sector = 100.0, 0.01, 1e-4
    body = cylinder(
        both,
        [(0, 1), (1, 1)],
        radius=radius,
        height=height,
        width=width,
        counts=(1, 1, 1),
        sector=sector,
    )
    bulk = 2 * G * 1.4999 / (3 * (1 - 2 * 0.4999))

    def wall(u):
        strain = ufl.sym(ufl.grad(u))
        return G * ufl.inner(ufl.dev(strain), ufl.dev(strain)) + bulk / 2 * ufl.tr(strain) ** 2

    work = ufl.derivative(wall(body.u) * body.dx, body.u, body.test)
    K = fem.petsc.assemble_matrix(
        compat.form(tangent(body, work + body.plies.work(body.u, body.test)))
    )
    K.assemble()
    dense = K.convert("dense").getDenseArray()
    fields = np.empty((3, len(dense)))
    for axis, field in enumerate(fields):
        unit = np.eye(3)[axis]
        body.u.interpolate(lambda x, unit=unit: unit[:, None] * (x + [[0], [0], [radius]]))
        field[:] = body.u.x.array
    # The stiffness of homogeneous strains; then free across and through the strip.
    H = fields @ dense @ fields.T
    across = -np.linalg.solve(H[1:, 1:], H[1:, 0])
    volume = height * width * sector * (radius - height / 2)
    modulus = (H[0, 0] + H[0, 1:] @ across) / volume
    cot = 1 / np.tan(alpha) ** 2
    assert modulus == pytest.approx(4 * G * (cot**2 - cot + 1), rel=2e-3)
    assert -across[0] == pytest.approx(cot, rel=1e-3)
    # And across: Ey = 4 G (tan^4 - tan^2 + 1).
    rest = -np.linalg.solve(H[np.ix_([0, 2], [0, 2])], H[[0, 2], 1])
    modulus = (H[1, 1] + H[1, [0, 2]] @ rest) / volume
    assert modulus == pytest.approx(4 * G * (1 / cot**2 - 1 / cot + 1), rel=2e-3)


@pytest.mark.parametrize("start", [45.0, 60.0])
def test_a_net_under_pressure_finds_its_angle(start):
    """A closed tube of balanced cords alone: whatever the angle it was made with, pressure brings it to
    tan^2 = 2, from the axis (54.74 degrees), up to what the cords stretch."""
    radius, width = 0.1, 0.05
    stiff = {"youngs_modulus": 1e13, "area": 1e-6, "spacing": 1e-3}
    net = [cords(90 - start, **stiff), cords(start - 90, **stiff)]
    body = cylinder(
        net, [(0, 1), (1, 1)], radius=radius, height=0.002, width=width, counts=(12, 1, 1)
    )
    fields = [fem.Function(body.space) for _ in range(2)]
    fields[0].interpolate(lambda x: np.array([x[0], 0 * x[1], x[2]]))
    fields[1].interpolate(lambda x: np.array([0 * x[0], x[1], 0 * x[2]]))
    works = [
        compat.form(ufl.replace(body.plies.work(body.u, body.test), {body.test: field}))
        for field in fields
    ]
    pressure = 1e5

    def out_of_balance(stretch):
        around, along = stretch
        body.u.x.array[:] = (around - 1) * fields[0].x.array + (along - 1) * fields[1].x.array
        # Rates of the volume pi r^2 l, its ends included.
        rate = np.pi * radius**2 * width * np.array([2 * around * along, around**2])
        inside = np.array([fem.assemble_scalar(work) for work in works])
        return (inside - pressure * rate) / (pressure * radius**2 * width)

    inextensible = np.sin(np.arctan(np.sqrt(2))) / np.sin(np.radians(start))
    guess = [inextensible, np.cos(np.arctan(np.sqrt(2))) / np.cos(np.radians(start))]
    found = optimize.root(out_of_balance, guess, tol=1e-10)
    assert found.success
    around, along = found.x
    assert (np.tan(np.radians(start)) * around / along) ** 2 == pytest.approx(2.0, rel=1e-4)


@pytest.mark.mpi
def test_forces_of_cords_in_a_wavy_ring():
    """E A (lambda - 1) of hoop cords in a ring whose radius waves around it, on the grid in its order; and the same
    on any number of processes."""
    half = np.radians(30)
    section = Torus(
        outer_radius=5.1,
        minor_radius=5.0,
        thickness=0.002,
        half_angle=half,
        segments=16,
        elements_arc=8,
        elements_thickness=1,
        order=2,
        grading="uniform",
    )
    ring = section.ring((), [PlyLine("hoop", (-half, half), 1.0)])
    soft = compound("neo-hookean", 1000.0, youngs_modulus=1e3, poisson_ratio=0.45)
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        body = Body(comm, ring, {"wall": soft}, cords=[cords(0.0, "hoop", spacing=2e-3)])
        x = body.space.tabulate_dof_coordinates()
        outwards = x * [1.0, 0.0, 1.0] / np.hypot(x[:, 0], x[:, 2])[:, None]
        strain = np.sin(3 * np.arctan2(x[:, 0], -x[:, 2])) * 1e-3 + 1e-4 * x[:, 1]
        radius = np.hypot(x[:, 0], x[:, 2])
        body.u.x.array[:] = (outwards * (strain * radius)[:, None]).ravel()
        found.append(cord_forces(body)["hoop"])
    alone, shared = found
    np.testing.assert_allclose(shared.force, alone.force, atol=1e-12 * np.abs(alone.force).max())
    np.testing.assert_array_equal(shared.points, alone.points)
    np.testing.assert_allclose(shared.area, alone.area, rtol=1e-12)
    x, y, z = np.moveaxis(alone.points, -1, 0)
    # lambda = |(r + u_r) e_circ' ...| / r: hoop strain and the turn of a ring of radial waves.
    angle = np.arctan2(x, -z)
    strain = np.sin(3 * angle) * 1e-3 + 1e-4 * y
    turn = 3 * np.cos(3 * angle) * 1e-3
    exact = np.hypot(1 + strain, turn) - 1
    stiffness = STEEL["youngs_modulus"] * STEEL["area"]
    np.testing.assert_allclose(alone.force, stiffness * exact, atol=2e-2 * stiffness * 1e-3)
    assert alone.area.sum() == pytest.approx(
        2 * np.pi * 5.0 * (0.1 * 2 * half + 5.0 * 2 * np.sin(half)), rel=1e-3
    )
    assert (np.diff(alone.points[0, :, 1]) > 0).all()
    assert (np.diff(np.unwrap(angle[:, 0])) > 0).all()
    assert alone.compressed == pytest.approx(0.5, abs=0.05)
