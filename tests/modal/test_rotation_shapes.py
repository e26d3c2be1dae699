"""Rotation shapes: found all, of a small belted tire against its full matrices, and where there are none."""

from functools import lru_cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse
from steel_cords import cords

from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import solve_all
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import compounds
from tireroad.fem.wheel import Turning
from tireroad.greens.basis import Basis
from tireroad.greens.coupling import wheel_of
from tireroad.modal.basis import project
from tireroad.modal.rolling import rolling_modes
from tireroad.modal.rotation_shapes import up_to, with_rotation_shapes
from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import gram, multiply
from tireroad.modal.standing import fewer, projected, solved, standing_modes
from tireroad.tests.validation.cases import thesis_torus

SOFT = compound("neo-hookean", 1200.0, youngs_modulus=6e6, poisson_ratio=0.45)
PLY = {"youngs_modulus": 9.87e9, "area": 4.21e-7, "spacing": 1e-3}
STEEL = {"density": 7850.0, "compression": 0.1}
COUNT, ROLLING = 60, Turning(speed=64.0, damping=(100.0, 0.0))


def pressed(comm: MPI.Comm) -> SmallMotions:
    """A soft torus with a radial ply and two steel belts, inflated and pressed on the road: no symmetry helps."""
    edge, half = np.radians(40), np.radians(120)
    places = [
        PlyLine("ply", (-half, half), 0.0),
        PlyLine("one", (-edge, edge), 0.5),
        PlyLine("two", (-edge, edge), 1.0),
    ]
    lines = [cords(90, "ply", **PLY), cords(20, "one", **STEEL), cords(-20, "two", **STEEL)]
    ring = thesis_torus(segments=20, elements_arc=8, elements_thickness=2, order=2).ring([], places)
    tire = TireModel(ring, lambda: Body(comm, ring, compounds(SOFT, ()), cords=lines))
    loader = LoadStepper(Equilibrium(tire.body), lambda progress: None)
    loader.inflate(2e5)
    loader.deflect(0.01)
    return SmallMotions(tire, static_state(loader.equilibrium, loader.touch))


@lru_cache(maxsize=1)
def motions() -> SmallMotions:
    """On this process alone."""
    return pressed(MPI.COMM_SELF)


def loads_of(made: SmallMotions) -> sparse.csr_matrix:
    """Vertical ones on six points of the footprint."""
    spots = [probe.spot(made.lattice, a, b) for a in (-0.1, 0.0, 0.15) for b in (-0.2, 0.1)]
    return sparse.csr_matrix(np.stack([probe.directed(one, (0, 0, 1.0)) for one in spots]))


def receptances(made: SmallMotions, turning: Turning | None, option: str):
    """Of points of the footprint up to half the highest mode: by modes and shapes, and by the full matrices."""
    loads = loads_of(made)
    basis = standing_modes(made, count=COUNT, turning=turning)
    wheel = wheel_of(made, ROLLING)
    states = Basis.of(rolling_modes(basis, ROLLING, made.body.comm))
    frequency = np.linspace(0.1, 0.5, 9) * basis.frequency[-1]
    found = wheel.respond(states, basis.modes, loads, loads, option)
    return found.receptance(frequency), wheel.receptance(loads, loads, frequency)


def off(found, exact) -> float:
    return float(
        (np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))).max()
    )


@pytest.mark.slow
@pytest.mark.parametrize("option", ["static", "attachment"])
def test_what_belts_couple_as_they_roll_is_in_the_states(option) -> None:
    """Against the full matrices of the same mesh; attachment modes, too, need them."""
    without, there = (off(*receptances(motions(), given, option)) for given in (None, ROLLING))
    assert there < 0.06
    assert there < without / 4


@pytest.mark.slow
def test_attachment_modes_that_join_them_hold_the_static_answer() -> None:
    """Of six loads the exact answers are in the basis: nothing is left. K knows rotation shapes and attachment modes from each
    other, M does not: taken for orthogonal in both, they left answers of either sign, and contact that pulls."""
    made = motions()
    loads = loads_of(made)
    basis = standing_modes(made, count=COUNT, turning=ROLLING)
    states = Basis.of(rolling_modes(basis, ROLLING, made.body.comm))
    found = wheel_of(made, ROLLING).respond(states, basis.modes, loads, loads, "attachment")
    assert basis.projection.shapes > 10
    assert np.abs(found.residual).max() < 1e-6 * np.abs(found.static()).max()


