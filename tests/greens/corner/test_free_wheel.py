"""A wheel that turns freely: a corner whose wheel may turn, an exact pair of inertias, and what a run says of it."""

from functools import lru_cache

import numpy as np
import pytest
import test_corner
from test_corner import COMM, DAMPING, FREQUENCY, RUBBER, SPOTS, loads, places, wheel

from tireroad.contact.free_wheel import FreeWheel, with_spin
from tireroad.fem.errors import InputError
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import Basis
from tireroad.greens.fewer_modes import of_fewer_modes
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis, with_corner
from tireroad.modal.corner import SEEN
from tireroad.modal.rolling import RollingModes
from tireroad.tests.validation.cases import thesis_torus

HELD, EVERY, INERTIA, SPEED = 2, 10**6, 0.03, 60.0
COUNT, ABOUT_Y = len(SPOTS), 4  # loads; of the rim's six motions


@lru_cache(maxsize=1)
def inflated(speed: float) -> Body:
    """A soft torus that touches nothing: a turn of its wheel leaves its shape where it was."""
    made = Body(COMM, thesis_torus(segments=8, elements_arc=2), RUBBER)
    LoadStepper(Equilibrium(made, Rolling(speed=speed)), lambda progress: None).inflate(2e5)
    return made


@pytest.fixture
def unloaded(monkeypatch):
    """Matrices, modes and held basis of the tire that touches nothing."""
    monkeypatch.setattr(test_corner, "body", inflated)
    return wheel.__wrapped__(SPEED, EVERY, HELD)


def rolling_modes(basis: Basis) -> RollingModes:
    modes = ModalBasis(
        frequency=basis.projection.frequency, shape=basis.shape, projection=basis.projection
    )
    turning = Turning(speed=SPEED, damping=DAMPING)
    return RollingModes(basis=modes, states=basis.states, turning=turning)


def held(basis: Basis) -> Response:
    """The response of displacements and hub moments to the loads."""
    wide = loads(SPEED, SEEN + 3)
    outputs = wide[[*range(COUNT), *range(COUNT + SEEN, COUNT + SEEN + 3)]]
    return basis.couple(outputs, wide[:COUNT])


def spun(basis: Basis) -> Response:
    """The same with w' and w as further loads."""
    return with_spin(held(basis), rolling_modes(basis))


