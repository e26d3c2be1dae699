"""Memory of one tire after the other."""

import ctypes
import weakref

import numpy as np
import pytest
from mpi4py import MPI

import tireroad
from tireroad.fem.collective import collect
from tireroad.fem.matrices.operators import ROTATION
from tireroad.fem.model import SmallMotions
from tireroad.fem.static.checkpoint import Journal
from tireroad.fem.static.equilibrium import Equilibrium, SolutionHistory
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.road import FLAT
from tireroad.fem.static.virtual_work import AT_REST


class _Heap(ctypes.Structure):
    """glibc's struct mallinfo2: `mapped` and `used` bytes are those that somebody holds."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in [
            "arena",
            "free",
            "fast",
            "maps",
            "mapped",
            "most",
            "fast_free",
            "used",
            "unused",
            "top",
        ]
    ]


_heap = getattr(ctypes.CDLL(None), "mallinfo2", None)


def _memory() -> float:
    """Allocated and not freed, MB. Resident memory is no measure: what others left in pieces is filled first."""
    _heap.restype = _Heap
    found = _heap()
    return (found.used + found.mapped) / 1e6


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.skipif(_heap is None, reason="not glibc 2.33 or later")
def test_a_tire_that_is_let_go_takes_its_matrices_with_it() -> None:
    """Static state and matrices of one: 45 MB on one process. Another must not add a fortieth of one."""

    def one() -> None:
        tire = tireroad.torus(youngs_modulus=48e6, segments=12, elements_arc=6, order=2)
        static = tireroad.press(tire, inflation=2e5, deflection=0.002)
        rotation = SmallMotions(tire, static).operators.rotation()
        for name in ROTATION:
            getattr(rotation, name)

    seen = []
    for _ in range(6):
        one()
        collect(MPI.COMM_WORLD)
        seen.append(_memory())
    # The median: tables of Python and buffers of MPI double now and then, 2 MB at once.
    assert np.median(np.diff(seen)) < 1.0 / MPI.COMM_WORLD.size, seen


def test_a_record_of_solutions_keeps_no_solved_problem(make_body) -> None:
    """Matrices and factors of every wheel speed tried stayed: twice the memory estimated."""
    body, history = make_body(), SolutionHistory(Journal())
    first, second = (Equilibrium(body, AT_REST, FLAT) for _ in range(2))
    for problem in [first, second]:
        problem.history = history
        LoadStepper(problem, lambda progress: None).inflate(1e5)
    one, other = weakref.ref(first), weakref.ref(second)
    del first
    collect(body.comm)
    assert one() is None and other() is not None
    assert history._number(second) == 1
