"""A fall against a drag ends in equilibrium, and leaves everything as it was where it does not."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static import restart
from tireroad.fem.static.equilibrium import Equilibrium, SolveOutcome
from tireroad.fem.static.load_steps import LoadStepper, Show, march
from tireroad.fem.tire.material import compound

SOFT = compound("neo-hookean", 1100.0, youngs_modulus=5e6, poisson_ratio=0.49)
DEEP = 0.03  # m


@pytest.fixture
def loader(make_body):
    body = make_body(segments=9, material=SOFT, comm=MPI.COMM_WORLD)
    loader = LoadStepper(Equilibrium(body), lambda _: None)
    loader.inflate(1.5e5)
    return loader


@pytest.mark.long
@pytest.mark.mpi
def test_falls_to_the_state_that_small_steps_find(loader):
    """One shape carries this load, and no drag is left in it."""
    problem, start = loader.equilibrium, loader.body.u.x.array.copy()
    fallen = restart.pseudo_transient(problem, loader.touch + DEEP)
    assert fallen.converged and problem.springs is None
    found, force = loader.body.u.x.array.copy(), problem.load()
    loader.body.u.x.array[:] = start
    problem.road.active[:], problem.road.force[:] = False, 0.0
    loader.deflect(DEEP)
    assert force == pytest.approx(problem.load(), rel=1e-9)
    size = np.abs(loader.body.u.x.array).max()
    np.testing.assert_allclose(found, loader.body.u.x.array, atol=1e-9 * size)


@pytest.mark.slow
@pytest.mark.mpi
def test_what_does_not_come_to_rest_is_put_back(loader, monkeypatch):
    problem = loader.equilibrium
    loader.deflect(0.005)
    before, force, height = loader.body.u.x.array.copy(), problem.load(), problem.road_height
    monkeypatch.setattr(restart, "_MOST_FALLS", 3)
    fallen = restart.pseudo_transient(problem, loader.touch + DEEP)
    assert not fallen.converged and "pseudo-transient continuation" in fallen.reason
    assert problem.springs is None and problem.road_height == problem.road.height == height
    assert problem.load() == force
    np.testing.assert_array_equal(loader.body.u.x.array, before)
    assert problem.solve(height).iterations == 0


def test_a_march_falls_where_small_steps_fail_and_goes_on_by_steps():
    """Nothing is near between 0.4 and 0.5: three failures, one fall, and steps again."""
    asked, fallen = [], []

    def attempt(target):
        asked.append(target)
        good = target < 0.4 or bool(fallen)
        return SolveOutcome(good, 3, 0.0, "converged" if good else "circles")

    def fall(target):
        fallen.append(target)
        return SolveOutcome(True, 20, 0.0, "snapped through")

    march(attempt, 1.0, 0.3, Show("deflection", 1.0, "m"), rescue=fall)
    assert len(fallen) == 1 and 0.4 <= fallen[0] < 0.5
    assert asked[-1] == 1.0 and max(asked[: asked.index(fallen[0])]) >= 0.4


def test_a_march_goes_either_way():
    """A road below the first touch: steps lead down to it, not up through the tire."""
    asked = []

    def attempt(target):
        asked.append(target)
        return SolveOutcome(True, 30, 0.0, "converged")

    march(attempt, -1.0, 0.3, Show("deflection", 1.0, "m"))
    assert asked == pytest.approx([-0.3, -0.6, -0.9, -1.0])


@pytest.mark.slow
@pytest.mark.mpi
def test_a_load_that_is_not_met_leaves_the_road_where_it_was(loader):
    """In load control the road's height is an unknown too."""
    problem = loader.equilibrium
    loader.deflect(0.005)
    before, height = loader.body.u.x.array.copy(), problem.road.height
    assert not problem.solve(height, load=1e7).converged
    assert problem.road.height == problem.road_height == height
    np.testing.assert_array_equal(loader.body.u.x.array, before)
    assert problem.solve(height).iterations == 0
