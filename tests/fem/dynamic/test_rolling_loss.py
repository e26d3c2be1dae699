"""Losses of the deformation that stands on the road: a closed form, and that its forces have no resultant."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.matrices.rolling_loss import rolling_loss, stiffening_force
from tireroad.fem.tire.material import Material, compound, power_law
from tireroad.runs import library

SPEED, LOSS, EXPONENT = 40.0, 0.2, 0.1
STRETCH = np.diag([1.05, 1.0, 0.93])


def rubber() -> Material:
    return compound(
        "neo-hookean",
        1200.0,
        youngs_modulus=5e6,
        poisson_ratio=0.45,
        dynamic=1.5,
        loss_factor=LOSS,
        spectrum=power_law(EXPONENT),
    )


def squeezed(comm: MPI.Comm = MPI.COMM_SELF, **mesh):
    """A torus in a uniform deformation at rest in space, and its undeformed nodes (n, 3) m."""
    tire = library.torus(elements_arc=4, order=2, material=rubber(), comm=comm, **mesh)
    places = tire.lattice.points(np.arange(tire.lattice.size))
    tire.body.set_displacement(places @ (STRETCH - np.eye(3)).T)
    return tire, places


def exact(modulus: float) -> float:
    """8 pi E_1 S_1 for unit volume, J/m3 a turn over `modulus`: S_1 and E_1 half the differences of the principal stresses and
    strains along x and z. In the turning material both have two waves around, and no other."""
    law, C = rubber().law, STRETCH.T @ STRETCH
    J = np.linalg.det(STRETCH)
    S = law.shear * J ** (-2 / 3) * (np.eye(3) - np.trace(C) / 3 * np.linalg.inv(C))
    S += law.bulk * (J - 1) * J * np.linalg.inv(C)
    stress, strain = (S[0, 0] - S[2, 2]) / 2, (C[0, 0] - C[2, 2]) / 4
    return 8 * np.pi * modulus * stress * strain


@pytest.mark.parametrize("mesh", [{"segments": 12, "footprint_size": 1.0}, {"segments": 24}])
def test_a_deformation_at_rest_in_space_loses_at_twice_the_turns(mesh):
    """Finite strain, complex moduli at 2 Omega, elements of one length or of two around."""
    tire, _ = squeezed(**mesh)
    found = rolling_loss(tire.body, SPEED)
    volume = tire.body.nodal_mass()[::3].sum() / rubber().density
    loss = rubber().dynamic * LOSS * (2 * SPEED / (2 * np.pi) / 100.0) ** EXPONENT
    power = exact(loss) * volume * SPEED / (2 * np.pi)
    assert found.power[0, 1] == pytest.approx(power, rel=2e-3)
    assert found.whole == pytest.approx(power, rel=5e-3)
    assert found.frequency[0] == pytest.approx(2 * SPEED / (2 * np.pi), rel=0.03)


def test_the_forces_take_that_power_from_the_flow():
    """On the material's own velocity F (Omega e_y x X); no resultant, no moment about the axle, and turned with the rotation."""
    tire, places = squeezed(segments=12, footprint_size=1.0)
    found, other = (rolling_loss(tire.body, speed) for speed in (SPEED, -SPEED))
    flow = np.cross([0.0, SPEED, 0.0], places) @ STRETCH.T
    assert -(found.force * flow).sum() == pytest.approx(found.whole, rel=5e-3)
    size = np.abs(found.force).sum()
    assert np.abs(found.force.sum(axis=0)).max() < 1e-12 * size
    moved = places @ STRETCH.T
    moments = np.cross(moved, found.force).sum(axis=0)
    assert np.abs(moments).max() < 1e-12 * size
    assert other.whole == pytest.approx(found.whole)
    np.testing.assert_allclose(other.force, -found.force, atol=1e-12 * np.abs(found.force).max())


def test_a_round_tire_loses_nothing_and_a_stiffening_one_gives_nothing():
    """What is alike all around does not change for the material; storage moduli do no work in a turn."""
    tire, places = squeezed(segments=12, footprint_size=1.0)
    flow = np.cross([0.0, SPEED, 0.0], places) @ STRETCH.T
    stiff = stiffening_force(tire.body, SPEED, 50.0)
    assert abs((stiff * flow).sum()) < 1e-6 * np.abs(stiff * flow).sum()
    assert (stiff * places).sum() < 0
    tire.body.set_displacement(0.03 * places * (1.0, 0.0, 1.0))
    assert rolling_loss(tire.body, SPEED).whole < 1e-6 * 0.03**2 * 5e6


@pytest.mark.mpi
def test_losses_are_the_same_on_any_number_of_processes():
    (alone, _), (shared, _) = (
        squeezed(comm, segments=12) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    one, all_ = rolling_loss(alone.body, SPEED), rolling_loss(shared.body, SPEED)
    np.testing.assert_allclose(all_.power, one.power, atol=1e-12 * one.whole)
    np.testing.assert_allclose(all_.force, one.force, atol=1e-10 * np.abs(one.force).max())
