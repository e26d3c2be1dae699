"""The estimated error of the load against a sequence that converges.

Soft torus, 0.2 MPa, road at z = -0.3184244 m, 4 mm above first touch: 30 x 14 elements of order 3,
those at the footprint cut in two once and twice, carry 531.50, 532.26, 532.59 N, so 532.8 N (0.1 %)
in the limit.
"""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.static import load_error as of_load
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.load_error import (
    ENOUGH,
    LoadError,
    at_finer_footprint,
    load_error,
    split_ring,
)
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Region
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import make_body
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
HEIGHT, CONVERGED = -0.3184244, 532.8  # m, N


def ring(segments, arc, order=2):
    return thesis_torus(segments=segments, elements_arc=arc, order=order, footprint_size=0.25)


def pressed(section, rolling=AT_REST, comm=MPI.COMM_SELF, regions=(), height=HEIGHT) -> LoadStepper:
    loader = LoadStepper(Equilibrium(Body(comm, section, RUBBER, regions), rolling), lambda _: None)
    loader.inflate(2e5)
    loader.deflect(height - loader.touch)
    return loader


@pytest.mark.long
@pytest.mark.parametrize(("segments", "arc", "order"), [(16, 8, 2), (24, 10, 2), (16, 6, 3)])
def test_the_estimate_lies_between_half_and_twice_the_error(segments, arc, order):
    loader = pressed(ring(segments, arc, order))
    true = abs(loader.load() / CONVERGED - 1)
    assert 0.5 * true < load_error(loader, AT_REST).relative < 2 * true


@pytest.mark.parametrize(
    ("footprint", "bulk", "known"),
    [(-0.024, 0.014, False), (-0.067, 0.078, False), (-0.010, 0.041, True), (0.021, 0.041, True)],
)
def test_a_sign_is_told_where_the_parts_do_not_cancel(footprint, bulk, known):
    """Measured on 24 x 10 and 16 x 8 elements, whose estimates had the wrong sign, 20 x 8 and 16 x 8, the right one."""
    extent = Footprint(0.06, 0.02, 1e-3)
    found = LoadError(500.0, abs(footprint + bulk), footprint, bulk, extent, 1)
    assert found.signed == known


@pytest.mark.long
def test_the_tire_is_left_as_it_was_and_the_companion_rolls_too():
    """A companion that takes over the state ends where one that was loaded from the beginning does."""
    rolling = Rolling(speed=60.0, damping=500.0)
    soft = compound("neo-hookean", 1200.0, youngs_modulus=5e6, poisson_ratio=0.45)
    thin = [Region(material=soft, arc=tuple(np.radians([105.0, 120.0])))]
    loader = pressed(ring(12, 6), rolling, regions=thin)
    before = loader.body.u.x.array.copy()
    found = load_error(loader, rolling)
    assert np.array_equal(loader.body.u.x.array, before)
    finer = loader.body.ring.section
    force = loader.body.surface(loader.equilibrium.contact_force()).reshape(24, -1)
    around = [force[(2 * i + np.arange(-2, 5)) % 24].any() for i in range(12)]
    wide = np.pad(force, ((0, 0), (2, 2))).any(axis=0)
    along = [wide[2 * j : 2 * j + 7].any() for j in range(len(finer.outer))]
    halved = split_ring(loader.body.ring, np.array(around), np.array(along))
    other = LoadStepper(
        Equilibrium(Body(MPI.COMM_SELF, halved, loader.body.materials), rolling), lambda _: None
    )
    other.inflate(2e5)
    other.deflect(HEIGHT - other.touch)
    assert found.footprint == pytest.approx(1 - other.load() / loader.load(), abs=2 * ENOUGH)
    extent = static_state(other.equilibrium, other.touch).footprint()
    assert found.extent.length == pytest.approx(extent.length, rel=0.01)
    assert found.extent.area == pytest.approx(extent.area, rel=0.02)


def test_half_the_ring_tells_what_the_whole_does(monkeypatch):
    """Load, traction and its reading are shared out between the halves and their cut faces."""
    loader = pressed(ring(12, 6))
    half = load_error(loader, AT_REST)
    monkeypatch.setattr(LoadStepper, "halved", None)
    monkeypatch.setattr(of_load, "looks_the_same", lambda ring, rolling: False)
    whole = load_error(loader, AT_REST)
    assert half.bulk == pytest.approx(whole.bulk, rel=1e-6)
    assert half.footprint == pytest.approx(whole.footprint, abs=2 * ENOUGH)
    assert half.extent.length == pytest.approx(whole.extent.length, rel=0.01)


def test_a_state_that_half_a_turn_changes_is_taken_whole():
    loader = pressed(ring(12, 6))
    given = of_load.Balance.of(loader, AT_REST)
    assert isinstance(given.near(given.ring), of_load.HalfModelEquilibrium)
    bent = given.displacement.copy()
    ahead = loader.body.lattice.points(np.arange(len(bent)))[:, 0] > 0
    bent[ahead, 0] += 1e-3 * loader.body.ring.thickness
    loader.body.set_displacement(bent)
    given = of_load.Balance.of(loader, AT_REST)
    assert not isinstance(given.near(given.ring), of_load.HalfModelEquilibrium)


@pytest.mark.long
def test_cords_between_whose_points_long_elements_are_strained(tmp_path, monkeypatch):
    """Radial tire of 16 x 12 elements: no start that is near for Newton's method; the companion is in balance all the
    same (as one that was loaded from the beginning is, to 2e-4 of the load), and what one step from such a state would
    tell of the rest is not told."""
    path = tmp_path / "radial.toml"
    path.write_text('[tire]\nsection = "radial"\n')
    tire = load(path, ["tire.segments=16", "tire.elements_arc=12"]).tire
    loader = LoadStepper(Equilibrium(make_body(MPI.COMM_SELF, tire, tire.ring())), lambda _: None)
    loader.inflate(2.2e5)
    loader.carry(4000.0)
    finer = at_finer_footprint(of_load.Balance.of(loader, AT_REST))
    monkeypatch.setattr(of_load, "at_finer_footprint", lambda _: finer)
    found = load_error(loader, AT_REST)
    assert finer.solved.solve(finer.height).converged  # to rounding
    assert found.footprint == pytest.approx(1 - finer.solved.load() / loader.load(), abs=2 * ENOUGH)
    assert found.bulk is None
    assert not found.signed


def test_it_says_why_there_is_none():
    loader = pressed(ring(8, 4), height=-0.3)
    loader.body.u.x.array[:] = 0.0
    loader.equilibrium.solve()
    assert "nothing touches" in load_error(loader, AT_REST)


@pytest.mark.long
@pytest.mark.mpi
def test_the_same_estimate_on_any_number_of_processes():
    alone, shared = (
        load_error(pressed(ring(12, 6), comm=c), AT_REST) for c in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert shared.relative == pytest.approx(alone.relative, rel=1e-6)
