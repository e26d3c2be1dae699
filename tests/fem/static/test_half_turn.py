"""The standing tire by half of its ring: the state of the whole, cords that break both mirror planes included."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.fem.static import load_steps
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.symmetric import looks_the_same
from tireroad.fem.static.tangent import ConstrainedSystem
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import compound

PRESSURE, LOAD = 1.5e5, 400.0
SOFT = compound("neo-hookean", 1100.0, youngs_modulus=5e6, poisson_ratio=0.49)
BELT = {"youngs_modulus": 100e9, "area": 2e-7, "spacing": 1e-3}


def _tire(make_body, comm=MPI.COMM_SELF):
    plies = (PlyLine("one", (-0.8, 0.8), 1.0), PlyLine("two", (-0.7, 0.7), 0.0))
    cords = tuple(
        Cords(name=name, angle=np.radians(angle), **BELT)
        for name, angle in (("one", 25), ("two", -25))
    )
    return make_body(segments=8, material=SOFT, plies=plies, cords=cords, comm=comm)


def _loaded(body, rolling=AT_REST) -> LoadStepper:
    loader = LoadStepper(Equilibrium(body, rolling), lambda progress: None)
    loader.inflate(PRESSURE)
    loader.carry(LOAD)
    return loader


@pytest.mark.slow
@pytest.mark.parametrize("rolling", [AT_REST, Rolling(speed=40.0)])
def test_half_the_ring_finds_the_state_of_the_whole(make_body, monkeypatch, rolling):
    """Displacement, force of every node and deflection; the whole factorises no tangent of its own, inflated or loaded."""
    taken, factorised = [], []
    take = ConstrainedSystem.take
    monkeypatch.setattr(
        ConstrainedSystem,
        "take",
        lambda *given: factorised.append(given[1].getSize()[0]) or take(*given),
    )
    resume = Equilibrium.resume
    monkeypatch.setattr(
        Equilibrium, "resume", lambda *state: taken.append(resume(*state)) or taken[-1]
    )
    half = _loaded(_tire(make_body), rolling)
    assert [step.iterations for step in taken] == [0]
    assert max(factorised) == 3 * _tire(make_body).lattice.shape[1] * 9  # nodes at 9 of 16 angles
    monkeypatch.setattr(load_steps, "looks_the_same", lambda ring, rolling: False)
    whole = _loaded(_tire(make_body), rolling)
    assert half.load() == pytest.approx(LOAD, rel=1e-9)
    assert half.deflection == pytest.approx(whole.deflection, rel=1e-9)
    assert half.equilibrium.points() == whole.equilibrium.points()
    wanted = whole.body.displacement()
    np.testing.assert_allclose(half.body.displacement(), wanted, atol=1e-9 * abs(wanted).max())
    forces = (one.equilibrium.contact_force() for one in (half, whole))
    np.testing.assert_allclose(*forces, atol=1e-8 * LOAD)


@pytest.mark.slow
@pytest.mark.mpi
def test_half_the_ring_on_several_processes(make_body):
    """As on one, to rounding, with the cut faces on whatever process."""
    alone, shared = _loaded(_tire(make_body)), _loaded(_tire(make_body, MPI.COMM_WORLD))
    wanted = alone.body.displacement()
    np.testing.assert_allclose(shared.body.displacement(), wanted, atol=1e-9 * abs(wanted).max())
    assert shared.equilibrium.points() == alone.equilibrium.points()


@pytest.mark.slow
def test_a_curve_by_halves_is_that_of_the_whole(make_body, monkeypatch):
    """Loads at three deflections, and what the whole finds out of balance between them: nothing."""

    def loads():
        loader = LoadStepper(Equilibrium(_tire(make_body), AT_REST), lambda progress: None)
        loader.inflate(PRESSURE)
        return [loader.load() for _ in loader.visit((1e-3, 2e-3, 4e-3))]

    by_halves = loads()
    monkeypatch.setattr(load_steps, "looks_the_same", lambda ring, rolling: False)
    np.testing.assert_allclose(by_halves, loads(), rtol=1e-9)


def test_what_a_half_turn_changes_is_left_whole(make_body):
    """Damping, an odd number of elements around, a compound on one side, a sector."""
    ring = _tire(make_body).ring
    assert looks_the_same(ring, AT_REST)
    assert not looks_the_same(ring, Rolling(speed=40.0, damping=100.0))
    assert not looks_the_same(make_body(segments=9).ring, AT_REST)
    region = np.zeros(len(ring.section.cells), int)
    region[0] = 1
    uneven = replace(ring.section, region=region, regions=("wall", "other"))
    assert not looks_the_same(replace(ring, section=uneven), AT_REST)
    assert not looks_the_same(replace(ring, ring_corners=ring.ring_corners[:3]), AT_REST)