@pytest.mark.slow
def test_all_that_count_are_found() -> None:
    """Beside the singular values of all columns X, solved for one by one."""
    made = motions()
    operators, rotation = made.operators, made.rotation
    modes = solved(operators, count=COUNT)
    grown = projected(made, modes, True, turning=ROLLING).modes
    speed, middle = up_to(ROLLING.speed), np.sqrt(modes.squares[-1]) / 2
    forces = [
        2 * speed * multiply(rotation.gyroscopic, modes.vectors),
        speed**2 / middle * multiply(rotation.convective, modes.vectors),
    ]
    X = solve_all(operators.stiffness, sparse.csr_matrix(np.hstack(forces)))
    comm, mass = operators.body.comm, operators.mass[:, None]
    X -= modes.vectors @ gram(comm, modes.vectors, mass * X)
    sizes = np.linalg.eigvalsh(gram(comm, X, multiply(operators.stiffness, X)))
    wanted = int((sizes > ROLLING.shape_tolerance).sum())
    assert 10 < wanted < COUNT
    assert len(grown.squares) - COUNT == wanted
    assert grown.count == COUNT and grown.squares[COUNT] > modes.squares[-1]
    unit = gram(comm, grown.vectors, mass * grown.vectors)
    assert np.abs(unit - np.eye(len(unit))).max() < 1e-9
    # In no direction of X do they leave more than what does not count, and so they are those of the
    # mirror image, mirrored.
    space = grown.vectors[:, COUNT:]
    shares = gram(comm, space, multiply(operators.stiffness, X)) / grown.squares[COUNT:, None]
    X -= space @ shares
    left = np.linalg.eigvalsh(gram(comm, X, multiply(operators.stiffness, X)))
    assert left.max() == pytest.approx(sizes[-wanted - 1], rel=1e-3)


def test_speeds_of_a_family_share_them() -> None:
    assert {up_to(speed) for speed in (40.0, 59.0, 64.0)} == {64.0}
    assert up_to(0.0) == 0.0


@pytest.mark.slow
def test_a_wheel_that_stands_has_none() -> None:
    made = motions()
    basis = standing_modes(made, count=8, turning=Turning())
    assert basis.projection.shapes == 0 and basis.modes.vectors.shape[1] == 8


def test_a_basis_of_one_mode_and_one_of_all() -> None:
    """The smallest that there is; and all that there are, which lack nothing."""
    ring = thesis_torus(segments=8, elements_arc=4, elements_thickness=1, order=1).ring()
    body = Body(MPI.COMM_SELF, ring, SOFT)
    operators = Operators(body, 0.0)
    rotation, free = operators.rotation(), len(operators.mass)
    for count in (1, free):
        modes = undamped.solve(operators.stiffness, operators.mass, count)
        projection = project(modes, rotation, operators.carried, body.comm)
        grown = with_rotation_shapes(modes, projection, operators, rotation, ROLLING)
        assert grown.vectors.shape[1] <= (3 if count == 1 else free)


@pytest.mark.slow
def test_the_first_modes_have_their_own() -> None:
    made = motions()
    basis = standing_modes(made, count=COUNT, turning=ROLLING)
    few = fewer(basis, made, COUNT // 2, ROLLING, None)
    assert len(few.frequency) == COUNT // 2 == few.projection.modes
    assert 0 < few.projection.shapes < basis.projection.shapes
    bare = basis.first(COUNT // 2)
    assert bare.projection.shapes == 0 and bare.shape.shape[1] == COUNT // 2


@pytest.mark.mpi
@pytest.mark.long
def test_the_same_on_any_number_of_processes() -> None:
    alone, shared = (
        rolling_modes(standing_modes(made, count=COUNT, turning=ROLLING), ROLLING, made.body.comm)
        for made in (motions(), pressed(MPI.COMM_WORLD))
    )
    assert alone.basis.projection.shapes == shared.basis.projection.shapes
    band = np.abs(alone.states.eigenvalue) < alone.highest / 2
    both = [rolling.states.eigenvalue[: band.sum()] for rolling in (alone, shared)]
    assert np.allclose(*both, rtol=1e-6)
