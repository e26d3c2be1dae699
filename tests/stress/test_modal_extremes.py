"""All modes of a small tire, rolled at speeds from rest to far past critical, with damping from 0 to 1e5 1/s."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.linalg import eigh

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.modal.basis import project
from tireroad.modal.campbell import critical_speed, growth, onset
from tireroad.modal.rotating import checks, matrices, rotating
from tireroad.modal.solver import undamped
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

COMM = MPI.COMM_WORLD
SOFT = {"model": "neo-hookean", "youngs_modulus": 48e6, "poisson_ratio": 0.45, "density": 1200.0}


@pytest.fixture(scope="module")
def operators() -> Operators:
    section = thesis_torus(segments=8, elements_arc=2)
    body = Body(COMM, section, compound(**SOFT))
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(2e5)
    loader.deflect(0.003)
    return Operators(body, 2e5)


@pytest.fixture(scope="module")
def modes(operators) -> Modes:
    return undamped.solve(operators.stiffness, operators.mass, 10**6, sites=sites(operators))


def test_all_modes_are_the_dense_ones(operators, modes):
    rows = operators.stiffness.getValuesCSR()
    size = operators.stiffness.getSize()[0]
    dense = np.zeros((size, size))
    for k, (low, high) in enumerate(zip(rows[0], rows[0][1:], strict=False)):
        dense[k, rows[1][low:high]] = rows[2][low:high]
    root = np.sqrt(operators.mass)
    exact = np.linalg.eigvalsh(dense / np.outer(root, root))
    assert len(modes.squares) == modes.inertia_count == size
    np.testing.assert_allclose(modes.squares, exact, rtol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("gamma", [0.0, 500.0, 5000.0, 1e5])
@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_every_speed_and_damping_keeps_its_identities(operators, modes, inertia, gamma):
    """Below, near and past the critical speed; overdamped pairs; `checks` raises what fails."""
    projection = project(modes, operators.rotation(), operators.carried, COMM)
    critical = critical_speed(projection, inertia)
    for speed in (0.0, 0.3 * critical, 0.999 * critical, 1.3 * critical):
        drag, stiffness = matrices(projection, speed, (gamma, 0.0), inertia)
        checks(rotating(drag, stiffness), drag, stiffness)


@pytest.mark.long
def test_growth_begins_where_onset_says(operators, modes):
    """Far past critical the pressed tire is unstable; onset brackets the first speed."""
    projection = project(modes, operators.rotation(), operators.carried, COMM)
    high = 2 * critical_speed(projection, "full")
    assert growth(projection, high, (50.0, 0.0), "full") > 0
    first = onset(projection, (50.0, 0.0), "full", high)
    assert growth(projection, first, (50.0, 0.0), "full") > 0
    assert growth(projection, 0.99 * first, (50.0, 0.0), "full") == 0


@pytest.mark.long
def test_bulk_a_thousand_times_the_shear_modulus():
    """Rounding leaves more than 1e-8 of the lowest eigenvalue: as good as LAPACK's, and not refused."""
    section = thesis_torus(segments=12, elements_arc=4, order=3)
    rubber = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.4995)
    operators = Operators(Body(MPI.COMM_SELF, section, rubber), 0.0)
    modes = undamped.solve(operators.stiffness, operators.mass, 10)
    root = 1 / np.sqrt(operators.mass)
    rows = operators.stiffness.getValuesCSR()[::-1]
    dense = sparse.csr_matrix(rows, shape=operators.stiffness.getSize()).toarray()
    exact = eigh(root[:, None] * dense * root, eigvals_only=True, subset_by_index=[0, 9])
    assert modes.residual.max() > 3e-9
    np.testing.assert_allclose(modes.squares, exact, rtol=1e-7)
