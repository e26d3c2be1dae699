"""The full finite elements in time: order, static limit, energy, and balance of momentum."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from fem import probe
from fem.body import Body
from fem.compliance import compliance, rotating_stiffness
from fem.equilibrium import Equilibrium
from fem.loading import Loader
from fem.material import Material
from fem.mesh import Torus
from fem.operators import Operators
from fem.transient import FullTire

DAMPING = (400.0, 0.0)


@pytest.fixture(scope="module")
def tire():
    """An inflated torus of few elements, its operators, rotation matrices, a load and its reading."""
    section = Torus(0.32, 0.10, 0.012, np.radians(120), 12, 4, 1, 2)
    material = Material("neo-hookean", 1200.0, 4.8e7, 0.45)
    body = Body(MPI.COMM_WORLD, section, material)
    Loader(Equilibrium(body), lambda progress: None).inflate(2e5)
    operators = Operators(body, 2e5)
    weights = probe.spot(body.lattice, 0.0, 0.0)
    load = sparse.csr_matrix(probe.directed(weights, (0.0, 0.0, 1.0)))
    return operators, operators.rotation(), load


def pulse(time):
    """A smooth push of 10 ms."""
    return np.where(time < 0.01, np.sin(np.pi * time / 0.01) ** 4, 0.0)


def history(tire, step, radius, speed=60.0, force=pulse, duration=0.02, damping=DAMPING):
    operators, rotation, load = tire
    turning = rotation if speed else None
    full = FullTire(operators, turning, speed, damping, step, load, load, spectral_radius=radius)
    steps = round(duration / step)
    out = np.zeros(steps + 1)
    full.start(np.array([force(0.0)]))
    for k in range(1, steps + 1):
        free = full.predict()
        value = np.array([force(k * step)])
        full.advance(value)
        out[k] = (free + full.same_step @ value)[0]
    return out, full


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


def test_undamped_average_acceleration_keeps_its_energy(tire):
    """After a push, a tire that stands keeps 1/2 v M v + 1/2 u K u to rounding."""
    operators, _, _ = tire

    def energy(full):
        moved = operators.stiffness.createVecLeft()
        here = operators.stiffness.createVecLeft()
        here.array[:] = full.displacement
        operators.stiffness.mult(here, moved)
        kinetic = operators.mass @ full.velocity**2
        return operators.body.comm.allreduce(kinetic + full.displacement @ moved.array) / 2

    _, after = history(tire, 2e-4, 1.0, 0.0, duration=0.012, damping=(0.0, 0.0))
    _, later = history(tire, 2e-4, 1.0, 0.0, duration=0.05, damping=(0.0, 0.0))
    _, calm = history(tire, 2e-4, 0.0, 0.0, duration=0.05, damping=(0.0, 0.0))
    assert energy(later) == pytest.approx(energy(after), rel=1e-8)
    assert energy(calm) < 0.999 * energy(after)


def test_rate_of_momentum_belongs_to_the_end_of_the_step(tire):
    """Its integral is the momentum; the scheme's own acceleration would lag by a step."""
    step, steps = 1e-4, 120
    operators, _, load = tire
    full = FullTire(operators, None, 0.0, DAMPING, step, load, load, spectral_radius=0.0)
    full.start(np.zeros(1))
    rates, momenta = np.zeros(steps + 1), np.zeros(steps + 1)
    for k in range(1, steps + 1):
        full.predict()
        full.advance(np.array([pulse(k * step)]))
        rates[k] = full.inertia_force()[2]
        momenta[k] = operators.body.comm.allreduce(operators.mass[2::3] @ full.velocity[2::3])
    integral = np.cumsum((rates[1:] + rates[:-1]) / 2 * step)
    assert np.abs(integral - momenta[1:]).max() < 0.01 * np.abs(momenta).max()
