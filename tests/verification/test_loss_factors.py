"""Damping by modal strain energy: against complex eigenvalues, and through every way the modes go."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from scipy import sparse
from scipy.sparse import linalg

from tireroad.fem import compat
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Region, compounds
from tireroad.modal.basis import project
from tireroad.modal.damping import Proportional, StrainEnergy, beyond, rates
from tireroad.modal.rotating import matrices, standing
from tireroad.modal.solver import undamped
from tireroad.tests.validation.cases import thesis_torus

INFLATION = 1.0e5


def tire(crown: dict, side: dict, segments=8, arc=6, plies=True, comm=MPI.COMM_SELF) -> Body:
    """A small inflated torus of two compounds with a radial ply."""
    rubber = {"density": 1200.0, "youngs_modulus": 48e6, "poisson_ratio": 0.45}
    section = thesis_torus(segments=segments, elements_arc=arc)
    regions = (
        Region(material=compound("neo-hookean", **rubber, **crown), arc=(0.0, np.radians(50))),
    )
    lines = [PlyLine("ply", (-np.radians(120), np.radians(120)), 0.0)] if plies else []
    cords = [Cords(name="ply", angle=np.pi / 2, youngs_modulus=2e9, area=4.21e-7, spacing=1e-3)][
        : len(lines)
    ]
    ring = section.ring([regions[0].patch(0)], lines)
    wall = compound("neo-hookean", **rubber, **side)
    body = Body(comm, ring, compounds(wall, regions), cords=cords)
    equilibrium = Equilibrium(body)
    equilibrium.pressure.value = INFLATION
    assert equilibrium.solve().converged
    return body


def csr(matrix) -> sparse.csr_matrix:
    return sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize())


@pytest.mark.parametrize(
    ("crown", "side", "within"), [(0.1, 0.1, 0.005), (0.3, 0.3, 0.02), (0.3, 0.1, 0.03)]
)
def test_loss_factors_against_complex_eigenvalues(crown, side, within):
    """Of K + i sum eta_r K_r, under inflation and with cords that lose nothing: rate of decay -Re s of each mode
    and eta = Im lambda / Re lambda. 2 % up to tan delta = 0.3 all over; where it differs threefold from
    compound to compound what couples the modes is of second order and seen at 0.3."""
    body = tire({"loss_factor": crown}, {"loss_factor": side})
    operators = Operators(body, INFLATION)
    modes = undamped.solve(operators.stiffness, operators.mass, 24)
    found = operators.compounds()
    projection = project(modes, None, operators.carried, MPI.COMM_SELF, compounds=found)
    root = 1 / np.sqrt(operators.mass)
    scaled = csr(operators.stiffness) + 1j * csr(found[0].stiffness)
    scaled = sparse.diags(root) @ scaled @ sparse.diags(root)
    near = 0.9 * projection.squares[0]
    exact = linalg.eigs(scaled.tocsc(), 28, sigma=near, return_eigenvectors=False)
    exact = exact[np.argsort(exact.real)][: len(projection.squares)]
    np.testing.assert_allclose(projection.loss_factor, exact.imag / exact.real, rtol=within)
    assert np.ptp(projection.loss_factor) > 0.1 * crown  # the test can tell a mixed-up mode
    damped = standing(projection, StrainEnergy()).eigenvalue
    decay = np.sqrt(-exact).real  # s^2 = -lambda
    np.testing.assert_allclose(-damped.real, decay, rtol=within)


def test_one_compound_without_pressure_has_its_own_loss_factor():
    """K_r is all of K then: eta_k = eta exactly, and D_mod is eta omega_k."""
    body = tire({"loss_factor": 0.2}, {"loss_factor": 0.2}, plies=False)
    body.u.x.array[:] = 0.0
    operators = Operators(body, 0.0)
    modes = undamped.solve(operators.stiffness, operators.mass, 10)
    projection = project(
        modes, None, operators.carried, MPI.COMM_SELF, compounds=operators.compounds()
    )
    np.testing.assert_allclose(projection.loss_factor, 0.2, rtol=1e-8)
    drag, _ = matrices(projection, 0.0, StrainEnergy(), "full")
    np.testing.assert_allclose(np.diag(drag), 0.2 * np.sqrt(projection.squares), rtol=1e-8)


@pytest.mark.slow
def test_dynamic_moduli_scale_the_rubber_alone():
    """K(dynamic) - K = (dynamic - 1) K_material: exact with one factor everywhere; cords, pressure and the turning of
    stresses stay. Without load and cords all of K is material."""
    bare = Operators(tire({}, {}), INFLATION)
    stiff = Operators(tire({"dynamic": 1.4}, {"dynamic": 1.4}), INFLATION)
    lossy = Operators(tire({"loss_factor": 1.0}, {"loss_factor": 1.0}), INFLATION)
    difference = csr(stiff.stiffness) - csr(bare.stiffness)
    expected = 0.4 * csr(lossy.compounds()[0].stiffness)
    assert abs(difference - expected).max() < 1e-9 * abs(expected).max()
    body = tire({}, {"dynamic": 1.4}, plies=False)
    body.u.x.array[:] = 0.0
    one = Operators(body, 0.0)
    low = undamped.solve(one.stiffness, one.mass, 3).squares
    same = tire({}, {}, plies=False)
    same.u.x.array[:] = 0.0
    low_static = undamped.solve(Operators(same, 0.0).stiffness, one.mass, 3).squares
    assert (low > 1.05 * low_static).all()
    assert (low < 1.4 * low_static).all()


@pytest.mark.slow
def test_the_material_part_by_differences_of_the_stress():
    """The compounds' stiffness against central differences of the virtual work of the added stress."""
    from tireroad.fem.static.virtual_work import added_energy, added_stress

    body = tire({"loss_factor": 0.3}, {"loss_factor": 0.1})
    before = fem.Function(body.space)
    before.x.array[:] = body.u.x.array
    ((_, share),) = body.wall.kinds()
    force = compat.form(added_stress(body, share, before))
    stored = compat.form(added_energy(body, share, before))
    operators = Operators(body, INFLATION)
    K = csr(operators.compounds()[0].stiffness)
    free = operators.unknowns.free
    rng = np.random.default_rng(2)
    step = np.zeros(len(body.u.x.array))
    step[free] = 1e-7 * rng.standard_normal(len(free))

    def at(share_of_step):
        body.u.x.array[:] = before.x.array + share_of_step * step
        return fem.petsc.assemble_vector(force).array[free].copy()

    difference = (at(1.0) - at(-1.0)) / 2
    assert np.linalg.norm(K @ step[free] - difference) < 1e-6 * np.linalg.norm(difference)
    body.u.x.array[:] = before.x.array + 1e3 * step
    work = (at(1e3 + 1e-2) @ step[free] + at(1e3 - 1e-2) @ step[free]) / 2
    body.u.x.array[:] = before.x.array + (1e3 + 1e-2) * step
    more = fem.assemble_scalar(stored)
    body.u.x.array[:] = before.x.array + (1e3 - 1e-2) * step
    less = fem.assemble_scalar(stored)
    assert (more - less) / 2e-2 == pytest.approx(work, rel=1e-5)


