"""Inflation from the round shape of one section: the state of the whole ring, found at once."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.errors import LoadingStopped
from tireroad.fem.sections.grid import PlyLine
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.symmetric import AxisymmetricEquilibrium, inflated
from tireroad.fem.static.virtual_work import AT_REST, Rolling
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


def _inflate(section: AxisymmetricEquilibrium) -> None:
    LoadStepper(section, lambda progress: None)._inflate_in_steps(PRESSURE)


@pytest.mark.slow
def test_a_tire_that_does_not_inflate_while_it_turns_turns_when_it_is_inflated(belted):
    """Steps of pressure stop at 0 Pa at 150 rad/s; the state is that to which steps of the speed lead from rest."""
    body, tried = belted(), []

    def inflate(section: AxisymmetricEquilibrium) -> None:
        tried.append(section.rolling.speed)
        _inflate(section)

    found = inflated(body, Rolling(speed=150.0), inflate)
    assert tried == [150.0, 0.0, 150.0]
    assert found.out_of_balance() < 1e-9 * found.force_scale
    wanted = np.zeros_like(found.body.u.x.array)
    for speed in (0.0, 60.0, 100.0, 125.0, 150.0):
        section = AxisymmetricEquilibrium(body, Rolling(speed=speed))
        section.body.u.x.array[:] = wanted
        _inflate(section)
        wanted = section.body.u.x.array.copy()
    np.testing.assert_allclose(found.body.u.x.array, wanted, atol=1e-9 * abs(wanted).max())


@pytest.mark.parametrize(("rolling", "tried"), [(AT_REST, [0.0]), (ROLLING, [60.0, 0.0])])
def test_what_does_not_inflate_at_rest_is_an_error(belted, rolling, tried):
    speeds = []

    def stops(section: AxisymmetricEquilibrium) -> None:
        speeds.append(section.rolling.speed)
        raise LoadingStopped("static: stops")

    with pytest.raises(LoadingStopped):
        inflated(belted(), rolling, stops)
    assert speeds == tried
