"""The nonlinear tire in time: order, energy, small motions, a road that moves far, snapshots."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import on_own_rows, solve_all
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.transient import FullTire, NonlinearTire
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

INFLATION = 1e5
DAMPING = (400.0, 1e-6)
NONE = (0.0, 0.0)
PUSH = 300.0  # N: some millimetres


def inflated(comm):
    """A soft inflated torus of few elements, and a push at its lowest point."""
    section = thesis_torus(segments=10, elements_arc=4)
    body = Body(
        comm, section, compound("neo-hookean", 1200.0, youngs_modulus=4.8e6, poisson_ratio=0.45)
    )
    LoadStepper(Equilibrium(body), lambda progress: None).inflate(INFLATION)
    weights = probe.spot(body.lattice, 0.0, 0.0)
    return Operators(body, INFLATION), sparse.csr_matrix(probe.directed(weights, (0.0, 0.0, 1.0)))


@pytest.fixture(scope="module")
def tire():
    return inflated(MPI.COMM_SELF)


def nonlinear(tire, step, radius=0.0, damping=DAMPING):
    operators, load = tire
    return NonlinearTire(
        operators=operators,
        inflation=INFLATION,
        damping=damping,
        step=step,
        outputs=load,
        loads=load,
        spectral_radius=radius,
    )


def linear(tire, step):
    operators, load = tire
    return FullTire(
        operators=operators,
        rotation=None,
        speed=0.0,
        damping=DAMPING,
        step=step,
        outputs=load,
        loads=load,
    )


class Manufactured(NonlinearTire):
    """A tire whose solution is g(t) `shape`, g = sin^2(w t): the forces on all unknowns that it needs are applied."""

    def prepare(self, shape, frequency):
        self.shape, self.rate, self.count = shape, 2 * np.pi * frequency, 0
        self.acceleration = self.balanced = self.amplitude(0.0)[2] * shape

    def amplitude(self, time):
        turn = self.rate * time
        rates = np.sin(2 * turn), 2 * np.cos(2 * turn)
        return np.sin(turn) ** 2, self.rate * rates[0], self.rate**2 * rates[1]

    def predict(self):
        self.count += 1
        g, first, second = (part * self.shape for part in self.amplitude(self.count * self._step))
        self.applied = self._mass * second + self._product(first) + self._force.change(g)
        return super().predict()

    def _dynamic(self, new):
        return super()._dynamic(new) - self.applied


def manufactured(tire, step, radius, last=8e-3):
    """Relative error over time of a known motion of 30 mm, and the tire."""
    operators, load = tire
    shape = solve_all(operators.stiffness, on_own_rows(operators, load))[:, 0]
    shape *= 0.03 / abs(shape).max()
    full = Manufactured(
        operators=operators,
        inflation=INFLATION,
        damping=DAMPING,
        step=step,
        outputs=load,
        loads=load,
        spectral_radius=radius,
    )
    full.prepare(shape, 62.5)
    off = size = 0.0
    for k in range(1, round(last / step) + 1):
        full.predict()
        while full.settle(np.zeros(1)) is not None:
            pass
        full.advance(np.zeros(1))
        exact = full.amplitude(k * step)[0] * shape
        off += float(((full.displacement - exact) ** 2).sum())
        size += float((exact**2).sum())
    return np.sqrt(off / size), full


def pulse(time):
    """A smooth push of 10 ms."""
    return np.where(time < 0.01, np.sin(np.pi * time / 0.01) ** 4, 0.0)


def march(full, step, size=PUSH, last=0.02, first=0.0):
    """Displacement (m) at the push after every step from time `first` to `last`."""
    out = []
    for k in range(round(first / step) + 1, round(last / step) + 1):
        free, force = full.predict(), np.array([size * pulse(k * step)])
        while hasattr(full, "settle") and (again := full.settle(force)) is not None:
            free = again
        full.advance(force)
        out.append((free + full.same_step @ force)[0])
    return np.array(out)


@pytest.mark.parametrize("radius", [0.0, 1.0])
def test_a_manufactured_motion_of_centimetres_is_found_to_second_order(tire, radius):
    """Three times the wall's thickness, with the factor of the linear step and secants of it."""
    errors = []
    for step in (5e-4, 2.5e-4, 1.25e-4):
        error, full = manufactured(tire, step, radius)
        errors.append(error)
        assert full.factors == 1  # secants of the linear step's factor do
        assert (
            full.turns <= 12 * full.count
        )  # of 30 after which the matrix would be factorised anew
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.25)
    assert errors[-1] < 0.01


