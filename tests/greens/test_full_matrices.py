"""Residual options on a small finite-element tire, against its full matrices."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import InputError
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import on_own_rows, receptance, statics
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.greens.coupling import Basis, Wheel
from tireroad.greens.responses import Cutoff, estimate, estimate_axle, relative
from tireroad.modal.basis import extended, project
from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import gram, multiply
from tireroad.modal.solver.slicing import Modes
from tireroad.tests.validation.cases import thesis_torus

MATERIAL = {
    "model": "neo-hookean",
    "youngs_modulus": 4.8e7,
    "poisson_ratio": 0.45,
    "density": 1200.0,
}
COUNT = 64
DAMPING = (500.0, 0.0)
SPOTS = [(0.0, 0.0), (0.15, 0.1), (-0.2, -0.3), (1.0, 0.5)]


@lru_cache(maxsize=1)
def tire():
    """An inflated soft torus of 2,112 free unknowns, its lowest modes, loads and readings."""
    comm = MPI.COMM_WORLD
    section = thesis_torus(segments=16, elements_arc=6)
    body = Body(comm, section, compound(**MATERIAL))
    LoadStepper(Equilibrium(body), lambda progress: None).inflate(2e5)
    operators = Operators(body, 2e5)
    modes = undamped.solve(operators.stiffness, operators.mass, COUNT)
    weights = [probe.spot(body.lattice, *spot) for spot in SPOTS]
    loads = sparse.csr_matrix(np.stack([probe.directed(w, (0, 0, 1.0)) for w in weights]))
    readings = [probe.directed(w, axis) for w in weights[:2] for axis in np.eye(3)]
    return operators, operators.rotation(), modes, sparse.csr_matrix(np.stack(readings)), loads


def wheel(speed: float, damping=DAMPING, inertia: str = "full") -> tuple[Wheel, Basis]:
    operators, rotation, modes, _, _ = tire()
    made = Wheel(
        operators=operators,
        rotation=rotation if speed else None,
        speed=speed,
        damping=damping,
        inertia=inertia,
    )
    comm = operators.body.comm
    projection = project(modes, made.rotation, operators.carried, comm)
    shape = operators.trace(modes.vectors)
    return made, Basis(shape=shape, projection=projection, states=made.decouple(projection, comm))


def response(made: Wheel, basis: Basis, option: str):
    _, _, modes, readings, loads = tire()
    if option == "none":
        return basis.couple(readings, loads)
    return made.respond(basis, modes, readings, loads, option)


def off(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    return np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))


OPTIONS = ("dirac", "static", "attachment")


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize(
    ("speed", "damping", "inertia"),
    [
        (0.0, DAMPING, "full"),
        (60.0, DAMPING, "full"),
        (60.0, DAMPING, "doppler"),
        (60.0, (100.0, 1e-5), "full"),
        (60.0, (0.0, 0.0), "full"),
    ],
)
def test_static_limit_is_exact(speed, damping, inertia) -> None:
    """H(0) is the full matrices' own, to 1e-9, with every residual option."""
    made, basis = wheel(speed, damping, inertia)
    _, _, _, readings, loads = tire()
    exact = made.receptance(readings, loads, np.zeros(1))
    for option in OPTIONS:
        found = response(made, basis, option)
        assert off(found.receptance(np.zeros(1)), exact)[0] < 1e-9, option
        assert found.eigenvalue.real.max() <= 1e-9 * np.abs(found.eigenvalue).max(), option


@pytest.mark.long
def test_error_up_to_half_the_highest_mode() -> None:
    """Standing and rolling: what each option leaves of the full matrices' receptance."""
    operators, _, modes, readings, loads = tire()
    frequency = np.linspace(0, modes.frequency[-1] / 2, 4)
    most = {
        0.0: {"static": 0.12, "attachment": 0.01},
        60.0: {"static": 0.12, "attachment": 0.015},
    }
    for speed, allowed in most.items():
        made, basis = wheel(speed)
        exact = made.receptance(readings, loads, frequency)
        error = {
            o: off(response(made, basis, o).receptance(frequency), exact).max() for o in allowed
        }
        none = off(response(made, basis, "none").receptance(frequency), exact).max()
        assert all(error[o] < allowed[o] for o in allowed), error
        assert none > 0.3 and error["attachment"] < error["static"] / 5


@pytest.mark.long
def test_estimates_are_of_the_size_of_the_errors() -> None:
    """Within twelve times of the truth and not below a quarter of it."""
    _, _, modes, readings, loads = tire()
    made, basis = wheel(30.0)
    frequency = np.linspace(0, modes.frequency[-1] / 2, 4)
    exact = made.receptance(readings, loads, frequency)
    cutoff = Cutoff(2 * np.pi * modes.frequency[-1], DAMPING[0])
    for option in ("none", *OPTIONS):
        found = response(made, basis, option)
        true = off(found.receptance(frequency), exact).max()
        estimated = estimate(found, option, cutoff, frequency).max()
        assert true / 4 < estimated < 12 * true, option


