"""The time loop with a made-up tire: rest, orders of convergence, energy, processes, refusals."""

import tracemalloc

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import Drive, roll
from tireroad.contact.results.energy import Work
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import Convolution, Recursion
from tireroad.tests.validation.cases import RollingStrip, oval_patch

PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
TREAD = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
STRIP = RollingStrip(speed=20.0)


def shaken(t: float) -> float:
    return 4e-4 * (1 - np.cos(2 * np.pi * 60.0 * t))


def wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 5e-4 * np.minimum(x / 0.3, 1.0) ** 3 * np.sin(2 * np.pi * x / 0.25 + 10 * y) * (x > 0)


def run(response, step, steps, scheme, height=None, motion=shaken, speed=20.0, comm=MPI.COMM_SELF):
    tire = (
        Convolution(response=response, step=step, steps=steps)
        if scheme == "convolution"
        else Recursion(response=response, step=step, scheme=scheme, comm=comm)
    )
    solver = ActiveSet(tire.same_step + TREAD)
    drive = Drive(height or Flat().height, motion, speed)
    return list(roll(tire, solver, PATCH, drive, step, steps)), tire, solver


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant", "convolution"])
@pytest.mark.parametrize("speed", [0.0, 30.0])
def test_flat_road_at_rest_stays_at_rest_bit_for_bit(scheme: str, speed: float) -> None:
    response = RollingStrip(speed=speed).response(PATCH.points, 6, 3, residual=4)
    instants, _, solver = run(response, 1e-4, 200, scheme, motion=lambda t: 0.0, speed=speed)
    for instant in instants:
        assert np.array_equal(instant.force, PATCH.force)
        assert np.array_equal(instant.gap, PATCH.gap)
        assert not instant.displacement.any()
    assert solver.factorisations == 1


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "order"), [("linear", 2.0), ("damped", 2.0), ("constant", 1.0)])
def test_order_of_convergence_with_residual(scheme: str, order: float) -> None:
    response = STRIP.response(PATCH.points, 5, 2, residual=6)
    duration = 0.01

    def forces(steps: int, scheme: str) -> np.ndarray:
        instants, _, _ = run(response, duration / steps, steps, scheme, height=wavy)
        every = steps // 25
        return np.stack([i.force for i in instants[every - 1 :: every]])

    exact = forces(6400, "linear")
    errors = [
        np.linalg.norm(forces(n, scheme) - exact) / np.linalg.norm(exact - PATCH.force)
        for n in (100, 200, 400)
    ]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(rates - order) < 0.25), (errors, rates)
    assert errors[-1] < (1e-3 if order == 2 else 5e-2)


def test_convolution_agrees() -> None:
    response = STRIP.response(PATCH.points, 5, 2, residual=6)
    duration, differences = 0.008, []
    for steps in (200, 400):
        one, _, _ = run(response, duration / steps, steps, "linear")
        other, _, _ = run(response, duration / steps, steps, "convolution")
        change = np.stack([a.force - b.force for a, b in zip(one, other, strict=True)])
        differences.append(np.abs(change).max() / PATCH.force.max())
        axle = np.stack([a.axle_force - b.axle_force for a, b in zip(one, other, strict=True)])
    assert differences[1] < 0.02
    assert differences[1] < 0.6 * differences[0]
    assert np.abs(axle).max() < 0.05 * PATCH.force.sum()


def test_constant_scheme_never_gains_energy_undamped() -> None:
    """Thrown up by a short rise of the road and left alone: waves, jumps and landings.

    Waves |z|^2/m, springs (residual and tread), the load's height f_s . g: each step changes their
    sum by -f . g(before) or less.
    """
    strip = RollingStrip(damping=0.0)
    response = strip.response(PATCH.points, 4, 2, residual=6)
    step = 2e-4
    tire = Recursion(response=response, step=step, scheme="constant", comm=MPI.COMM_SELF)
    solver = ActiveSet(tire.same_step + TREAD)

    def blow(t: float) -> float:
        return 2e-2 if t < 2.5 * step else 0.0

    energies, active = [], []
    for instant in roll(tire, solver, PATCH, Drive(Flat().height, blow, 0.0), step, 3000):
        change = instant.force - PATCH.force
        waves = float((np.abs(tire.state) ** 2).sum()) / strip.mass
        springs = 0.5 * change @ (response.residual + TREAD) @ change
        energies.append(waves + springs + PATCH.force @ instant.gap)
        active.append(instant.active)
    left = np.array(energies[3:])
    assert 0 in active and max(active[1500:]) > 0
    assert left[0] > 0.05
    assert np.diff(left).max() < 1e-12 * left[0]
    assert 0 < left[-1] < left[0]


