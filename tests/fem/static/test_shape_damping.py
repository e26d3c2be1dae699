"""Damping by the stiffness in the steady shape: what the tangent holds of it, and what is found."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import eigs

from tireroad.fem.static import equilibrium as equilibrium_module
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import place
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.virtual_work import Rolling

SPEED = 60.0


def problem(make_body, damping: float, road=FLAT, comm=MPI.COMM_SELF) -> Equilibrium:
    rolling = Rolling(speed=SPEED, damping=100.0, stiffness_damping=damping)
    return Equilibrium(make_body(segments=12, arc=4, comm=comm), rolling, road)


def entries(equilibrium: Equilibrium) -> int:
    equilibrium._assemble_tangent()
    return int(equilibrium.matrix.getInfo()["nz_used"])


def test_little_damping_adds_no_entries_to_the_tangent(make_body) -> None:
    """They were three times as many with any gamma2, and the factor took several times as long."""
    none, little, much = (entries(problem(make_body, gamma)) for gamma in (0.0, 1e-5, 1e-2))
    assert little == none
    assert much > 2 * none


def test_a_step_leaves_the_spectral_radius_of_the_rate(make_body, csr) -> None:
    """gamma2 Omega M^-1 B of an error, with the margin."""
    weak = problem(make_body, 1e-4)
    rates = sparse.csr_matrix(csr(weak._damping._rate_matrix))
    largest = np.abs(eigs(rates, k=2, which="LM", return_eigenvectors=False)).max()
    assert weak.convergence_rate == pytest.approx(1.3 * SPEED * 1e-4 * largest, rel=0.03)
    assert problem(make_body, 1e-2).convergence_rate == 0.0  # the tangent has all
    assert problem(make_body, 0.0).convergence_rate == 0.0


TILTED = RoadShape(camber=np.radians(2.0))


@pytest.mark.parametrize(
    "road",
    [FLAT, pytest.param(TILTED, marks=[pytest.mark.long, pytest.mark.mpi])],
    ids=["flat", "camber"],
)
def test_the_state_is_that_of_the_complete_tangent(make_body, monkeypatch, road) -> None:
    """Close to the most damping that the tangent does without: nearly half of an error remains."""
    found = []
    for weak in (equilibrium_module._WEAK, 0.0):
        monkeypatch.setattr(equilibrium_module, "_WEAK", weak)
        equilibrium = problem(make_body, 1.2e-3, road, MPI.COMM_WORLD)
        assert (equilibrium.convergence_rate > 0.5) == (weak > 0)
        loader = LoadStepper(equilibrium, lambda progress: None)
        loader.inflate(2e5)
        place(loader, 800.0, None, None)
        body = equilibrium.body
        state = body.displacement(), body.everywhere(equilibrium.contact_force())
        found.append((*state, equilibrium.road_stiffness()))
    (motion, force, stiffness), (other, reference, complete) = found
    np.testing.assert_allclose(motion, other, atol=1e-9 * np.abs(other).max())
    np.testing.assert_allclose(force, reference, atol=1e-9 * reference.max())
    assert stiffness == pytest.approx(complete, rel=1e-7)


@pytest.mark.slow
def test_what_a_step_with_friction_gains_is_that_of_the_complete_tangent(
    make_body, monkeypatch
) -> None:
    """Horizontal forces after a small change of the travel per radian."""
    found = []
    for weak in (equilibrium_module._WEAK, 0.0):
        monkeypatch.setattr(equilibrium_module, "_WEAK", weak)
        loader = LoadStepper(problem(make_body, 1.2e-3), lambda progress: None)
        loader.inflate(2e5)
        friction = Friction(coefficient=0.5, radius=0.31, slip=(0.01, 0.005))
        rubbing = place(loader, 800.0, None, None, friction).equilibrium
        before = rubbing.road.pull.sum(axis=0)
        rubbing.road.sliding.radius *= 1 + 1e-4
        found.append((before, rubbing.nudged(800.0) - before))
    (pull, gained), (whole, complete) = found
    np.testing.assert_allclose(pull, whole, rtol=1e-7)
    np.testing.assert_allclose(gained, complete, rtol=1e-3)


@pytest.mark.parametrize("damping", [0.0, 1e-2])
def test_road_coordinates_add_no_entries_to_the_tangent(make_body, csr, damping) -> None:
    """In place K becomes B^T K B; PETSc's triple product took longer than the factorisation."""
    equilibrium = problem(make_body, damping, RoadShape(camber=np.radians(3.0), drum_radius=0.8))
    count = entries(equilibrium)
    before = csr(equilibrium.matrix).copy()
    unrolled = equilibrium._unrolled
    basis = sparse.identity(before.shape[0], format="lil")
    for nodes, block in zip(unrolled._blocks, unrolled._basis(), strict=True):
        basis[np.ix_(nodes, nodes)] = block
    unrolled.tangent(equilibrium.matrix)
    wanted = basis.T @ before @ basis
    assert np.abs(csr(equilibrium.matrix) - wanted).max() < 1e-12 * np.abs(before).max()
    assert equilibrium.matrix.getInfo()["nz_used"] == count
