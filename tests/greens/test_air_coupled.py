"""Tire and air together: modal and full matrices, in frequency and in time, and the axle's force."""

from functools import lru_cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.cavity import make_column
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.operators import Operators, Support, rim_motion
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.transient import FullTire
from tireroad.greens.coupling import Basis, Wheel
from tireroad.greens.outputs import by_free_rim
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import couple
from tireroad.modal.basis import project
from tireroad.modal.solver import undamped
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

COMM = MPI.COMM_WORLD
RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=4.8e7, poisson_ratio=0.45)
SPOTS = [(0.0, 0.0), (0.15, 0.1), (-0.2, -0.3), (1.0, 0.5)]
DAMPING = (60.0, 1e-6)
EVERY = 10**6


@lru_cache(maxsize=3)
def body(speed: float, deflection: float = 0.01) -> Body:
    """An inflated soft torus on the road, turning or not."""
    section = thesis_torus(segments=8, elements_arc=2)
    made = Body(COMM, section, RUBBER)
    loader = LoadStepper(Equilibrium(made, Rolling(speed=speed)), lambda progress: None)
    loader.inflate(2e5)
    if deflection:
        loader.deflect(deflection)
    return made


@lru_cache(maxsize=6)
def wheel(speed: float, rim: str, count: int, loss=0.01, air=True, alone=False):
    """The full matrices, the modes, and what they make with the air; without a road if `alone`."""
    tire = body(speed, 0.0 if alone else 0.01)
    operators = Operators(tire, 2e5, Support(rim), Rolling(speed=speed))
    rotation = operators.rotation() if speed else None
    modes = undamped.solve(operators.stiffness, operators.mass, count, sites=sites(operators))
    column = None
    if air:
        column = make_column(tire, operators.unknowns, 2e5, 293.15, speed, 500.0, loss)
    made = Wheel(
        operators=operators,
        rotation=rotation,
        speed=speed,
        damping=DAMPING,
        inertia="full",
        air=column,
    )
    projection = made.with_air(project(modes, rotation, operators.carried, COMM), modes)
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


def near_the_air(made) -> np.ndarray:
    """Frequencies about the air's first pair, Hz, and one far below."""
    return np.append(made.air.duct.frequency[:2] + np.array([-4.0, 3.0]), 20.0)


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_all_modes_with_air_are_the_full_matrices_with_air(speed) -> None:
    """Also reciprocal: g_ij(Omega) = g_ji(-Omega) standing; and without air it would be far off."""
    made, _, basis = wheel(speed, "fixed", EVERY)
    points, frequency = loads(), near_the_air(made)
    exact = made.receptance(points, points, frequency)
    found = basis.couple(points, points).receptance(frequency)
    assert off(found, exact) < (1e-7 if speed == 0 else 1e-3)
    dry, _, alone = wheel(speed, "fixed", EVERY, air=False)
    assert off(alone.couple(points, points).receptance(frequency), exact) > 0.01
    if speed == 0:
        assert off(exact, exact.swapaxes(1, 2)) < 1e-9


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_every_residual_knows_the_air(speed) -> None:
    """250 modes: exact at 0 Hz, and attachment close near the air's resonance."""
    made, modes, basis = wheel(speed, "fixed", 250)
    points = loads()
    slow, fast = np.array([1e-3]), near_the_air(made)
    for option, allowed in {"static": 0.05, "attachment": 0.01}.items():
        found = made.respond(basis, modes, points, points, option)
        still = made.receptance(points, points, slow)
        assert off(found.receptance(slow), still) < 1e-6, option
        assert off(found.receptance(fast), made.receptance(points, points, fast)) < allowed, option


def push(time):
    return np.where(time < 0.004, np.sin(np.pi * time / 0.004) ** 4, 0.0)


def march(tire, step: float, steps: int) -> np.ndarray:
    """Displacement along the first load and rate of momentum after each step."""
    out = np.zeros((steps, 4))
    tire.start(np.zeros(1))
    for k in range(steps):
        free, force = tire.predict(), np.array([push((k + 1) * step)])
        tire.advance(force)
        out[k, 0], out[k, 1:] = (free + tire.same_step @ force)[0], tire.inertia_force()
    return out


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_full_finite_elements_in_time_agree_with_all_modes(speed) -> None:
    """Displacement and momentum of tire and air, rung by a short push: errors fall by four a halving."""
    made, _, basis = wheel(speed, "fixed", EVERY)
    load, errors = loads()[:1], []
    parts, size = (slice(1), slice(1, 4)), np.linalg.norm
    for step in (1e-4, 5e-5):
        full = FullTire(
            operators=made.operators, rotation=made.rotation, speed=speed, damping=DAMPING, step=step, outputs=load, loads=load,
            spectral_radius=1.0, air=made.air,
        )  # fmt: skip
        steps = round(0.02 / step)
        found = march(full, step, steps)
        exact = march(
            Recursion(response=basis.couple(load, load), step=step, scheme="linear", comm=COMM),
            step,
            steps,
        )
        errors.append([size((found - exact)[:, k]) / size(exact[:, k]) for k in parts])
    errors = np.array(errors)
    assert errors[1, 0] < 0.01
    assert errors[1].max() < 0.05
    assert np.log2(errors[0, 0] / errors[1, 0]) == pytest.approx(2.0, abs=0.4)


@pytest.mark.mpi
def test_full_tire_with_air_goes_on_from_a_snapshot() -> None:
    made, _, _ = wheel(60.0, "fixed", 60)
    load = loads()[:1]
    names = "operators", "rotation", "speed", "damping", "step", "outputs", "loads", "air"
    values = made.operators, made.rotation, 60.0, DAMPING, 1e-4, load, load, made.air
    whole, again = (FullTire(**dict(zip(names, values, strict=True))) for _ in range(2))
    march(whole, 1e-4, 30)
    again.restore(whole.snapshot())
    one, other = whole.predict(), again.predict()
    assert one == pytest.approx(other, rel=1e-12)
    assert np.abs(whole.snapshot()["air"]).max() > 0


@pytest.mark.long
@pytest.mark.mpi
def test_axle_force_by_momentum_of_tire_and_air_is_that_by_the_rim_and_its_pressure() -> None:
    """All modes: sum of loads - d/dt momentum of a held rim, against the force that holds a free rim, which the
    wall pulls and the air presses: inner forces cancel. A tire without air errs by far more."""
    made, modes, _ = wheel(0.0, "free", EVERY, 0.0, alone=True)
    frequency = np.array([5.0, 90.0, 160.0, 200.0])
    motion = rim_motion(body(0.0, 0.0), 2e5, Rolling(speed=0.0), False)
    found = by_free_rim(made, modes, loads(), frequency, motion)[:, :3]
    _, _, clamped = wheel(0.0, "fixed", EVERY, 0.0, alone=True)
    carried, seen = clamped.projection.carried, clamped.seen(loads())
    first = couple(clamped.states, carried, seen, carried).receptance(frequency)
    dense = loads().toarray()
    total = dense.reshape(len(dense), -1, 3).sum(axis=1).T
    exact = total + (2 * np.pi * frequency[:, None, None]) ** 2 * first
    own = np.where(np.arange(carried.shape[1]) < clamped.projection.own, carried, 0.0)
    bare = couple(clamped.states, own, seen, own).receptance(frequency)
    without = total + (2 * np.pi * frequency[:, None, None]) ** 2 * bare
    assert off(found, exact) < 1e-5
    assert off(without, exact) > 1e-3
