"""The literature's contact models: parameters of a profile, Hertz springs, wedges' look-up, fitted springs."""

import numpy as np
import pytest

from tireroad.contact.tread.law import TREADS
from tireroad.fem.errors import InputError
from tireroad.tests.reference.literature import (
    Asperities,
    ShiftedSprings,
    Wedges,
    asperities,
    fitted_stiffness,
    look_up,
)

PITCH = 1e-4


def test_a_sine_has_its_own_asperities() -> None:
    """Height a, spacing a wave, no unevenness; the arc over half a wave has r = (c^2 / 4 + a^2) / 2 a."""
    x = PITCH * np.arange(20_000)
    found = asperities(1e-3 * np.sin(2 * np.pi * x / 0.02) + 0.3, PITCH)
    assert found.height == pytest.approx(1e-3, rel=1e-2)
    assert found.spacing == pytest.approx(0.02, rel=1e-2)
    assert found.unevenness < 1e-5
    assert found.radius == pytest.approx((0.01**2 / 4 + 1e-6) / 2e-3, rel=2e-2)


def test_higher_and_lower_in_turn() -> None:
    x = PITCH * np.arange(40_000)
    z = 1e-3 * np.sin(2 * np.pi * x / 0.02)
    found = asperities(np.where(np.floor(x / 0.02) % 2 == 0, z, np.where(z > 0, 0.6 * z, z)), PITCH)
    assert found.unevenness == pytest.approx(0.4e-3, rel=0.02)
    with pytest.raises(InputError, match="asperities"):
        asperities(x, PITCH)


def springs(**more) -> ShiftedSprings:
    road = Asperities(height=1e-3, unevenness=2e-4, spacing=0.02, radius=0.01)
    given = {
        "road": road,
        "modulus": 1e7,
        "width": 0.1,
        "gap": lambda x: np.maximum(np.abs(x) - 0.04, 0.0) ** 2 / 0.6,
        "length": 0.1,
        "load": 800.0,
    }
    return ShiftedSprings(**(given | more))


def test_springs_pass_in_turn_and_carry_the_load() -> None:
    """Mean the load, period two spacings; a single asperity in a flat gap has Hertz's force."""
    way = np.linspace(0.0, 0.04, 801)
    force = springs().forces(way)
    assert force[:-1].mean() == pytest.approx(800.0, rel=1e-3)
    assert springs().forces(way + 0.04) == pytest.approx(force, rel=1e-9)
    assert np.ptp(force) > 1.0
    flat = springs(
        road=Asperities(1e-3, 0.0, 0.02, 0.01), gap=lambda x: np.where(abs(x) < 0.011, 0.0, 1.0)
    )
    depth = (80.0 / 0.5 / (4 / 3 * 1e7 * np.sqrt(0.01))) ** (2 / 3)
    single = flat._at(np.zeros(1), depth)
    assert single[0] == pytest.approx(5 * 160.0)


def test_wedges_give_back_the_law_they_were_made_of() -> None:
    """Force per metre c A^0.5 of random wedges: the look-up, and the tire on a plane and on half of it."""
    rng = np.random.default_rng(2)
    area = rng.uniform(0.0, 1e-3, 4000)
    table = look_up(area, 3e5 * np.sqrt(area))
    assert table.scatter < 0.02
    x = np.arange(-10, 11) * 0.01
    y = np.broadcast_to(np.arange(-5, 6) * 0.01, (21, 11))
    height = 0.5 * (x[:, None] ** 2 / 0.3 + y**2 / 0.1)
    tire = Wedges(x=x, length=np.full(21, 0.01), y=y, height=height, width=np.full((21, 11), 0.01))
    level = np.full((21, 11), 0.008)
    inside = (np.maximum(0.008 - height, 0) * 0.01).sum(axis=1)
    exact = (3e5 * np.sqrt(inside)).sum() * 0.01
    assert tire.force(level, table) == pytest.approx(exact, rel=0.03)
    level[:10] = -1.0
    assert tire.force(level, table) < 0.6 * exact


def test_a_look_up_only_rises() -> None:
    table = look_up(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 3.0, 2.0, 4.0]))
    assert list(table.force) == [0.0, 1.0, 2.5, 2.5, 4.0]
    assert table(np.array([5.0]))[0] == pytest.approx(5.5)
    with pytest.raises(InputError, match="fewer than three"):
        look_up(np.zeros(5), np.zeros(5))


def test_springs_fitted_to_springs_are_themselves() -> None:
    bed = TREADS.make("winkler", winkler_stiffness=3e8)
    assert fitted_stiffness(bed, 0.005, 5e-4) == pytest.approx(3e8, rel=1e-12)


def test_springs_fitted_to_a_half_space_carry_what_hertz_says() -> None:
    """A sphere's cut holds pi r d^2 of volume and carries 4/3 E* sqrt(r) d^1.5: k = 4 E* / (3 pi sqrt(r d))."""
    law = TREADS.make("half-space", youngs_modulus=1e7, poisson_ratio=0.49)
    modulus = 1e7 / (1 - 0.49**2)
    expected = 4 * modulus / (3 * np.pi * np.sqrt(0.005 * 5e-4))
    assert fitted_stiffness(law, 0.005, 5e-4) == pytest.approx(expected, rel=0.03)
