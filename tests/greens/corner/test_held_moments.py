"""Moments on an axle that is held: by each node of the rim in the full matrices, by very stiff springs."""

import numpy as np
import pytest
from dolfinx import fem
from scipy import sparse
from test_corner import COMM, DAMPING, FREQUENCY, SPOTS, body, loads, places, wheel

from tireroad.fem import compat
from tireroad.fem.matrices.operators import FIXED, Operators, rim_motion
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    convection_form,
    convective_form,
    static_residual,
    tangent,
)
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import Basis
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis, with_corner
from tireroad.modal.corner import SEEN
from tireroad.modal.rolling import RollingModes, decouple, full_states
from tireroad.modal.solver.fields import everywhere

HELD = 2  # the place of the held axle in `wheel`
EVERY = 10**6


def by_rows(basis: Basis, speed: float, frequency: np.ndarray = FREQUENCY) -> np.ndarray:
    """Moments (f, 3, 4) m on the hub, as a run reads them."""
    probes = loads(speed, SEEN + 3)
    return basis.couple(probes[-3:], probes[: len(SPOTS)]).receptance(frequency)


def off(one: np.ndarray, other: np.ndarray) -> float:
    """Largest distance over the frequencies."""
    size = np.linalg.norm(other, axis=(1, 2))
    return float((np.linalg.norm(one - other, axis=(1, 2)) / size).max())


def of_nodes(points: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Sum of x_i x f_i (3, k) over the nodes, forces (3 n, k)."""
    return np.cross(points[:, :, None], force.reshape(len(points), 3, -1), axis=1).sum(axis=0)


def by_nodes(speed: float) -> np.ndarray:
    """The same from the force on each node of the rim by the full matrices, and from each node's damping, which pushes the
    wheel as it pushes the node."""
    made = body(speed)
    held = Operators(made, 2e5, FIXED, Rolling(speed=speed))
    free, static = held.unknowns.free, fem.Constant(made.mesh, 2e5)
    rim = np.setdiff1d(np.arange(3 * made.nodes), free)
    points = made.lattice.points(made.ids)
    loaded = (points + made.owned(made.u.x.array)).ravel()[free].reshape(-1, 3)
    forms = {1: (0, tangent(made, static_residual(made, static, AT_REST)))}
    if speed:
        forms = {**forms, 2: (1, convection_form(made)), 3: (0, convective_form(made))}
    factor = {1: 1.0, 2: 2 * speed, 3: speed**2}
    tire, at_rim = ([np.zeros((n, len(free))) for _ in range(2)] for n in (len(free), len(rim)))
    for part, (order, form) in forms.items():
        matrix = fem.petsc.assemble_matrix(compat.form(form))
        matrix.assemble()
        whole = everywhere(matrix)[:, free] * factor[part]
        tire[order] += whole[free].toarray()
        at_rim[order] += whole[rim].toarray()
    drag = DAMPING[0] * np.diag(held.mass) + DAMPING[1] * everywhere(held.stiffness).toarray()
    rate = np.zeros_like(drag)
    if speed:
        rate = speed * everywhere(held.rotation().body).toarray() / held.mass[:, None]
    face = made.surface
    pushed = loads(speed, 0).toarray().T.reshape(-1, 3, len(SPOTS))
    nodal = np.zeros((made.nodes, 3, len(SPOTS)))
    nodal[face.local] = pushed[face.place]
    nodal = nodal.reshape(
        -1, len(SPOTS)
    )  # the elements beside the bead pass some of it to the wheel
    load, out = nodal[free], []
    for s in 2j * np.pi * FREQUENCY:
        damped = drag @ (s * np.eye(len(free)) + rate)
        u = np.linalg.solve(
            s**2 * np.diag(held.mass) + s * tire[1] + tire[0] + damped, load.astype(complex)
        )
        pulled = (s * at_rim[1] + at_rim[0]) @ u - nodal[rim]
        out.append(of_nodes(loaded, damped @ u) - of_nodes(points[rim[::3] // 3], pulled))
    return np.stack(out)


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_moments_are_those_of_the_forces_on_the_rims_nodes(speed) -> None:
    if COMM.size > 1:
        pytest.skip("dense matrices")
    basis = wheel(speed, EVERY, HELD)[2]
    assert not basis.projection.moves
    assert off(by_rows(basis, speed), by_nodes(speed)) < 1e-7


@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_very_stiff_springs_carry_the_moments_of_the_held_axle(speed) -> None:
    """Springs times rotations of a wheel that hardly moves: of that motion the held axle's rows know nothing."""
    full, modes, held = wheel(speed, 60, HELD)
    stiff = np.diag([1e12] * 3 + [1e11] * 3)
    axle = Axle(wheel_mass=15.0, wheel_inertia=(0.4, 0.8, 0.5), stiffness=stiff, damping=0 * stiff)
    motion = rim_motion(body(speed), 2e5, Rolling(speed=speed), speed != 0)
    plain = held.held.projection
    projection = with_corner(plain, modes, axle, motion, places(speed), COMM)
    states = decouple(projection, Turning(speed=speed, damping=DAMPING), COMM)
    corner = Basis(shape=held.shape, projection=projection, states=states, speed=speed)
    wide = loads(speed, SEEN + 3)
    turned = corner.couple(wide[4:11], wide[:4]).receptance(FREQUENCY)[:, 3:6]
    assert (
        off(by_rows(held, speed), 1e11 * turned) < 1e-4
    )  # the states of so stiff a hub are known to 1e-5


OPTIONS = ("dirac", "static", "attachment")


def seen(speed: float) -> sparse.csr_matrix:
    """The spots, and the moments after them."""
    probes = loads(speed, SEEN + 3)
    return sparse.vstack([probes[: len(SPOTS)], probes[-3:]], format="csr")


def errors(speed: float, found: Response) -> np.ndarray:
    """Of the moments per load, relative, at 0 Hz and FREQUENCY, against all modes."""
    frequency, count = np.array([0.0, *FREQUENCY]), len(SPOTS)
    exact = wheel(speed, EVERY, HELD)[2].couple(seen(speed), seen(speed)).receptance(frequency)
    exact, other = (H[:, count:, :count] for H in (exact, found.receptance(frequency)))
    return np.linalg.norm(other - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))


