"""The energy of a rolling tire under given forces: every term known, and what does not add up is the steps'."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.results.energy import StateMotion, Work, energy_left, springs
from tireroad.fem.wheel import Turning
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import couple
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.rolling import RollingModes, rolling_modes

M, POINTS, DURATION = 8, 3, 0.05


def rolling(speed: float = 40.0, damping=(60.0, 1e-5)) -> RollingModes:
    """Random modes from 80 to 600 rad/s whose matrices have the symmetries of a tire's."""
    rng = np.random.default_rng(3)
    skew = [a - a.T for a in rng.normal(size=(2, M, M)) / M]
    root = rng.normal(size=(M, M)) / M
    projection = Projection(
        squares=np.linspace(80.0, 600.0, M) ** 2,
        momentum=rng.normal(size=(3, M)),
        gyroscopic=skew[0],
        convective=-root @ root.T,
        body=4 * skew[1],
        body_convective=-root @ root.T,
    )
    basis = ModalBasis(
        frequency=np.sqrt(projection.squares) / (2 * np.pi),
        shape=rng.normal(size=(POINTS, M)),
        projection=projection,
    )
    return rolling_modes(basis, Turning(speed=speed, damping=damping), MPI.COMM_SELF)


def terms(tire: RollingModes, steps: int, comm=MPI.COMM_SELF, counted: RollingModes | None = None):
    """(work, drive, energy left, lost) of three forces that sweep and stop; losses as `counted` has them."""
    shape = tire.basis.shape
    springs_of = 0.2 * shape @ np.linalg.solve(np.diag(tire.basis.projection.squares), shape.T)
    response = couple(tire.states, shape, shape, tire.basis.projection.momentum)
    response = replace(response, residual=springs_of)
    step = DURATION / steps
    march, work = Recursion(response=response, step=step, scheme="linear", comm=comm), Work()
    motion = StateMotion(counted or tire, response.slow(step), step)
    time = step * np.arange(1, steps + 1)[:, None]
    force = (
        np.sin(np.array([90.0, 250.0, 400.0]) * time + np.array([0.0, 1.0, 2.0])) * time / DURATION
    )
    march.keep_samples()
    moved = []
    for f in force:
        free = march.predict()
        march.advance(f)
        moved.append(free + march.same_step @ f)
    work.add(force, np.array(moved))
    states, pushes, _, block = zip(*march.samples(), strict=True)
    everywhere = (
        march.everywhere(states),
        march.everywhere(pushes),
        march.block_everywhere(block),
    )
    for block in range(0, steps, 37):
        motion.add(*(part[block : block + 37] for part in everywhere))
    kept = march.snapshot()
    left = energy_left(tire, kept, response.slow(step)) + springs(response, force[-1])
    return work.total, motion.losses.drive, left, motion.losses.lost


def off(found) -> float:
    work, drive, left, lost = found
    return abs(work + drive - left - lost) / max(abs(x) for x in found)


def test_work_and_drive_are_what_is_left_and_lost() -> None:
    """Second order in the step; the drive's part is not small."""
    tire = rolling()
    coarse, fine = (terms(tire, steps) for steps in (400, 800))
    assert off(fine) < 1e-3
    assert off(fine) < 0.35 * off(coarse)
    assert abs(fine[1]) > 0.02 * fine[3] > 0


@pytest.mark.parametrize("wrong", [{"damping": (90.0, 1e-5)}, {"speed": -0.0}])
def test_the_balance_fails_where_a_term_is_wrong(wrong) -> None:
    """Half as much damping again, or a drive that is left out: the sum says so."""
    tire, other = rolling(), rolling(**wrong)
    counted = RollingModes(basis=tire.basis, states=tire.states, turning=other.turning)
    assert off(terms(tire, 800, counted=counted)) > 0.01


def test_standing_nothing_is_driven() -> None:
    _, drive, _, lost = terms(rolling(speed=0.0), 400)
    assert drive == 0.0 and lost > 0.0


@pytest.mark.mpi
def test_the_same_on_any_number_of_processes() -> None:
    tire = rolling()
    alone, shared = terms(tire, 200), terms(tire, 200, MPI.COMM_WORLD)
    np.testing.assert_allclose(shared, alone, rtol=1e-9)


def test_readings_beside_the_forces_hold_no_energy() -> None:
    """Three forces, five outputs of which the first three are the forces' own."""
    tire = rolling()
    shape, more = tire.basis.shape, np.ones((2, M))
    response = couple(tire.states, np.vstack([shape, more]), shape, tire.basis.projection.momentum)
    residual = np.vstack([np.diag([1e-6, 2e-6, 3e-6]), np.full((2, 3), 5.0)])
    force = np.array([10.0, 20.0, 30.0])
    assert springs(replace(response, residual=residual), force) == pytest.approx(1.8e-3)
