"""The shape that stands on the road as a tire rolls: the moment of its normal force against its losses, and who has one."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.model import TreadContact
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.setup import Rolled, contact_setup
from tireroad.contact.tread.law import TREADS
from tireroad.fem.matrices import probe
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.greens.rolling_loss import standing
from tireroad.greens.slow import lowest
from tireroad.runs import library

SPEED, LOAD = 72.0, 3000.0
TURNING = Turning(speed=SPEED, damping=StrainEnergy())


@cache
def rolling(shared: bool = False) -> library.RollingTire:
    """A coarse passenger tire on a road, of this process alone or `shared` by all."""
    comm = MPI.COMM_WORLD if shared else MPI.COMM_SELF
    tire = library.radial("205/60 R15", segments=12, elements_arc=8, comm=comm)
    static = library.press(tire, inflation=2.2e5, load=LOAD, turning=TURNING)
    return library.roll(library.modes(tire, static, up_to=120.0, turning=TURNING), TURNING)


def shape(tire: library.RollingTire):
    return standing(tire.wheel, lowest(tire.standing.basis.projection))


@pytest.mark.slow
def test_the_moment_of_the_normal_force_supplies_the_losses():
    """Without friction, on a road that holds the tire's height: moment times speed is the power lost: 8 % less on 12 x 8 elements,
    2 % on 16 x 10; without losses the force stands under the axle."""
    tire = rolling()
    static = tire.standing.motions.static
    rolled = Rolled(speed=SPEED * static.rolling_radius(), duration=0.01)
    lattice = tire.standing.motions.lattice
    setup = contact_setup(static, lattice, RoadUnderTire(Flat()), rolled)
    p, index = len(setup.patch.index), setup.patch.index
    every = [probe.nodes(index, len(static.points), part) for part in (2, 0, 1)]
    points = sparse.vstack(every, format="csr")
    response = tire.respond(points, points)
    assert response.offset is not None
    spec = TreadContact(law=TREADS.make("half-space", youngs_modulus=1e7), friction=0.0)
    flexibility = (response.static() + response.residual)[:, :p]

    def moment(response) -> float:
        settled, _ = setup.equilibrated(response, static.force, spec)
        force = settled.patch.force
        assert force.sum() == pytest.approx(LOAD)
        moved = flexibility @ (force - static.force[index])
        moved += 0.0 if response.offset is None else response.offset
        return float((settled.patch.points[:, 0] + moved[p : 2 * p]) @ force)

    loss = shape(tire).loss
    assert moment(response) * SPEED == pytest.approx(loss.whole, rel=0.1)
    assert abs(moment(replace(response, offset=None))) * SPEED < 0.02 * loss.whole
    assert 0.005 < loss.whole / SPEED / static.rolling_radius() / LOAD < 0.015


@pytest.mark.slow
def test_who_has_no_other_shape():
    """A tire that stands, one that is damped otherwise, and one that no road presses on."""
    tire = rolling()
    frequency = lowest(tire.standing.basis.projection)
    for changed in ({"speed": 0.0}, {"damping": (500.0, 0.0)}, {"pressed": None}):
        assert standing(replace(tire.wheel, **changed), frequency) is None
    motions = tire.standing.motions
    before = motions.body.displacement()
    assert standing(tire.wheel, frequency) is not None
    assert np.array_equal(motions.body.displacement(), before)


@pytest.mark.mpi
def test_the_shape_is_the_same_on_any_number_of_processes():
    alone, shared = (shape(rolling(shared)) for shared in (False, True))
    assert shared.loss.whole == pytest.approx(alone.loss.whole, rel=1e-6)
    np.testing.assert_allclose(shared.motion, alone.motion, atol=1e-6 * np.abs(alone.motion).max())
