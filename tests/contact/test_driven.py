"""Prescribed forces in the contact loop: an oscillator that rests on a spring."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import Drive, DrivenTire, roll
from tireroad.contact.patch import Patch
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response

MASS, STIFFNESS, TREAD, FORCE = 2.0, 3e4, 5e-5, 8.0
STEP, STEPS = 2e-5, 2000
POINT = Patch(
    index=np.array([0]),
    points=np.zeros((1, 3)),
    half_sizes=np.full((1, 2), 0.01),
    force=np.array([50.0]),
    gap=np.zeros(1),
    edge=np.zeros(1, bool),
    line=np.zeros(1, int),
)


def oscillator() -> Response:
    """Inputs: contact, prescribed; outputs: contact, along the prescribed force, reading.

    Beside its own state seven that move nothing: NumPy rounds products of complex arrays of less than 64 bytes by how far
    apart they happen to lie (with or without AVX-512), so that one state has no bits to go on with.
    """
    own = np.sqrt(STIFFNESS / MASS)
    shape = np.zeros((3, 8), complex)
    shape[:, 0] = 1 / np.sqrt(MASS)
    none = np.zeros((0, 0))
    push = -1j / own * shape[:2].T
    carried = np.zeros((3, 8))
    carried[2, 0] = np.sqrt(MASS)
    return Response(
        eigenvalue=1j * own * np.arange(1, 9),
        output=shape,
        input=push,
        block=none,
        block_output=np.zeros((3, 0)),
        block_input=np.zeros((0, 2)),
        residual=np.zeros((3, 2)),
        momentum=carried.astype(complex),
        block_momentum=np.zeros((3, 0)),
    )


def driven(steps: int = STEPS) -> DrivenTire:
    tire = Recursion(response=oscillator(), step=STEP, scheme="linear", comm=MPI.COMM_SELF)
    return DrivenTire(tire, np.full((steps + 1, 1), FORCE), np.array([[0.0, 0.0, 1.0]]))


def rolled(tire: DrivenTire, steps: int, done: int = 0):
    solver = ActiveSet(tire.same_step + TREAD)
    drive = Drive(Flat().height, lambda t: 0.0, 0.0)
    for instant in roll(tire, solver, POINT, drive, STEP, steps, done=done):
        yield instant, tire.reading, tire.work


def test_a_force_on_a_tire_in_contact_is_the_oscillator_on_both_springs() -> None:
    """u = F/(k + 1/C)(1 - cos w t), w^2 = (k + 1/C)/m: second order in the step."""
    stiff = STIFFNESS + 1 / TREAD
    own = np.sqrt(stiff / MASS)
    for instant, reading, work in rolled(driven(), STEPS):
        u = FORCE / stiff * (1 - np.cos(own * instant.time))
        assert reading == pytest.approx([u], abs=2e-5 * FORCE / stiff)
        assert instant.displacement == pytest.approx([u], abs=2e-5 * FORCE / stiff)
        assert instant.force == pytest.approx(POINT.force - u / TREAD, abs=2e-5 * FORCE)
        assert instant.axle_force[2] == pytest.approx(POINT.force[0] + STIFFNESS * u, abs=1e-3)
        assert work == pytest.approx(FORCE * u, abs=1e-5 * FORCE**2 / stiff)


def test_a_checkpoint_goes_on_with_the_same_bits() -> None:
    whole = [reading for _, reading, _ in rolled(driven(), 60)]
    first = driven()
    for _, _reading, _ in rolled(first, 30):
        pass
    again = driven()
    again.restore(first.snapshot())
    rest = [reading for _, reading, _ in rolled(again, 60, done=30)]
    assert np.array_equal(rest, whole[30:])
    assert again.work == pytest.approx(FORCE * whole[-1][0], rel=1e-12)
