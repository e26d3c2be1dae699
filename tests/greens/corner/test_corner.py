"""A wheel that moves: the golden car's poles, full matrices of a free rim, substructuring, and the fixed limit."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import InputError
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import on_own_rows
from tireroad.fem.matrices.operators import Operators, Support, rigid_motions, rim_motion
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import Basis
from tireroad.greens.coupling import Wheel
from tireroad.greens.outputs import disagreement
from tireroad.modal.basis import project, with_corner
from tireroad.modal.rolling import decouple
from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import everywhere
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

COMM = MPI.COMM_WORLD
RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=4.8e7, poisson_ratio=0.45)
SPOTS = [(0.0, 0.0), (0.15, 0.1), (-0.2, -0.3), (1.0, 0.5)]
DAMPING = (60.0, 1e-6)
FREQUENCY = np.array([0.7, 5.0, 40.0, 130.0])


@lru_cache(maxsize=2)
def body(speed: float) -> Body:
    """An inflated soft torus on the road, turning or not."""
    made = Body(
        COMM,
        thesis_torus(segments=8, elements_arc=2),
        RUBBER,
    )
    loader = LoadStepper(Equilibrium(made, Rolling(speed=speed)), lambda progress: None)
    loader.inflate(2e5)
    loader.deflect(0.01)
    return made


def places(speed: float) -> np.ndarray:
    """Deformed outer face (s, 3) m."""
    made = body(speed)
    return made.surface(made.lattice.points(made.ids) + made.owned(made.u.x.array))


def six_ways(body_mass: float | None = 300.0) -> Axle:
    """A wheel on springs and dampers in all directions, two of them coupled."""
    stiffness = np.diag([1e5, 2e5, 3e4, 2e3, 1e4, 3e3])
    stiffness[0, 4] = stiffness[4, 0] = 3e3
    return Axle(
        wheel_mass=15.0,
        wheel_inertia=(0.4, 0.8, 0.5),
        stiffness=stiffness,
        damping=np.diag([100.0, 200.0, 1500.0, 10.0, 20.0, 30.0]),
        body_mass=body_mass,
    )


@lru_cache(maxsize=6)
def wheel(speed: float, count: int, axle_at: int = 0):
    """The full matrices of a held rim, the modes, and the basis that a corner has joined."""
    axle = (six_ways(), replace(six_ways(None), locked=("rx", "ry", "rz")), None)[axle_at]
    made, rolling = body(speed), Rolling(speed=speed)
    operators = Operators(made, 2e5, Support("fixed"), rolling)
    rotation = operators.rotation() if speed else None
    modes = undamped.solve(operators.stiffness, operators.mass, count, sites=sites(operators))
    projection = project(modes, rotation, operators.carried, COMM)
    motion = rim_motion(made, 2e5, rolling, speed != 0)

    def corner(projection, modes):
        return with_corner(projection, modes, axle, motion, places(speed), COMM)

    full = Wheel(
        operators=operators,
        rotation=rotation,
        speed=speed,
        damping=DAMPING,
        inertia="full",
        corner=corner,
        rim=lambda: motion,
    )
    projection = corner(projection, modes)
    states = full.decouple(projection, COMM)
    return (
        full,
        modes,
        Basis(
            shape=operators.trace(modes.vectors), projection=projection, states=states, speed=speed
        ),
    )


def loads(speed: float, extra: int) -> sparse.csr_matrix:
    """Forces on the outer face, then unit forces on what moves besides."""
    weights = [probe.spot(body(speed).lattice, *spot) for spot in SPOTS]
    directions = [(0, 0, 1.0), (1.0, 0, 0), (0, 1.0, 0.3), (1.0, 0.2, 0)]
    pairs = zip(weights, directions, strict=True)
    face = sparse.csr_matrix(np.stack([probe.directed(w, d) for w, d in pairs]))
    return sparse.block_diag([face, sparse.identity(extra)], format="csr")


def dense_receptance(speed: float, axle: Axle) -> np.ndarray:
    """H (f, 11, 11) of the full matrices of a rim that is free, with wheel and body on it: no modes, no corner.

    The material's damping acts on the motion against the rim.
    """
    held = Operators(body(speed), 2e5, Support("fixed"), Rolling(speed=speed))
    free = Operators(body(speed), 2e5, Support("free"), Rolling(speed=speed))
    n, rim = len(held.mass), free.unknowns.rim.coordinates
    points = body(speed).lattice.points(body(speed).ids) + body(speed).owned(body(speed).u.x.array)
    rigid = rigid_motions(points)[free.unknowns.free]
    against = np.hstack([np.eye(n), -rigid @ rim, np.zeros((n, 1))])
    moved = np.zeros((7, n + 7))
    moved[:6, n : n + 6], moved[6, -1] = rim, 1.0
    stiffness = everywhere(held.stiffness).toarray()
    drag = DAMPING[0] * np.diag(held.mass) + DAMPING[1] * stiffness
    D = against.T @ drag @ against + moved.T @ axle.between_wheel_and_body(axle.damping) @ moved
    K = moved.T @ axle.between_wheel_and_body(axle.stiffness) @ moved
    K[:-1, :-1] += everywhere(free.stiffness).toarray()
    if speed:
        turning, rate = free.rotation(), everywhere(held.rotation().body).toarray()
        K[:-1, :-1] += speed**2 * everywhere(turning.convective).toarray()
        K += against.T @ (speed * drag @ (rate / held.mass[:, None])) @ against
        D[:-1, :-1] += 2 * speed * everywhere(turning.gyroscopic).toarray()
        D += moved[:6].T @ (speed * axle.gyroscopic) @ moved[:6]
    M = np.diag(np.append(free.mass, axle.body_mass))
    M += moved[:6].T @ axle.mass @ moved[:6]
    face = loads(speed, 6)
    load = np.zeros((n + 7, 11))
    load[:-1, :4] = on_own_rows(free, face).toarray()[:, :4]
    load[:, 4:] = moved.T
    s = 2j * np.pi * FREQUENCY
    return np.stack([load.T @ np.linalg.solve(z * z * M + z * D + K, load) for z in s])


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_all_modes_with_a_corner_are_the_full_matrices_of_a_free_rim(speed) -> None:
    """Six directions, a body, gyroscopic torque, a loaded tire: nothing is left out, so nothing differs."""
    if COMM.size > 1:
        pytest.skip("dense matrices")
    _, _, basis = wheel(speed, 10**6)
    assert basis.states.rigid == 2
    exact = dense_receptance(speed, six_ways())
    probes = loads(speed, 7)
    found = basis.couple(probes, probes).receptance(FREQUENCY)
    size = np.abs(np.einsum("fii->fi", exact)) ** 0.5
    off = np.abs(found - exact) / (size[:, :, None] * size[:, None, :])
    assert off.max() < 1e-8


@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_hub_by_the_blocked_force_and_its_moments_by_the_springs(speed) -> None:
    _, _, basis = wheel(speed, 60)
    turning = Turning(speed=speed, damping=DAMPING)
    probes = loads(speed, 0)
    assert disagreement(basis, turning, probes, FREQUENCY) < 1e-9
    axle, wide = basis.projection.corner.axle, loads(speed, 10)
    H = basis.couple(wide[4:], wide[:4]).receptance(FREQUENCY)
    for s, h in zip(2j * np.pi * FREQUENCY, H, strict=True):
        stretch = h[:6].copy()
        stretch[2] -= h[6]
        force = (axle.stiffness + s * axle.damping) @ stretch
        assert np.abs(force[3:] - h[7:]).max() < 1e-9 * np.abs(force[3:]).max()


@pytest.mark.long
@pytest.mark.mpi
def test_residuals_with_a_corner_are_those_of_the_held_rim() -> None:
    """Static: all that 60 modes lack of the held tire, whatever the corner does. And attachment comes closer.

    In translations: turned wheels turn static loads too, which modes left out do not know (1 % here).
    """
    speed = 60.0
    full, modes, basis = wheel(speed, 60, 1)
    plain, _, held = wheel(speed, 60, 2)
    face = loads(speed, 0)
    static = full.respond(basis, modes, face, face, "static")
    alone = plain.respond(held, modes, face, face, "static")
    assert static.residual == pytest.approx(alone.residual, rel=1e-6, abs=1e-14)
    assert static.left_out == pytest.approx(alone.left_out, rel=1e-6, abs=1e-12)
    exact = wheel(speed, 10**6, 1)[2].couple(face, face).receptance(FREQUENCY)
    off = {}
    for option in ("none", "static", "attachment"):
        found = basis.couple(face, face) if option == "none" else None
        found = found or full.respond(basis, modes, face, face, option)
        error = np.abs(found.receptance(FREQUENCY) - exact)
        off[option] = error.max(axis=(1, 2)) / np.abs(exact).max(axis=(1, 2))
    assert off["attachment"].max() < 0.02
    assert (off["static"][:2] < 0.01 * off["none"][:2]).all()


def test_a_corner_softer_than_its_load_is_told() -> None:
    """The static load, 0.3 m under the axle, turns the wheel over."""
    corner = wheel(60.0, 60)[2].projection.corner
    soft = np.diag([1e5, 2e5, 3e4, 100.0, 1e4, 3e3])
    axle = Axle(wheel_mass=15.0, wheel_inertia=(0.4, 0.8, 0.5), stiffness=soft, damping=0 * soft)
    with pytest.raises(InputError, match="unstable"):
        replace(corner, axle=axle).check(60.0)


def test_what_is_no_axle() -> None:
    six, mass = np.ones(6), {"wheel_mass": 1.0, "wheel_inertia": (1.0, 1.0, 1.0)}
    with pytest.raises(InputError, match="symmetric"):
        Axle(stiffness=np.triu(np.ones((6, 6))), damping=six, **mass)
    with pytest.raises(InputError, match="locked"):
        Axle(stiffness=six, damping=six, locked=("w",), **mass)
    with pytest.raises(InputError, match="mass"):
        Axle(stiffness=six, damping=six, wheel_mass=1.0, wheel_inertia=(0.0, 1.0, 1.0))


def test_a_wheel_free_in_all_directions_has_no_hub_force_to_compare() -> None:
    """Its hub force is 0 at every frequency: a relative difference divided by zero, and was stored as null."""
    _, modes, basis = wheel(0.0, 60)
    axle = Axle(
        wheel_mass=5.0,
        wheel_inertia=(0.4, 0.8, 0.5),
        stiffness=np.zeros(6),
        damping=np.zeros(6),
        locked=("rx", "ry", "rz"),
    )
    projection = replace(basis.projection, corner=replace(basis.projection.wheel, axle=axle))
    turning = Turning(speed=0.0, damping=DAMPING)
    states = decouple(projection, turning, COMM)
    free = replace(basis, projection=projection, states=states)
    with np.errstate(all="raise"):
        assert disagreement(free, turning, loads(0.0, 0), FREQUENCY) is None
