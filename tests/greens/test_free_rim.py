"""A tire whose rim nothing holds: residual options, axle force, and the full matrices."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import multiply, on_own_rows, relieved, rigid_space
from tireroad.fem.matrices.operators import Operators, RimMotion, Support, rim_motion
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.greens.coupling import Basis, Wheel
from tireroad.greens.outputs import by_free_rim
from tireroad.greens.response import couple
from tireroad.modal.basis import project, with_corner
from tireroad.modal.corner import SEEN
from tireroad.modal.solver import undamped
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

COMM = MPI.COMM_WORLD
RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=4.8e7, poisson_ratio=0.45)
SPOTS = [(0.0, 0.0), (0.15, 0.1), (-0.2, -0.3), (1.0, 0.5)]
DAMPING = (60.0, 1e-6)


@lru_cache(maxsize=2)
def body(speed: float) -> Body:
    """An inflated soft torus, turning or not."""
    section = thesis_torus(segments=8, elements_arc=2)
    made = Body(COMM, section, RUBBER)
    LoadStepper(Equilibrium(made, Rolling(speed=speed)), lambda progress: None).inflate(2e5)
    return made


@lru_cache(maxsize=4)
def wheel(speed: float, rim: str, count: int):
    """The full matrices, the modes, and what they make."""
    operators = Operators(body(speed), 2e5, Support(rim), Rolling(speed=speed))
    rotation = operators.rotation() if speed else None
    modes = undamped.solve(operators.stiffness, operators.mass, count, sites=sites(operators))
    made = Wheel(
        operators=operators, rotation=rotation, speed=speed, damping=DAMPING, inertia="full"
    )
    projection = project(modes, rotation, operators.carried, COMM)
    states = made.decouple(projection, COMM)
    return (
        made,
        modes,
        Basis(shape=operators.trace(modes.vectors), projection=projection, states=states),
    )


def loads() -> sparse.csr_matrix:
    weights = [probe.spot(body(0.0).lattice, *spot) for spot in SPOTS]
    directions = [(0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0.3), (1.0, 0.2, 0)]
    pairs = zip(weights, directions, strict=True)
    return sparse.csr_matrix(np.stack([probe.directed(w, d) for w, d in pairs]))


def off(found: np.ndarray, exact: np.ndarray) -> float:
    error = np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
    return float(error.max())


def motion(speed: float) -> RimMotion:
    """Of the rim of the same tire."""
    return rim_motion(body(speed), 2e5, Rolling(speed=speed), speed != 0)


def moments(speed: float, count: int, frequency: np.ndarray) -> np.ndarray:
    """On the axle of the tire with a clamped rim (f, 3, k), m, by `count` modes: as a run reads them."""
    _, modes, plain = wheel(speed, "fixed", count)
    tire = body(speed)
    places = tire.surface(tire.lattice.points(tire.ids) + tire.owned(tire.u.x.array))
    projection = with_corner(plain.projection, modes, None, motion(speed), places, COMM)
    basis = replace(plain, projection=projection, speed=speed)
    width = loads().shape[1]
    reading = sparse.hstack([sparse.csr_matrix((3, width + SEEN)), sparse.identity(3)])
    return basis.couple(reading.tocsr(), loads()).receptance(frequency)


@pytest.mark.slow
@pytest.mark.mpi
def test_every_residual_on_the_free_rim() -> None:
    """Against the full matrices, near 0 Hz where all but the drift is the static answer, and above."""
    made, modes, basis = wheel(0.0, "free", 60)
    assert modes.rigid == rigid_space(made.operators).shape[1] == 6
    points = loads()
    slow, fast = np.array([0.5, 3.0]), np.array([20.0, modes.frequency[-1] / 2])
    drift = basis.couple(points, points)  # what the modes alone give, rigid ones included
    for option, allowed in {
        "dirac": 0.1,
        "static": 0.1,
        "attachment": 0.01,
    }.items():
        found = made.respond(basis, modes, points, points, option)
        assert found.rigid == 12
        exact = made.receptance(points, points, slow)
        bare = drift.receptance(slow)
        # The drift is 1/w^2 of the rest: the residual is compared to what the modes lack.
        assert off(found.receptance(slow) - bare, exact - bare) < 2e-3, option
        assert off(found.receptance(fast), made.receptance(points, points, fast)) < allowed, option


def test_static_answer_is_the_pseudo_inverse() -> None:
    """G = P K^+ P^T by inertia relief, against all flexible modes of the tire."""
    made, modes, basis = wheel(0.0, "free", 10**6)
    assert len(modes.squares) == len(made.operators.mass)
    found = made.respond(basis, modes, loads(), loads(), "static")
    shape = basis.seen(loads())[:, modes.rigid :]
    exact = shape / modes.squares[modes.rigid :] @ shape.T
    assert np.abs(found.residual + found.static() - exact).max() < 1e-9 * np.abs(exact).max()
    assert np.abs(found.residual).max() < 1e-9 * np.abs(exact).max()


@pytest.mark.mpi
def test_a_force_of_the_round_shape_is_no_stiffness() -> None:
    """The doppler inertia's Omega^2 S_B u of a ring of few elements: K R is 1e-9 of K, R^T K R rounding.

    Three rotations were taken for soft ones, and the singular K was factorised.
    """
    rolling = Rolling(speed=80.0, damping=60.0, inertia="doppler")
    made = Body(COMM, thesis_torus(segments=8, elements_arc=2), RUBBER)
    LoadStepper(Equilibrium(made, rolling), lambda progress: None).inflate(2e5)
    operators = Operators(made, 2e5, Support("free"), rolling)
    rigid, mass = rigid_space(operators), operators.mass[:, None]
    assert rigid.shape[1] == 6
    force = multiply(operators.stiffness, rigid) / np.sqrt(mass)
    force = np.sqrt(summed(COMM, np.einsum("ij,ij->j", force, force)))
    assert np.count_nonzero(force > 0.1) == 3  # 1/s2: 6 and 11, against 8e-4 from rounding
    columns = on_own_rows(operators, loads())
    found = relieved(operators, columns)
    assert np.abs(summed(COMM, (mass * rigid).T @ found)).max() < 1e-12
    left = columns.toarray() - multiply(operators.stiffness, found)
    left -= mass * (rigid @ summed(COMM, rigid.T @ left))
    assert np.sqrt(summed(COMM, (left**2).sum(keepdims=True))) < 1e-8


@pytest.mark.mpi
def test_centrifugal_forces_hold_rotations() -> None:
    """They do not turn with the tire: a rotation has a stiffness of Omega^2 M, a translation has none."""
    operators = Operators(body(60.0), 2e5, Support("free"), Rolling(speed=60.0))
    assert rigid_space(operators).shape[1] == 3


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_axle_force_of_the_free_rim_is_that_from_momentum(speed) -> None:
    """-H_rr^-1 H_rc of the free rim, against sum of loads - d/dt momentum of the clamped one, all modes."""
    made, modes, _ = wheel(speed, "free", 10**6)
    frequency = np.array([5.0, 40.0, 90.0, 160.0])
    found = by_free_rim(made, modes, loads(), frequency, motion(speed))
    _, _, clamped = wheel(speed, "fixed", 10**6)
    momenta = clamped.projection.momentum
    seen = clamped.seen(loads())
    first = couple(clamped.states, momenta, seen, momenta).receptance(frequency)
    dense = loads().toarray()
    total = dense.reshape(len(dense), -1, 3).sum(axis=1).T
    exact = total + (2 * np.pi * frequency[:, None, None]) ** 2 * first
    # Rolling, int rho e_y x u is by full integration here and by the diagonal mass there.
    assert off(found[:, :3], exact) < (1e-3 if speed else 1e-6)
    assert off(found[:, 3:], moments(speed, 10**6, frequency)) < (1e-3 if speed else 1e-5)


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_axle_force_from_few_modes(speed) -> None:
    """Sixty modes and attachments of rim and loads, against all modes."""
    whole, every, _ = wheel(speed, "free", 10**6)
    made, modes, _ = wheel(speed, "free", 60)
    frequency = np.array([5.0, 40.0, 90.0, 160.0])
    exact = by_free_rim(whole, every, loads(), frequency, motion(speed))
    found = by_free_rim(made, modes, loads(), frequency, motion(speed))
    assert off(found[:, :3], exact[:, :3]) < 0.01
    assert off(found[:, 3:], exact[:, 3:]) < 0.01