def test_road_heights_do_not_depend_on_where_a_loop_goes_on() -> None:
    asked = []

    def height(x, y):
        asked.append(np.shape(x))
        return wavy(x, y)

    response = STRIP.response(PATCH.points, 3, 2)
    whole, _, _ = run(response, 1e-4, 100, "linear", height=height)
    assert len(asked) < 100 / 5 and all(shape[1] == len(PATCH.points) for shape in asked)
    drive = Drive(height, lambda t: 0.0, 20.0)
    for done in (0, 37, 99):
        roads = [
            (time, road.known)
            for times, met in drive.roads(PATCH, 1e-4, 100, done, moving=False)
            for time, road in zip(times.tolist(), met, strict=True)
        ]
        assert [time for time, _ in roads] == [i.time for i in whole[done:]]
        for (time, road), alone in zip(roads, whole[done:], strict=True):
            here = wavy(PATCH.points[:, 0] + 20.0 * time, PATCH.points[:, 1])
            assert np.allclose(road, here, rtol=0, atol=1e-18) and alone.time == time


def test_motion_without_bound_is_refused() -> None:
    response = STRIP.response(PATCH.points, 3, 2)
    with pytest.raises(ConvergenceError, match="not finite"):
        run(response, 1e-4, 5, "linear", motion=lambda t: np.nan)


def test_edge_of_the_patch_is_reported() -> None:
    at_edge = np.tile(PATCH.force, (3, 1))
    times = np.array([0.25, 0.5, 0.75])
    PATCH.check_edge(at_edge, times, 1e-3)
    at_edge[1:, 0] = 1.0
    with pytest.raises(ConvergenceError, match="t = 0.5 s .*contact.reach"):
        PATCH.check_edge(at_edge, times, 1e-3)


@pytest.mark.mpi
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_same_answer_on_any_number_of_processes(scheme: str) -> None:
    response = STRIP.response(PATCH.points, 5, 3, residual=4)
    one, _, _ = run(response, 1e-4, 150, scheme, height=wavy)
    spread, _, _ = run(response, 1e-4, 150, scheme, height=wavy, comm=MPI.COMM_WORLD)
    for a, b in zip(one, spread, strict=True):
        assert np.abs(a.force - b.force).max() < 1e-10 * PATCH.force.max()
        assert np.abs(a.axle_force - b.axle_force).max() < 1e-10 * PATCH.force.sum()


def test_axle_carries_the_contact_force_in_the_end() -> None:
    """A held change of load: when all has died down, the axle feels what the road gives."""
    response = RollingStrip(damping=400.0).response(PATCH.points, 5, 3, residual=4)

    def raised(t: float) -> float:
        return 5e-4 * min(t / 0.02, 1.0)

    last = run(response, 2e-4, 1000, "linear", motion=raised, speed=0.0)[0][-1]
    assert last.force.sum() > 1.02 * PATCH.force.sum()
    assert last.axle_force[2] == pytest.approx(last.force.sum(), rel=1e-6)


def test_work_of_contact_is_the_energy_of_an_undamped_tire() -> None:
    """Waves and residual springs hold what the road put in, to second order in the step."""
    strip = RollingStrip(damping=0.0)
    response = strip.response(PATCH.points, 4, 2, residual=6)
    errors = []
    for steps in (200, 400):
        work = Work()
        instants, tire, _ = run(response, 0.02 / steps, steps, "linear", speed=0.0)
        loads, places = (np.array([getattr(i, n) for i in instants]) for n in ("change", "moved"))
        work.add(loads, places)
        blocked = Work()
        for first in range(0, steps, 7):
            blocked.add(loads[first : first + 7], places[first : first + 7])
        assert blocked.total == work.total
        change = instants[-1].change
        held = (np.abs(tire.state) ** 2).sum() / strip.mass
        held += 0.5 * change @ response.residual @ change
        errors.append(abs(work.total - held) / max(i.change @ i.moved for i in instants))
    assert errors[1] < 1e-3
    assert errors[1] < 0.35 * errors[0]


def test_the_work_of_a_block_takes_little_memory() -> None:
    """Arrays of the whole block took four times what the block itself takes."""
    change, moved = np.ones((512, 2000)), np.ones((512, 2000))
    tracemalloc.start()
    try:
        Work().add(change, moved)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 0.7 * (change.nbytes + moved.nbytes)