def freely(basis: Basis, frequency: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Receptance with w' as last input and w = w' / s part of it, and w' (f, 4) per load of a wheel that is free."""
    H = spun(basis).receptance(frequency)
    H = np.dstack([H[:, :, :-2], H[:, :, -2] + H[:, :, -1] / (2j * np.pi * frequency[:, None])])
    moment = H[:, COUNT + 1]
    return H, moment[:, :COUNT] / (INERTIA - moment[:, COUNT])[:, None]


@pytest.mark.slow
def test_it_is_a_corner_whose_wheel_may_turn(unloaded) -> None:
    """Where the tire touches nothing a turn costs nothing, so the corner's states have it exactly."""
    if COMM.size > 1:
        pytest.skip("all modes")
    full, modes, basis = unloaded
    H, turned = freely(basis, FREQUENCY)
    found = H[:, :COUNT, :COUNT] + H[:, :COUNT, [COUNT]] * turned[:, None]

    none, spring = np.zeros((6, 6)), np.diag([0.0, 0.0, 0.0, 0.0, 1e-6, 0.0])
    axle = Axle(
        wheel_mass=1.0,
        wheel_inertia=(1.0, INERTIA, 1.0),
        stiffness=spring,  # above the rounding of what a turn costs
        damping=none,
        locked=("x", "y", "z", "rx", "rz"),
    )
    freed = with_corner(basis.projection, modes, axle, full.rim(), places(SPEED), COMM)
    states = full.decouple(freed, COMM)
    corner = Basis(shape=basis.shape, projection=freed, states=states, speed=SPEED)
    probes = loads(SPEED, SEEN)
    seen = corner.couple(probes, probes[:COUNT]).receptance(FREQUENCY)
    angle = seen[:, COUNT + ABOUT_Y]
    carried = freed.corner.rigid(probes)[:COUNT, ABOUT_Y]
    relative = seen[:, :COUNT] - carried[:, None] * angle[:, None]
    s = 2j * np.pi * FREQUENCY[:, None]
    assert turned == pytest.approx(s**2 * angle, rel=1e-6)
    assert np.abs(found - relative).max() < 1e-6 * np.abs(relative).max()
    apart = np.abs(H[:, :COUNT, :COUNT] - relative).max()
    assert apart > 0.02 * np.abs(relative).max()


@pytest.mark.slow
@pytest.mark.parametrize("residual", ["none", "static"])
def test_fewer_modes_turn_it_alike_below_them(unloaded, residual) -> None:
    """They read the hub moments, also of what replaces the modes left out."""
    if COMM.size > 1:
        pytest.skip("all modes")
    basis, rolling = unloaded[2], rolling_modes(unloaded[2])
    probes = loads(SPEED, SEEN)[:COUNT]
    wide = min(probes.shape[1], len(basis.shape))
    readings = probes[:, :wide] @ basis.shape[:wide]
    frequency = np.array([0.7, 5.0])
    given = rolling, readings, probes, 0.2, residual, (), COMM
    few, states, _ = of_fewer_modes(held(basis), *given)
    assert len(states.states.eigenvalue) < 0.6 * len(rolling.states.eigenvalue)
    whole, found = held(basis).receptance(frequency), few.receptance(frequency)
    moments = whole[:, COUNT:], found[:, COUNT:]
    assert np.abs(moments[1] - moments[0]).max() < 1e-3 * np.abs(moments[0]).max()
    spins = with_spin(few, states).receptance(frequency)
    assert spins.shape == (2, COUNT + 3 + 2, COUNT + 2)
    about = spins[:, COUNT + 1, COUNT], spun(basis).receptance(frequency)[:, COUNT + 1, COUNT]
    assert about[0] == pytest.approx(about[1], rel=1e-3)


@pytest.mark.slow
def test_steps_converge_to_it_and_work_is_what_the_states_get(unloaded) -> None:
    """Under a load that grows as a sine, against the response over frequency; with steps of 50 us."""
    if COMM.size > 1:
        pytest.skip("all modes")
    response, step = spun(unloaded[2]).resolved(5e-5), 5e-5
    tire = Recursion(response=response, step=step, scheme="linear", comm=COMM)
    free = FreeWheel(tire, INERTIA, SPEED, step, "linear")
    free.start(np.zeros(COUNT))
    drive, rate = 2 * np.pi * 20.0, []
    load = np.array([0.0, 1.0, 0.0, 0.3])
    for n in range(1, 40001):
        free.predict()
        free.advance(load * np.sin(drive * n * step))
        rate.append(free.rate)
    turned = freely(unloaded[2], np.array([20.0]))[1][0] @ load
    late = np.arange(30001, 40001)
    exact = (turned / (1j * drive) * np.exp(1j * drive * late * step)).imag
    last = np.array(rate[30000:])
    assert np.abs(last - last.mean() - exact).max() < 2e-3 * np.abs(exact).max()
    kept = free.snapshot()
    ahead, reached = free.predict(), free.rate
    other = FreeWheel(
        Recursion(response=response, step=step, scheme="linear", comm=COMM),
        INERTIA, SPEED, step, "linear",
    )  # fmt: skip
    other.restore(kept)
    assert np.array_equal(other.predict(), ahead) and other.rate == reached
    assert other.work == free.work != 0.0


def test_states_that_are_not_the_modes_own_are_refused() -> None:
    _, _, basis = wheel(SPEED, 20, HELD)
    response = held(basis)
    fewer = response.keeping(np.arange(len(response.eigenvalue)) > 2)
    with pytest.raises(InputError, match="rotation.wheel"):
        with_spin(fewer, rolling_modes(basis))
