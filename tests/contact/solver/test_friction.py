"""Bristles and Coulomb friction against closed forms and in the loop."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import ContactProblem, Drive, Loop, roll
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import MatrixCompliance, ProjectedCG
from tireroad.contact.solver.stick_slip import BrushFriction, PlaneCompliance, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_compliance, rectangle_potential
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import Recursion
from tireroad.tests.validation.cases import RollingStrip, oval_patch

PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
TREAD = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
STEP = 1e-4


def run(law, steps, speed=20.0, motion=lambda t: 0.0, tire=None, height=None, tolerance=1e-8):
    """Rolling with the given brush; a rigid tire on springs where none is given."""
    count = len(PATCH.points)
    if tire is None:
        tire = Recursion(
            response=RollingStrip(speed=speed).horizontal_response(PATCH.points, 3, 2, 1e3),
            step=STEP,
            scheme="linear",
            comm=MPI.COMM_SELF,
        )
    solver = ActiveSet(tire.same_step[:count, :count] + TREAD)
    brush = Brush(law, PATCH.points[:, 0], PATCH.line, speed, STEP)
    brush.begin(PATCH.force > 0)
    friction = BrushFriction(brush, tire.same_step, None, tolerance=tolerance)
    drive = Drive(height or Flat().height, motion, speed)
    return (
        list(roll(tire, solver, PATCH, drive, STEP, steps, friction)),
        friction,
        solver,
    )


class Rigid:
    """A tire that does not give way."""

    comm = MPI.COMM_SELF

    def __init__(self, count: int) -> None:
        self.same_step = np.zeros((3 * count, 3 * count))

    def predict(self) -> np.ndarray:
        return np.zeros(len(self.same_step))

    def advance(self, force: np.ndarray) -> None:
        pass

    def inertia_force(self) -> np.ndarray:
        return np.zeros(3)


@pytest.mark.parametrize("kind", ["rolling", "spring"])
def test_at_rest_nothing_moves(kind: str) -> None:
    instants, _, solver = run(BrushLaw(2e5, 0.8, kind=kind), 100)
    assert all(np.array_equal(i.force, PATCH.force) for i in instants)
    assert not any(i.horizontal.any() for i in instants)
    assert solver.factorisations == 1


def test_steady_sticking_brush_is_the_distance_from_entry() -> None:
    slip, stiffness = (2e-3, -1e-3), 3e4
    tire = Rigid(len(PATCH.points))
    instants, _, _ = run(BrushLaw(stiffness, None, slip), 200, tire=tire)
    last = instants[-1].horizontal
    x, touching = PATCH.points[:, 0], PATCH.force > 0
    for line in np.unique(PATCH.line):
        on = touching & (PATCH.line == line)
        if on.any():
            # The mask of touching points is linear between them: contact begins up to a spacing
            # ahead of the foremost one.
            foremost = last[on][x[on].argmax()] / stiffness / np.array([slip[0], -slip[1]])
            assert np.all((foremost > 0.0) & (foremost < 0.015))
            travelled = foremost[0] + x[on].max() - x[on]
            force = stiffness * np.stack([slip[0] * travelled, -slip[1] * travelled], axis=-1)
            assert np.allclose(last[on], force, rtol=1e-6)


def test_coulomb_bounds_and_full_sliding() -> None:
    law = BrushLaw(3e4, 0.5, (0.3, 0.0))
    last = run(law, 200, tire=Rigid(len(PATCH.points)))[0][-1]
    size = np.linalg.norm(last.horizontal, axis=1)
    assert np.all(size <= 0.5 * last.force * (1 + 1e-12))
    touching = last.force > 0
    inner = touching & (np.roll(touching, -7))  # the foremost points have only just entered
    assert np.allclose(last.horizontal[inner, 0], 0.5 * last.force[inner], rtol=1e-9)


def wavy(x, y):
    return 5e-4 * np.minimum(x / 0.3, 1.0) ** 3 * np.sin(2 * np.pi * x / 0.25 + 10 * y) * (x > 0)


@pytest.mark.parametrize("friction", [None, 0.0, 0.3, 2.0])
@pytest.mark.parametrize("slip", [(0.0, 0.0), (0.05, 0.02)])
def test_coupled_step_satisfies_its_own_equations(friction, slip) -> None:
    law = BrushLaw(1e5, friction, slip)
    instants, coupling, _ = run(law, 120, height=wavy)
    for instant in instants:
        assert np.all(np.isfinite(instant.horizontal))
        assert not instant.horizontal[instant.force == 0].any()
        if friction is not None:
            size = np.linalg.norm(instant.horizontal, axis=1)
            assert np.all(size <= friction * instant.force * (1 + 1e-9) + 1e-12)
    brush = coupling._brush
    assert np.allclose(brush.deflection, -instants[-1].horizontal / 1e5)
    moved = max(np.abs(i.horizontal).max() for i in instants)
    assert (moved > 0.1) == (friction != 0.0)


@pytest.mark.parametrize("off", [0.0, 1e-7, 1e-6, 1e-3, 1.0])
def test_a_guess_that_is_nearly_right_is_not_taken_for_the_answer(off) -> None:
    """A guess that is off by less than the tolerance is the answer to within that, and no other."""
    tolerance = 1e-9
    law = BrushLaw(3e4, 5.0, (0.005, 0.002))
    _, friction, solver = run(law, 60, height=wavy, tolerance=tolerance)
    kept, count = friction.state(), len(PATCH.points)
    moved = 1e-4 * np.sin(np.arange(2 * count))

    def solved(guess: np.ndarray) -> np.ndarray:
        friction.set_state(kept | {"horizontal": guess, "horizontal_before": guess})
        given = PATCH.gap - 1e-4, None, PATCH.force, moved
        return friction.solve(solver, *given)[1]

    exact = solved(np.zeros((count, 2)))
    for _ in range(3):  # each begins where the last one ended
        exact = solved(exact)
    largest = np.abs(exact).max()
    assert largest > 1.0
    found = solved(exact * (1 + off))
    assert np.abs(found - exact).max() < 1e-8 * largest


def test_answer_is_the_same_from_any_start() -> None:
    """A step solved from a random guess ends where the warm start ended."""
    rng = np.random.default_rng(2)
    a = 12
    factor = rng.standard_normal((2 * a, 2 * a))
    matrix = factor @ factor.T / a + 0.2 * np.eye(2 * a)
    constant, bound = rng.standard_normal((a, 2)), rng.random(a)
    compliance = PlaneCompliance(matrix)
    first = stick_slip(compliance, constant, bound, np.zeros((a, 2)))
    second = stick_slip(compliance, constant, bound, 10 * rng.standard_normal((a, 2)))
    assert np.allclose(first, second, atol=1e-8)
    rate = (matrix @ first.T.ravel()).reshape(2, -1).T + constant
    slips = np.linalg.norm(first, axis=1) > bound * (1 - 1e-9)
    assert 0 < slips.sum() < a
    assert np.abs(rate[~slips]).max() < 1e-8
    cross = rate[slips, 0] * first[slips, 1] - rate[slips, 1] * first[slips, 0]
    assert np.abs(cross).max() < 1e-8
    assert ((rate[slips] * first[slips]).sum(axis=1) <= 1e-9).all()


def test_cattaneo_mindlin() -> None:
    """Sphere on a half-space, nu = 0: pushed sideways, the sticking middle shrinks to (1 - Q/mu P)^(1/3)."""
    radius, shear, friction, n = 1.0, 1.0, 0.5, 21
    pitch = 2.1 * radius / n
    i = (np.arange(n) - n // 2) * pitch
    x, y = (v.ravel() for v in np.meshgrid(i, i))
    pressure = np.sqrt(np.maximum(1 - x**2 - y**2, 0.0))
    on = pressure > 0
    x, y, normal = x[on], y[on], pressure[on] * pitch**2
    potential = rectangle_potential(
        x[:, None] - x, y[:, None] - y, np.float64(pitch / 2), np.float64(pitch / 2)
    )
    matrix = np.kron(np.eye(2), potential / (2 * np.pi * shear * pitch**2))
    total = normal.sum()
    for share in (0.3, 0.7):
        shift = 3 * friction * total / (8 * radius * shear) * (1 - (1 - share) ** (2 / 3))
        constant = np.tile([-shift, 0.0], (len(x), 1))
        force = stick_slip(
            PlaneCompliance(matrix), constant, friction * normal, np.zeros((len(x), 2))
        )
        assert force[:, 0].sum() == pytest.approx(share * friction * total, rel=0.01)
        sticks = np.linalg.norm(force, axis=1) < friction * normal * (1 - 1e-6)
        stick_radius = np.sqrt(sticks.sum() * pitch**2 / np.pi)
        assert stick_radius == pytest.approx((1 - share) ** (1 / 3), abs=0.03)


def test_friction_beyond_any_answer_is_refused() -> None:
    """Pushed forward, the tire lifts off by a hundred times that, and then is pushed no more: after 40 steps that lag."""
    tire = Rigid(len(PATCH.points))
    c = len(PATCH.points)
    tire.same_step[:c, c : 2 * c] = 100 * np.diag(TREAD.diagonal())
    with pytest.raises(ConvergenceError, match="lower contact.friction"):
        run(BrushLaw(3e7, 2.0, (0.1, 0.0)), 50, tire=tire)


def test_a_step_without_an_answer_is_split() -> None:
    """f = 1 N - 5 t with |t| = f: lifted by t > 0 the point bears 1/6 N, wedged by t < 0 no f fits; then it bears 1 N, as
    with the t = 0 of before, and friction follows."""
    tire = 1e-6 * np.array([[1.0, 5.0, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    one = np.zeros(1)
    for pushed, bears, lagging in ((-1e-4, 1 / 6, 0), (1e-4, 1.0, 1)):
        brush = Brush(BrushLaw(1e9, 1.0, kind="spring"), one, np.zeros(1, int), 10.0, 1e-4)
        brush.begin(np.ones(1, bool))
        friction, solver = BrushFriction(brush, tire, None), ActiveSet(tire[:1, :1])
        force, t = friction.solve(solver, one - 1e-6, None, one, np.array([pushed, 0.0]))
        assert force[0] == pytest.approx(bears, rel=1e-3)
        assert abs(t[0, 0]) == pytest.approx(force[0], rel=1e-3)
        assert friction.lagging == lagging
        again = BrushFriction(brush, tire, None)
        again.set_state(friction.state())
        assert again.lagging == lagging


def test_a_point_that_its_own_bristle_lifts_off_bears_nothing() -> None:
    """Without a friction coefficient: touching it would bear a force that lifts it, apart it would touch."""
    tire = 1e-6 * np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]])
    one = np.zeros(1)
    for pushed, bears in ((-4e-6, False), (4e-6, True)):
        brush = Brush(BrushLaw(1e6, kind="spring"), one, np.zeros(1, int), 10.0, 1e-4)
        brush.begin(np.ones(1, bool))
        friction, solver = BrushFriction(brush, tire, None), ActiveSet(tire[:1, :1])
        force, t = friction.solve(solver, one - 1e-8, None, one, np.array([pushed, 0.0]))
        assert force[0] == pytest.approx(0.01 - (0.3 * t[0, 0] if bears else 0.0))
        assert (t[0, 0] != 0) == bears


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("iterative", [False, True])
@pytest.mark.parametrize("pulse", [False, True])
def test_a_loop_goes_on_with_the_same_bits(iterative: bool, pulse: bool) -> None:
    """Stopped after 40 steps and taken up by new objects: as if nothing had happened."""
    count, steps = len(PATCH.points), 80
    drive = Drive(wavy, lambda t: 0.0, 20.0)
    response = RollingStrip(speed=20.0).horizontal_response(PATCH.points, 3, 2, 1e3)
    response = replace(response, residual=1e-8 * np.eye(3 * count), pulse=3 * count * pulse)

    def loop() -> Loop:
        tire = Recursion(response=response, step=STEP, scheme="linear", comm=MPI.COMM_WORLD)
        matrix = tire.same_step[:count, :count] + TREAD
        solver = ProjectedCG(MatrixCompliance(matrix)) if iterative else ActiveSet(matrix)
        brush = Brush(BrushLaw(1e5, 0.5, (0.02, 0.0)), PATCH.points[:, 0], PATCH.line, 20.0, STEP)
        brush.begin(PATCH.force > 0)
        friction = BrushFriction(brush, tire.same_step, None)
        return Loop(tire, ContactProblem(PATCH, tire.same_step, solver, friction))

    def go(loop: Loop, until: int, done: int = 0) -> list:
        blocks = loop.roll(drive, STEP, until, done=done)
        return [instant for block in blocks for instant in block.instants()]

    unbroken = go(loop(), steps)
    first, second = loop(), loop()
    go(first, 40)
    second.restore({name: np.array(value) for name, value in first.snapshot().items()})
    for one, other in zip(unbroken[40:], go(second, steps, 40), strict=True):
        assert one.time == other.time
        assert np.array_equal(one.force, other.force)
        assert np.array_equal(one.horizontal, other.horizontal)
        assert np.array_equal(one.axle_force, other.axle_force)
