"""The estimated error of the load against that to a much finer mesh."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_error import load_error
from tireroad.fem.static.loading import Loader
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Torus
from tireroad.fem.tire.wall import Region

RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)


def pressed(segments, arc, rolling=AT_REST, comm=MPI.COMM_SELF, order=2, regions=()) -> Loader:
    section = Torus(0.32, 0.1, 0.012, np.radians(120), segments, arc, 1, order, footprint_size=0.25)
    loader = Loader(Equilibrium(Body(comm, section, RUBBER, regions), rolling), lambda _: None)
    loader.inflate(2e5)
    loader.deflect(0.004)
    return loader


@pytest.fixture(scope="module")
def exact():
    """A loader of 32,000 unknowns."""
    return pressed(24, 12, order=3)


@pytest.mark.parametrize(("segments", "arc"), [(16, 8), (20, 8)])
def test_the_estimate_is_of_the_size_of_the_error(exact, segments, arc):
    """Not from 24 x 8 on: there the error changes its sign as nodes reach the road, -1 % at 24 x 10."""
    loader = pressed(segments, arc)
    true = abs(loader.load() / exact.load() - 1)
    assert 0.7 * true < load_error(loader, AT_REST).relative < 4 * true


def test_a_fine_mesh_has_a_small_estimate_for_little(exact):
    found = load_error(exact, AT_REST)
    assert found.relative < 0.005
    assert found.unknowns < 0.27 * 3 * exact.body.lattice.size


def test_the_tire_is_left_as_it_was_and_the_companion_rolls_too():
    rolling = Rolling(60.0, 500.0)
    loader = pressed(20, 8, rolling)
    before = loader.body.u.x.array.copy()
    found = load_error(loader, rolling)
    assert np.array_equal(loader.body.u.x.array, before)
    assert found.load == pytest.approx(pressed(10, 4, rolling).load(), rel=1e-8)


def test_it_says_why_there_is_none():
    assert "too coarse" in load_error(pressed(8, 4), AT_REST)


def test_a_thin_region_is_in_the_companion_too():
    soft = compound("neo-hookean", 1200.0, youngs_modulus=5e6, poisson_ratio=0.45)
    thin = [Region(soft, tuple(np.radians([105.0, 120.0])))]
    found = load_error(pressed(16, 8, regions=thin), AT_REST)
    assert found.load == pytest.approx(pressed(8, 4, regions=thin).load(), rel=1e-8)


@pytest.mark.mpi
def test_the_same_estimate_on_any_number_of_processes():
    alone, shared = (
        load_error(pressed(16, 8, comm=c), AT_REST) for c in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert shared.relative == pytest.approx(alone.relative, rel=1e-6)