def test_attachments_keep_the_modes_and_the_orthonormality() -> None:
    operators, _, modes, _, loads = tire()
    made, _ = wheel(60.0)
    shapes = statics(operators, made.rotating_stiffness, on_own_rows(operators, loads))
    comm = operators.body.comm
    idle = np.zeros((len(shapes), 1))  # a load on the rim
    columns = np.hstack([idle, shapes])
    grown = extended(modes, columns, operators)
    assert len(grown.squares) == COUNT + len(SPOTS)
    assert grown.squares[COUNT:].min() > modes.squares[-1]
    weighted = operators.mass[:, None] * grown.vectors
    unit = gram(comm, grown.vectors, weighted)
    assert np.abs(unit - np.eye(len(unit))).max() < 1e-10
    product = multiply(operators.stiffness, grown.vectors)
    energy = gram(comm, grown.vectors, product)
    size = np.sqrt(np.outer(grown.squares, grown.squares))
    assert np.abs((energy - np.diag(grown.squares)) / size).max() < 1e-7


def test_a_basis_that_grows_keeps_its_projection() -> None:
    operators, rotation, modes, _, _ = tire()
    comm = operators.body.comm
    first = {**vars(modes), "squares": modes.squares[:7], "vectors": modes.vectors[:, :7]}
    known = project(Modes(**first), rotation, operators.carried, comm)
    whole = project(modes, rotation, operators.carried, comm)
    grown = project(modes, rotation, operators.carried, comm, known)
    matrices = {name: value for name, value in vars(whole).items() if isinstance(value, np.ndarray)}
    assert len(matrices) == 6
    for name, value in matrices.items():
        assert np.abs(getattr(grown, name) - value).max() <= 1e-12 * np.abs(value).max(), name


def test_direct_receptance_is_reciprocal_and_damped() -> None:
    """H_ij(Omega) = H_ji of the same wheel only when it stands; power goes in, never out."""
    made, _ = wheel(0.0)
    loads = tire()[4]
    H = made.receptance(loads, loads, np.array([30.0, 90.0]))
    assert np.abs(H - H.transpose(0, 2, 1)).max() < 1e-10 * np.abs(H).max()
    assert (np.linalg.eigvalsh(-(H - H.conj().transpose(0, 2, 1)) / 2j) > 0).all()


def test_vectors_of_another_solution_are_refused() -> None:
    """With the projection of one solution and the vectors of another, signs would not fit."""
    made, basis = wheel(50.0)
    _, _, modes, _, loads = tire()
    signs = np.where(np.arange(len(modes.squares)) % 3, 1.0, -1.0)
    other = replace(modes, vectors=signs * modes.vectors)
    with pytest.raises(InputError, match="not those that the basis shows"):
        made.respond(basis, other, loads, loads, "attachment")


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 50.0])
@pytest.mark.parametrize("option", ["static", "attachment"])
def test_the_error_of_the_axle_force_is_about_what_is_estimated(speed, option) -> None:
    """Loads less the rate of momentum, against the first moment of the full matrices; up to half the
    highest mode. The static residual leaves out momentum, the others little of it."""
    made, basis = wheel(speed)
    operators, _, modes, _, loads = tire()
    found = made.respond(basis, modes, loads, loads, option)
    frequency = np.array([0.25, 0.5]) * modes.frequency[-1]
    full = made.rotating_stiffness, made.rotating_damping
    exact = receptance(operators, *full, loads, loads, frequency, beside=operators.carried)[:, -3:]
    moving = replace(
        found, output=found.momentum, block_output=found.block_momentum, residual=0 * exact[0].real
    )
    lacking = (2 * np.pi * frequency[:, None, None]) ** 2 * (moving.receptance(frequency) - exact)
    error = np.linalg.norm(lacking, axis=(1, 2)) / np.sqrt(loads.shape[0])
    cutoff = Cutoff(2 * np.pi * modes.frequency[-1], DAMPING[0])
    guess = estimate_axle(found, cutoff, frequency)
    if option == "static":
        assert error[0] > 5e-3
        assert np.all((guess > error / 2) & (guess < 3 * error))
    else:
        assert error[0] < 0.02
        assert np.all(guess < 0.02)


def test_points_that_the_road_holds_have_no_error() -> None:
    """Their receptance and its error are zero; an error of a receptance of zero is infinite."""
    found = relative(np.array([0.0, 1.0, 1.0]), np.array([0.0, 0.0, 2.0]))
    assert found.tolist() == [0.0, np.inf, 0.5]