def test_damping_beyond_the_modes():
    """Loss factors: the mean of the upper quarter at the highest frequency. In proportion: itself."""
    body = tire({"loss_factor": 0.2}, {"loss_factor": 0.1})
    operators = Operators(body, INFLATION)
    modes = undamped.solve(operators.stiffness, operators.mass, 16)
    projection = project(
        modes, None, operators.carried, MPI.COMM_SELF, compounds=operators.compounds()
    )
    tail = beyond(StrainEnergy(), projection)
    expected = projection.loss_factor[-4:].mean() * np.sqrt(projection.squares[-1])
    assert tail == pytest.approx((expected, 0.0))
    assert beyond((3.0, 1e-4), projection) == Proportional(3.0, 1e-4)
    np.testing.assert_allclose(
        rates((3.0, 1e-4), projection), 3.0 + 1e-4 * projection.squares, rtol=1e-15
    )


@pytest.mark.slow
@pytest.mark.mpi
def test_any_number_of_processes_has_the_same_loss_factors():
    """Modes and losses of a tire shared by all processes, against this process alone."""
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        body = tire({"loss_factor": 0.3, "dynamic": 1.2}, {"loss_factor": 0.1}, comm=comm)
        operators = Operators(body, INFLATION)
        modes = undamped.solve(operators.stiffness, operators.mass, 8)
        given = operators.compounds()
        found.append(project(modes, None, operators.carried, comm, compounds=given))
    alone, shared = found
    np.testing.assert_allclose(shared.squares, alone.squares, rtol=1e-8)
    # Of a pair the sum: which two of its vectors are found is open.
    np.testing.assert_allclose(shared.loss_factor.sum(), alone.loss_factor.sum(), rtol=1e-6)
