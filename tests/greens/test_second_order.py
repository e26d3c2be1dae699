"""Residual states with inertia and damping against systems whose every mode is known."""

import numpy as np
import pytest
from systems import make

from tireroad.greens.basis import Moments, second_order
from tireroad.greens.response import couple
from tireroad.modal.rotating import rotating

KEPT = 6


def moments(system) -> Moments:
    """Of the full system, by dense solves."""
    x = np.linalg.solve(system.stiffness, system.shape.T)
    y = np.linalg.solve(system.stiffness.T, system.shape.T).T
    return Moments(system.shape @ x, y @ system.drag @ x, y @ x, np.ones((3, len(x))) @ x)


def reduced(system, option: str):
    """The first modes with a residual."""
    few = type(system)(
        system.drag[:KEPT, :KEPT], system.stiffness[:KEPT, :KEPT], system.shape[:, :KEPT]
    )
    if option == "none":
        return few.response()
    if option == "static":
        return few.response(compliance=moments(system).compliance)
    modes = rotating(few.drag, few.stiffness)
    carried = np.ones((3, KEPT))
    poles = couple(modes, few.shape, few.shape, carried)
    return second_order(poles, modes, few.shape, carried, moments(system))


def band(system) -> np.ndarray:
    """Up to half the highest kept frequency, Hz."""
    return np.linspace(0, np.sqrt(system.stiffness[KEPT, KEPT]) / (4 * np.pi), 23)


def error(system, option: str, frequency: np.ndarray) -> np.ndarray:
    exact = system.response().receptance(frequency)
    found = reduced(system, option).receptance(frequency)
    return np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))


@pytest.mark.parametrize(("speed", "damping"), [(0.0, 0.0), (0.0, 100.0), (15.0, 100.0)])
def test_each_option_is_better_than_the_one_before(speed, damping) -> None:
    """Over the band up to half the highest kept frequency, and exact at 0 Hz.

    Rolling faster or with sharper resonances, what is left is the Coriolis coupling between kept
    modes and those left out: it moves the kept eigenvalues, which no residual of this kind can.
    """
    system = make(m=40, points=5, speed=speed, damping=damping)
    none, static, second = (
        error(system, o, band(system)) for o in ("none", "static", "second-order")
    )
    assert static[0] < 1e-9 and second[0] < 1e-9 < none[0]
    assert static.max() < none.max() / 3
    assert second.max() < static.max() / 3


def test_heavy_damping_spoils_the_static_residual_and_not_the_second_order() -> None:
    """Modes so overdamped that they do not follow statically within the band: physics, not numerics."""
    system = make(m=40, points=5, speed=0.0, damping=3e3)
    none, static, second = (
        error(system, o, band(system)) for o in ("none", "static", "second-order")
    )
    assert static.max() > none.max()
    assert second.max() < none.max() / 3


def test_the_slope_at_rest_is_exact_when_rolling() -> None:
    """H'(0), where damping and Coriolis forces of the modes left out first show."""
    system = make(m=40, points=5, speed=60.0, damping=50.0)
    response = reduced(system, "second-order")
    exact = system.response().spectral_moment()
    assert np.abs(response.spectral_moment() - exact).max() < 1e-9 * np.abs(exact).max()
    static = reduced(system, "static").spectral_moment()
    assert np.abs(static - exact).max() > 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("speed", [0.0, 30.0, 150.0])
@pytest.mark.parametrize("damping", [0.0, 8.0, 3e3])
def test_residual_states_never_grow(speed, damping) -> None:
    system = make(m=40, points=5, speed=speed, damping=damping)
    response = reduced(system, "second-order")
    fastest = np.abs(response.eigenvalue).max()
    assert response.eigenvalue.real.max() < 1e-9 * fastest
    assert len(response.eigenvalue) > KEPT


def test_nothing_is_left_when_no_mode_is_missing() -> None:
    """A complete basis: the moments are rounding, and no state is made from it."""
    system = make(m=KEPT, points=5)
    response = reduced(system, "second-order")
    assert len(response.eigenvalue) == KEPT
    assert np.abs(response.residual).max() < 1e-12 * np.abs(response.static()).max()


def test_momentum_of_the_residual_states() -> None:
    """Together with the kept states they carry what the full tire carries under a slow force."""
    system = make(m=40, points=5, speed=30.0)
    response = reduced(system, "second-order")
    carried = -((response.momentum / response.eigenvalue) @ response.input).real
    exact = moments(system).momentum
    assert np.abs(carried - exact).max() < 1e-9 * np.abs(exact).max()


def test_what_is_left_when_rolling_is_the_coupling_with_kept_modes() -> None:
    """Coriolis and convective terms between kept modes and those left out are no residual's: without them the
    error falls to that of a standing wheel; attachment modes, which are coupled, have them.
    """
    system = make(m=40, points=5, speed=60.0, damping=50.0)
    drag, stiffness = system.drag.copy(), system.stiffness.copy()
    for matrix in (drag, stiffness):
        matrix[:KEPT, KEPT:] = matrix[KEPT:, :KEPT] = 0.0
    apart = type(system)(drag, stiffness, system.shape)
    standing = make(m=40, points=5, speed=0.0, damping=50.0)
    coupled, alone, still = (
        error(one, "second-order", band(one)).max() for one in (system, apart, standing)
    )
    assert alone < 2 * still
    assert coupled > 5 * alone
