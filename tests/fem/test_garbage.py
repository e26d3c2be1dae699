"""Memory of one tire after the other."""

import os

import pytest
from mpi4py import MPI

import tireroad
from tireroad.fem.garbage import collect
from tireroad.fem.model import SmallMotions


def _memory() -> float:
    """Resident, MB."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="no /proc to read memory from")
def test_a_tire_that_is_let_go_takes_its_matrices_with_it() -> None:
    """Static state and matrices of one: 45 MB on one process. Four more must not add a quarter of one."""

    def one() -> None:
        tire = tireroad.torus(youngs_modulus=48e6, segments=12, elements_arc=6, order=2)
        static = tireroad.press(tire, inflation=2e5, deflection=0.002)
        SmallMotions(tire, static).operators.rotation()

    seen = []
    for _ in range(6):
        one()
        collect(MPI.COMM_WORLD)
        seen.append(_memory())
    assert seen[-1] - seen[1] < 10.0 / MPI.COMM_WORLD.size, seen
