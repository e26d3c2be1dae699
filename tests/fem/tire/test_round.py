"""Inflation from the round shape of one section: the state of the whole ring, found at once."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.errors import LoadingStopped
from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.symmetric import AxisymmetricEquilibrium
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import compound

PRESSURE = 1.5e5
ROLLING = Rolling(speed=60.0)


@pytest.fixture
def belted(make_body):
    """Soft, with a ply and a single belt at 20 degrees: nothing balances its twist."""
    soft = compound("neo-hookean", 1100.0, youngs_modulus=5e6, poisson_ratio=0.49)
    plies = (
        PlyLine("ply", (-np.radians(120), np.radians(120)), 0.0),
        PlyLine("belt", (-0.8, 0.8), 1.0),
    )
    cords = (
        Cords(
            name="ply",
            angle=np.pi / 2,
            youngs_modulus=5e9,
            area=4e-7,
            spacing=1e-3,
            compression=0.1,
        ),
        Cords(name="belt", angle=np.radians(20), youngs_modulus=100e9, area=2e-7, spacing=1e-3),
    )

    def make(comm=MPI.COMM_SELF, **more):
        return make_body(segments=12, material=soft, plies=plies, cords=cords, comm=comm, **more)

    return make


def _loader(body) -> LoadStepper:
    return LoadStepper(Equilibrium(body, ROLLING), lambda progress: None)


@pytest.mark.slow
def test_the_round_start_leaves_the_whole_ring_nothing_to_look_for(belted):
    """The same state as by load steps of the whole ring, which twists, with one or two tangents of it."""
    at_once, by_steps = _loader(belted()), _loader(belted())
    at_once.inflate(PRESSURE)
    by_steps._inflate_in_steps(PRESSURE)
    assert at_once.newton_steps <= 2 < by_steps.newton_steps
    found, wanted = at_once.body.displacement(), by_steps.body.displacement()
    np.testing.assert_allclose(found, wanted, atol=1e-9 * abs(wanted).max())
    lattice = at_once.body.lattice
    lowest = lattice.face.reshape(lattice.face_shape)[0]  # along x there: the twist
    assert abs(wanted[lowest, 0]).max() > 0.01 * abs(wanted).max()


@pytest.mark.slow
@pytest.mark.mpi
def test_any_number_of_processes_inflates_alike(belted):
    """The section is solved by one process, the ring by all."""
    alone, shared = _loader(belted()), _loader(belted(comm=MPI.COMM_WORLD))
    for loader in (alone, shared):
        loader.inflate(PRESSURE)
    wanted = alone.body.displacement()
    np.testing.assert_allclose(shared.body.displacement(), wanted, atol=1e-10 * abs(wanted).max())


@pytest.mark.slow
def test_a_rolling_tire_is_inflated_first_and_turned_then(belted):
    """From 0 at 150 rad/s steps of pressure stop at 0 Pa. The state is that to which states at one speed after the
    other lead."""
    body, told = belted(), []
    section = AxisymmetricEquilibrium(body, Rolling(speed=150.0))
    LoadStepper(section, lambda progress: told.append(progress.what))._inflate_in_steps(PRESSURE)
    assert sorted(told) == told and set(told) == {"inflation", "speed"}
    assert section.out_of_balance() < 1e-9 * section.force_scale
    wanted = np.zeros_like(section.body.u.x.array)
    for speed in (0.0, 60.0, 100.0, 125.0, 150.0):
        another = AxisymmetricEquilibrium(body, Rolling(speed=speed))
        another.body.u.x.array[:] = wanted
        assert LoadStepper(another, lambda progress: None)._begin(PRESSURE)
        wanted = another.body.u.x.array.copy()
    np.testing.assert_allclose(section.body.u.x.array, wanted, atol=1e-9 * abs(wanted).max())


@pytest.mark.slow
def test_a_speed_that_is_not_reached_is_told(belted):
    section = AxisymmetricEquilibrium(belted(), Rolling(speed=1500.0))
    with pytest.raises(LoadingStopped, match=r"speed stops at \d+.* rad/s of 1500 rad/s"):
        LoadStepper(section, lambda progress: None)._inflate_in_steps(PRESSURE)
