"""The full finite elements in time: order, static limit, energy, and balance of momentum."""

import numpy as np
import pytest
from mpi4py import MPI
from turning_torus import DAMPING, inflated, pulse

from tireroad.fem.matrices.compliance import compliance, rotating_stiffness
from tireroad.fem.transient import FullTire


@pytest.fixture(scope="module")
def tire():
    return inflated(MPI.COMM_SELF)


def history(tire, step, radius, speed=60.0, force=pulse, duration=0.02, damping=DAMPING):
    operators, rotation, load = tire
    turning = rotation if speed else None
    full = FullTire(
        operators=operators,
        rotation=turning,
        speed=speed,
        damping=damping,
        step=step,
        outputs=load,
        loads=load,
        spectral_radius=radius,
    )
    steps = round(duration / step)
    out = np.zeros(steps + 1)
    full.start(np.array([force(0.0)]))
    for k in range(1, steps + 1):
        free = full.predict()
        value = np.array([force(k * step)])
        full.advance(value)
        out[k] = (free + full.same_step @ value)[0]
    return out, full


@pytest.mark.slow
@pytest.mark.parametrize("radius", [0.0, 0.6, 1.0])
def test_second_order_in_the_step_also_when_rolling(tire, radius):
    """Errors against a fine solution fall by four a halving."""
    fine, _ = history(tire, 3.125e-5, 1.0)
    errors = []
    for step in (5e-4, 2.5e-4):
        coarse, _ = history(tire, step, radius)
        every = round(step / 3.125e-5)
        errors.append(np.linalg.norm(coarse - fine[::every]) / np.linalg.norm(fine[::every]))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.35)
    assert errors[1] < 0.02


@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_constant_force_settles_at_the_static_flexibility(tire, speed):
    operators, rotation, load = tire
    stiffness = rotating_stiffness(operators, rotation, speed, DAMPING)
    static = compliance(operators, stiffness, load, load)[0, 0]
    moved, full = history(tire, 5e-4, 0.0, speed, lambda t: 1.0, 0.15)
    assert moved[-1] == pytest.approx(static, rel=1e-6)
    assert np.abs(full.inertia_force()).max() < 1e-6


def energy(operators, full):
    """1/2 v M v + 1/2 u K u, J, of a tire that stands."""
    moved = operators.stiffness.createVecLeft()
    here = operators.stiffness.createVecLeft()
    here.array[:] = full.displacement
    operators.stiffness.mult(here, moved)
    kinetic = operators.mass @ full.velocity**2
    return operators.body.comm.allreduce(kinetic + full.displacement @ moved.array) / 2


def test_undamped_average_acceleration_keeps_its_energy(tire):
    """After a push, a tire that stands keeps 1/2 v M v + 1/2 u K u to rounding."""
    operators, _, _ = tire
    _, after = history(tire, 2e-4, 1.0, 0.0, duration=0.012, damping=(0.0, 0.0))
    _, later = history(tire, 2e-4, 1.0, 0.0, duration=0.05, damping=(0.0, 0.0))
    _, calm = history(tire, 2e-4, 0.0, 0.0, duration=0.05, damping=(0.0, 0.0))
    assert energy(operators, later) == pytest.approx(energy(operators, after), rel=1e-8)
    assert energy(operators, calm) < 0.999 * energy(operators, after)


def test_rate_of_momentum_belongs_to_the_end_of_the_step(tire):
    """Its integral is the momentum; the scheme's own acceleration would lag by a step."""
    step, steps = 1e-4, 120
    operators, _, load = tire
    full = FullTire(
        operators=operators,
        rotation=None,
        speed=0.0,
        damping=DAMPING,
        step=step,
        outputs=load,
        loads=load,
        spectral_radius=0.0,
    )
    full.start(np.zeros(1))
    rates, momenta = np.zeros(steps + 1), np.zeros(steps + 1)
    for k in range(1, steps + 1):
        full.predict()
        full.advance(np.array([pulse(k * step)]))
        rates[k] = full.inertia_force()[2]
        momenta[k] = operators.body.comm.allreduce(operators.mass[2::3] @ full.velocity[2::3])
    integral = np.cumsum((rates[1:] + rates[:-1]) / 2 * step)
    assert np.abs(integral - momenta[1:]).max() < 0.01 * np.abs(momenta).max()


def march(full, steps, first=1, step=2e-4):
    """Reading and rate of momentum after each of the steps `first` to `steps` of the push."""
    out = np.zeros((steps + 1 - first, 4))
    for row, k in zip(out, range(first, steps + 1), strict=True):
        free, value = full.predict(), np.array([pulse(k * step)])
        full.advance(value)
        row[0], row[1:] = (free + full.same_step @ value)[0], full.inertia_force()
    return out


def rolling_tire(tire, step=2e-4):
    operators, rotation, load = tire
    return FullTire(
        operators=operators,
        rotation=rotation,
        speed=60.0,
        damping=DAMPING,
        step=step,
        outputs=load,
        loads=load,
    )


def test_goes_on_from_a_snapshot_with_the_same_bits(tire):
    whole, broken, again = (rolling_tire(tire) for _ in range(3))
    history = march(whole, 40)
    march(broken, 25)
    again.restore(broken.snapshot())
    assert np.array_equal(march(again, 40, first=26), history[25:])
    assert np.abs(history[25:]).max() > 0


@pytest.mark.mpi
def test_the_same_on_any_number_of_processes_also_from_a_snapshot(tire):
    """A snapshot of one process goes on spread over all of them."""
    alone, spread = rolling_tire(tire), rolling_tire(inflated(MPI.COMM_WORLD))
    for first, last in ((1, 30), (31, 40)):
        one, several = march(alone, last, first), march(spread, last, first)
        displacement, momentum = one[:, 0], one[:, 1:]
        assert np.abs(displacement - several[:, 0]).max() < 1e-10 * np.abs(displacement).max()
        assert np.abs(momentum - several[:, 1:]).max() < 1e-10 * np.abs(momentum).max()
        spread.restore(alone.snapshot())


def test_contact_with_a_floor_at_rest_never_adds_energy(tire):
    """A floor lifts the tire by 1 mm, goes back to 0 and stays: bounces on it only lose."""
    operators, _, load = tire
    step = 1e-4
    full = FullTire(
        operators=operators,
        rotation=None,
        speed=0.0,
        damping=(0.0, 0.0),
        step=step,
        outputs=load,
        loads=load,
    )
    full.start(np.zeros(1))
    energies, touched = [], 0
    for k in range(1, 500):
        floor = 1e-3 * pulse(k * step)
        free = full.predict()[0]
        force = np.maximum((floor - free) / full.same_step[0], 0.0)
        full.advance(force)
        if k * step > 0.01:
            energies.append(energy(operators, full))
            touched += force[0] > 0
    assert 10 < touched < 400
    assert np.diff(energies).max() < 1e-6 * energies[0]
    assert energies[-1] > 0.05 * energies[0]
