"""Modes of small finite-element tires: mirrors found, doppler shifts, the full quadratic problem, buckling."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import rotating_stiffness
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.modal.basis import project
from tireroad.modal.rolling import truncation
from tireroad.modal.rotating import checks, matrices, rotating
from tireroad.modal.solver import quadratic, undamped
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

COMM = MPI.COMM_WORLD
INFLATION = 2e5
SOFT = {"model": "neo-hookean", "youngs_modulus": 48e6, "poisson_ratio": 0.45, "density": 1200.0}


SMALL = thesis_torus(segments=16, elements_arc=4)


def tire(deflection: float) -> Operators:
    body = Body(COMM, SMALL, compound(**SOFT))
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(INFLATION)
    if deflection:
        loader.deflect(deflection)
    return Operators(body, INFLATION)


@pytest.fixture(scope="module")
def pressed() -> Operators:
    return tire(0.004)


@pytest.fixture(scope="module")
def round_tire() -> Operators:
    return tire(0.0)


@pytest.mark.mpi
def test_mirrors_of_a_pressed_tire(pressed):
    """At rest without friction both planes are there; splitting changes no eigenvalue."""
    split = undamped.solve(pressed.stiffness, pressed.mass, 40, sites=sites(pressed))
    whole = undamped.solve(pressed.stiffness, pressed.mass, 40)
    assert len(split.sectors) == 4
    assert len(whole.sectors) == 1
    np.testing.assert_allclose(split.squares, whole.squares, rtol=1e-9)
    assert split.residual.max() < 1e-8
    assert split.orthonormality < 1e-10


@pytest.mark.mpi
def test_round_tire_has_double_modes_and_doppler_shifts(round_tire):
    """Eigenvalues of an axisymmetric tire, seen from the ground: those at rest shifted by +- i n Omega."""
    operators, speed, gamma = round_tire, 30.0, 40.0
    modes = undamped.solve(operators.stiffness, operators.mass, 120, sites=sites(operators))
    projection = project(modes, operators.rotation(), operators.carried, COMM)
    drag, stiffness = matrices(projection, speed, (gamma, 0.0), "doppler")
    turning = rotating(drag, stiffness)
    checks(turning, drag, stiffness)
    root = np.sqrt(modes.squares[:12] - gamma**2 / 4)
    shift = np.abs(turning.eigenvalue.imag[:, None] - root) / speed
    # Each of the lowest lines has one of its two shifted states within the mesh's error of n Omega.
    order = np.rint(shift)
    near = np.abs(shift - order) < 0.02
    assert near.any(axis=0).all()
    np.testing.assert_allclose(turning.eigenvalue.real, -gamma / 2, atol=0.02 * gamma)


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_full_quadratic_problem_agrees_with_many_projected_modes(pressed, inertia):
    """The truncation error falls with the number of modes, and is small with 400 of them."""
    speed, damping = 40.0, (50.0, 0.0)
    rotation = pressed.rotation()
    stiffness = rotating_stiffness(pressed, rotation, speed, damping, inertia)
    drag = (rotation.gyroscopic if inertia == "full" else rotation.body).copy()
    drag.scale(2 * speed)
    diagonal = drag.getDiagonal()
    diagonal.array[:] += damping[0] * pressed.mass
    drag.setDiagonal(diagonal)
    full = quadratic.solve(pressed.mass, drag, stiffness, 8)
    modes = undamped.solve(pressed.stiffness, pressed.mass, 400, sites=sites(pressed))
    projection = project(modes, rotation, pressed.carried, COMM)
    pencil = matrices(projection, speed, damping, inertia)
    errors = [
        truncation(
            full.eigenvalue, rotating(*(matrix[:m, :m] for matrix in pencil)).eigenvalue
        ).max()
        for m in (40, 400)
    ]
    assert errors[1] < 0.2 * errors[0]
    assert errors[1] < 1e-4


def test_buckled_state_is_named(round_tire):
    """A tire under outer pressure: its stiffness turns negative, and the message says how often."""
    body = round_tire.body
    flat = Operators(body, -5e6)
    with pytest.raises(ConvergenceError, match="negative eigenvalue.*buckles"):
        undamped.solve(flat.stiffness, flat.mass, 10, sites=sites(flat))


@pytest.mark.long
def test_a_light_load_keeps_both_mirror_planes():
    """Stiff rubber, order 3: entries of the matrix are symmetric to 1e-13 of the largest, which is 1e-8 of the
    lowest eigenvalue. That is rounding, no asymmetry, and shifts no frequency by as much.
    """
    section = thesis_torus(segments=24, elements_arc=6, order=3)
    body = Body(COMM, section, compound(**SOFT | {"youngs_modulus": 4.8e8}))
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(0.0)
    loader.carry(1.0)
    operators = Operators(body, 0.0)
    split = undamped.solve(operators.stiffness, operators.mass, 12, sites=sites(operators))
    whole = undamped.solve(operators.stiffness, operators.mass, 12)
    assert len(split.symmetries) == 2
    assert split.residual.max() < 1e-7
    np.testing.assert_allclose(split.squares, whole.squares, rtol=1e-10)


@pytest.mark.mpi
def test_same_vectors_on_any_number_of_processes(pressed, round_tire):
    """Signs, order and pairs too: against this process alone with the whole tire."""
    for operators, waves in ((pressed, True), (round_tire, True), (round_tire, False)):
        modes = undamped.solve(
            operators.stiffness, operators.mass, 24, sites=sites(operators), waves=waves
        )
        mine = operators.body.everywhere(operators.spread(modes.vectors))
        np.testing.assert_allclose(mine, alone(operators, waves), atol=1e-6 * np.abs(mine).max())


def alone(operators: Operators, waves: bool) -> np.ndarray:
    """The modes (nodes, 3, 24) in the lattice's order as one process gets them, of the same state."""
    body = operators.body
    single = Body(MPI.COMM_SELF, SMALL, compound(**SOFT))
    single.set_displacement(body.displacement())
    own = Operators(single, INFLATION)
    modes = undamped.solve(own.stiffness, own.mass, 24, sites=sites(own), waves=waves)
    return single.everywhere(own.spread(modes.vectors))