@pytest.mark.long
@pytest.mark.parametrize("radius", [0.0, 1.0])
def test_second_order_in_the_step(tire, radius):
    fine = march(nonlinear(tire, 2.5e-5, 1.0), 2.5e-5)
    assert 2e-3 < abs(fine).max() < 2e-2
    errors = []
    for step in (4e-4, 2e-4):
        every = round(step / 2.5e-5)
        coarse = march(nonlinear(tire, step, radius), step)
        errors.append(np.linalg.norm(coarse - fine[every - 1 :: every]) / np.linalg.norm(coarse))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)
    assert errors[1] < 0.05


def test_differs_from_the_linear_tire_by_the_square_of_the_motion(tire):
    step, apart = 2e-4, []
    for size in (0.01 * PUSH, 0.02 * PUSH):
        straight = march(linear(tire, step), step, size)
        bent = march(nonlinear(tire, step), step, size)
        apart.append(np.linalg.norm(bent - straight))
        assert apart[-1] < 0.05 * np.linalg.norm(straight)
    assert np.log2(apart[1] / apart[0]) == pytest.approx(2.0, abs=0.15)


@pytest.mark.long
def test_energy_is_the_work_done_and_stays(tire):
    """Undamped, average acceleration: off by the square of the step; the quiet method only loses."""
    drift = []
    for step in (4e-4, 2e-4):
        full = nonlinear(tire, step, 1.0, NONE)
        moved = march(full, step, last=0.01)
        force = PUSH * pulse(step * np.arange(1, len(moved) + 1))
        work = np.sum((force[1:] + force[:-1]) / 2 * np.diff(moved))
        energies = [full.energy()]
        for k in range(1, 5):
            march(full, step, first=0.01 * k, last=0.01 * (k + 1))
            energies.append(full.energy())
        assert work > 0.1
        drift.append(max(abs(np.array(energies) / work - 1)))
    assert drift[0] < 0.05
    assert drift[1] < drift[0] / 2.5
    quiet = nonlinear(tire, 2e-4, 0.0, NONE)
    march(quiet, 2e-4, last=0.01)
    calm = [quiet.energy()]
    for k in range(1, 5):
        march(quiet, 2e-4, first=0.01 * k, last=0.01 * (k + 1))
        calm.append(quiet.energy())
    assert np.diff(calm).max() < 0


def test_the_body_stays_at_its_static_state_and_a_rest_stays_a_rest(tire):
    before = tire[0].body.u.x.array.copy()
    full = nonlinear(tire, 2e-4)
    moved = march(full, 2e-4, size=0.0, last=0.004)
    assert abs(moved).max() == 0.0
    march(full, 2e-4, last=0.002)
    assert np.array_equal(tire[0].body.u.x.array, before)


def test_a_motion_out_of_reach_is_refused(tire):
    with pytest.raises(ConvergenceError, match="smaller step"):
        march(nonlinear(tire, 2e-3), 2e-3, size=1e6)


def test_goes_on_from_a_snapshot_with_the_same_bits(tire):
    step = 2e-4
    whole, broken, again = (nonlinear(tire, step) for _ in range(3))
    history = march(whole, step, last=0.008)
    march(broken, step, last=0.005)
    again.restore(broken.snapshot())
    assert np.array_equal(march(again, step, first=0.005, last=0.008), history[25:])


@pytest.mark.mpi
def test_the_same_on_any_number_of_processes(tire):
    alone, spread = nonlinear(tire, 4e-4), nonlinear(inflated(MPI.COMM_WORLD), 4e-4)
    one, several = (march(full, 4e-4, last=0.008) for full in (alone, spread))
    assert abs(one - several).max() < 1e-8 * abs(one).max()
    assert spread.energy() == pytest.approx(alone.energy(), rel=1e-6)
    assert spread.inertia_force() == pytest.approx(alone.inertia_force(), rel=1e-5, abs=1e-4)
