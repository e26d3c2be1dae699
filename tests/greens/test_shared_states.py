"""The recursion taken by several processes: the states spread over them, those of a process that looks ahead."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from mpi4py import MPI
from systems import make
from test_recursion import STEPS, march, some_force

from tireroad.contact.loop import RootSolve, Solved
from tireroad.greens import recursion
from tireroad.greens.recursion import Recursion, loop_communicator


@pytest.mark.mpi
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_the_same_on_any_number_of_processes(scheme) -> None:
    system = make(m=11)
    force = some_force(4)
    response = system.response()
    alone, spread = (
        Recursion(response=response, step=1e-3, scheme=scheme, comm=c)
        for c in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    one, all_of_them = march(alone, force), march(spread, force)
    assert np.abs(one - all_of_them).max() < 1e-12 * np.abs(one).max()
    assert np.abs(alone.inertia_force() - spread.inertia_force()).max() < 1e-10


def choose(solved: Solved, free: np.ndarray) -> Solved:
    """The same whatever the tire does."""
    return solved


@pytest.mark.mpi
@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_looking_ahead_changes_nothing(scheme) -> None:
    """The root has no states, and the others find the next outputs before they know the force; gone on with from a
    checkpoint it has the same bits."""
    random, system = np.random.default_rng(3), make(m=11, speed=60.0)
    whole = system.shape @ np.linalg.solve(system.stiffness, system.shape.T) + np.eye(4) * 1e-4
    response = replace(
        system.response(compliance=whole),
        block=np.array([[0.0, 1.0], [-1600.0, -80.0]]),
        block_output=random.normal(size=(4, 2)),
        block_input=random.normal(size=(2, 4)),
        block_momentum=random.normal(size=(3, 2)),
        pulse=4,
    )
    force, found, rates = some_force(4), [], []
    for comm, stops in ((MPI.COMM_SELF, True), (MPI.COMM_WORLD, True), (MPI.COMM_WORLD, False)):
        made = partial(
            Recursion, response=response, step=1e-3, scheme=scheme, comm=comm, look_ahead=True
        )
        tire = made()
        tire.start(force[0])
        for k, new in enumerate(force[1:]):
            solved = Solved(new, new, np.zeros((0, 2)), 0.0, 0.0)
            together = RootSolve(comm, len(new), tire.ahead)
            free, _ = together(tire.predict, partial(choose, solved), False, False)
            tire.advance(new)
            found.append(free + tire.same_step @ new)
            rates.append(tire.inertia_force())
            if stops and k == STEPS // 2:
                kept = tire.snapshot()
                tire = made()
                tire.restore(kept)
        tire.keep_samples()
        RootSolve(comm, len(new), tire.ahead)(tire.predict, partial(choose, solved), False, False)
        tire.advance(force[0])
        assert comm.size == 1 or comm.rank or all(len(state) == 0 for state, *_ in tire.samples())
    for values in (found, rates):
        alone, stopped, spread = np.split(np.array(values), 3)
        assert np.abs(alone - spread).max() < 1e-12 * np.abs(alone).max()
        assert np.array_equal(stopped, spread)


@pytest.mark.mpi
def test_a_small_loop_is_not_shared_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each process takes all of it, and a large one its part: the same motion, the same states at a checkpoint."""
    response, force = make(speed=60.0).response(), some_force(4)
    assert loop_communicator(response, MPI.COMM_WORLD).size == 1
    monkeypatch.setattr(recursion, "SHARED_FROM", 0.0)
    found = []
    for comm in (MPI.COMM_SELF, loop_communicator(response, MPI.COMM_WORLD)):
        tire = Recursion(response=response, step=1e-3, scheme="linear", comm=comm)
        tire.keep_samples()
        moved, states = march(tire, force), [state for state, *_ in tire.samples()]
        found.append((moved, tire.snapshot()["state"], tire.everywhere(states)))
    assert comm.size == MPI.COMM_WORLD.size
    for alone, shared in zip(*found, strict=True):
        np.testing.assert_allclose(shared, alone, atol=1e-12 * np.abs(alone).max())
    assert np.array_equal(found[1][2][-1], found[1][1])


@pytest.mark.mpi
def test_processes_that_round_otherwise_do_not_share_a_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nodes of two kinds: each process would go on by its own rounding, and wait for messages that never come."""
    response = make(speed=60.0).response()
    monkeypatch.setattr(recursion, "SHARED_FROM", 0.0)
    assert loop_communicator(response, MPI.COMM_WORLD).size == MPI.COMM_WORLD.size
    monkeypatch.setattr(recursion, "_kernels", lambda: f"kernels of {MPI.COMM_WORLD.rank}")
    assert loop_communicator(response, MPI.COMM_WORLD).size == 1