def turned(speed: float) -> tuple[Wheel, Basis]:
    """Forty pairs of the full matrices in the place of 60 modes."""
    full, _, basis = wheel(speed, 60, HELD)
    modal = ModalBasis(frequency=np.zeros(60), shape=basis.shape, projection=basis.projection)
    turning = Turning(speed=speed, damping=DAMPING)
    projected = RollingModes(basis=modal, states=basis.states, turning=turning)
    pencil = full.rotating_damping, full.rotating_stiffness
    return full, Basis.of(full_states(full.operators, pencil, projected, full.rim(), count=40)[0])


@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_moments_with_every_residual_are_exact_for_slow_forces(speed) -> None:
    """Sixty modes lack 0.3 % of the moments; at 5 Hz 0.03 % with a static residual, 4e-6 with one that has inertia."""
    full, modes, basis = wheel(speed, 60, HELD)
    probes = seen(speed)
    assert errors(speed, basis.couple(probes, probes)).min() > 1e-3
    for option in OPTIONS:
        error = errors(speed, full.respond(basis, modes, probes, probes, option))
        assert error[0] < 1e-9, option
        assert error[2] < (1e-3 if option in ("dirac", "static") else 1e-5), option
        assert error.max() < 5e-3, option


@pytest.mark.mpi
def test_moments_by_states_of_the_full_matrices() -> None:
    """Their fields are not complete: what jumps with a force is its own part of the moments, the rate of that is left out."""
    speed, probes = 60.0, seen(60.0)
    full, basis = turned(speed)
    assert errors(speed, basis.couple(probes, probes))[:3].max() < 0.02
    for option in ("dirac", "static"):
        error = errors(speed, full.respond(basis, None, probes, probes, option))
        assert error[0] < 1e-9, option
        assert error.max() < 5e-3 and error[2] < 5e-4, option


@pytest.mark.parametrize("scheme", ["linear", "constant"])
def test_moments_beside_a_pulse_come_at_once(scheme: str) -> None:
    """The thesis's pulse is of the displacements: moments under a jump of the forces are those with a static residual."""
    full, modes, basis = wheel(0.0, 60, HELD)
    probes, found = seen(0.0), {}
    for option in ("dirac", "static"):
        response = full.respond(basis, modes, probes, probes, option)
        tire = Recursion(response=response, step=1e-3, scheme=scheme, comm=COMM)
        tire.start(np.zeros(probes.shape[0]))
        found[option] = tire.predict() + tire.same_step[:, 0]  # the first force jumps to 1 N
    same = found["dirac"] == pytest.approx(found["static"], rel=1e-12, abs=1e-18)
    count = len(SPOTS)
    assert found["dirac"][count:] == pytest.approx(found["static"][count:], rel=1e-12)
    assert same == (scheme == "constant")
