"""Rolling with friction against Carter's cylinder and Pacejka's brush."""

import numpy as np
import pytest

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import rectangle_potential
from tireroad.tests.reference.closed_forms import (
    brush_force,
    carter_force,
    carter_traction,
    hertz_cylinder,
)

FRICTION, LOAD, HALF = 0.4, 1000.0, 0.02


def steady(x, normal, way, slip, stiffness, compliance):
    """Horizontal forces (c,) N along one line of points after five passages.

    `compliance` (c, c) m/N of the body to forces along the line; the normal forces do not change.
    """
    c = len(x)
    tire = np.zeros((3 * c, 3 * c))
    tire[c : 2 * c, c : 2 * c] = tire[2 * c :, 2 * c :] = compliance
    brush = Brush(BrushLaw(stiffness, FRICTION, (slip, 0.0)), x, np.zeros(c, int), way, 1.0)
    brush.begin(normal > 0)
    friction, solver = BrushFriction(brush, tire, None), ActiveSet(np.eye(c))
    gap, free = np.where(normal > 0, 0.0, 1.0), np.zeros(2 * c)
    for _ in range(10 * round(HALF / way)):
        force, horizontal = friction.solve(solver, gap, normal > 0, normal, free)
    assert np.array_equal(force, normal)
    assert not horizontal[:, 1].any()
    return horizontal[:, 0]


def line(cells: int) -> tuple[np.ndarray, float]:
    """Middles of `cells` cells over the contact and three more on each side, and their pitch, m."""
    pitch = 2 * HALF / cells
    return pitch * (np.arange(cells + 6) - (cells + 5) / 2), pitch


def carter(share: float, cells: int):
    """x (m), traction and its closed form (Pa), force over Carter's; creepage `share` of full sliding."""
    modulus, width = 4e6, 1.0  # E = E* for nu = 0, N/m2; width of the strip, m
    radius = np.pi * modulus * HALF**2 / (4 * LOAD / width)
    hertz = hertz_cylinder(LOAD / width, radius, modulus)
    assert hertz.half_width == pytest.approx(HALF)
    x, pitch = line(cells)
    edges = np.clip(np.stack([x - pitch / 2, x + pitch / 2]) / HALF, -1, 1)
    over = 0.5 * (edges * np.sqrt(1 - edges**2) + np.arcsin(edges))  # exact cell by cell
    normal = hertz.peak_pressure * HALF * width * np.diff(over, axis=0)[0]
    # nu = 0: a tangential force moves the surface by 1/(2 pi G r), G = E/2; strips 80 m long. In the
    # plane that has no zero: it is put at the contact's width, or the force would build up slowly.
    strip, half = np.float64(40.0), np.float64(pitch / 2)
    lone = rectangle_potential(x[:, None] - x, 0 * x, half, strip)
    lone -= rectangle_potential(np.array(2.2 * HALF), np.array(0.0), half, strip)
    compliance = lone / (np.pi * modulus) / (pitch * width)
    creepage = share * FRICTION * HALF / radius
    found = steady(x, normal, pitch, creepage, 1e3 / compliance[0, 0], compliance)
    exact = hertz.peak_pressure * carter_traction(x, creepage, FRICTION, HALF, radius)
    total = carter_force(creepage, FRICTION, HALF, radius) * FRICTION * LOAD
    return x, found / (pitch * width), exact, found.sum() / total


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.6, 1.3])
def test_carters_rolling_cylinder(share: float) -> None:
    """Bristles a thousand times stiffer than the half-space under them: what is left is the half-space.

    A point's bristle is entered one pitch behind the leading edge: first order in the pitch.
    """
    coarse = carter(share, 40)[-1]
    x, traction, exact, fine = carter(share, 80)
    assert fine == pytest.approx(1.0, abs=0.03)
    assert 2 * fine - coarse == pytest.approx(1.0, abs=0.005)
    pitch = x[1] - x[0]
    behind = x < HALF - 2 * pitch
    assert np.abs(traction - exact)[behind].max() < 0.05 * exact.max()
    # Where it sticks the traction is below the bound: Carter's strip at the leading edge.
    bound = carter(10.0, 80)[2]
    sticks = (traction < 0.97 * bound) & (np.abs(x) < HALF - pitch)
    assert sticks.sum() * pitch == pytest.approx(2 * HALF * max(1 - share, 0), abs=4 * pitch)


@pytest.mark.slow
@pytest.mark.parametrize("slip", [0.002, 0.01, 0.03, 0.2])
def test_pacejkas_brush(slip: float) -> None:
    """Bristles on a rigid body under parabolic pressure."""
    tread, (x, pitch) = 5e7 / 10, line(200)
    edges = np.clip(np.stack([x - pitch / 2, x + pitch / 2]) / HALF, -1, 1)
    normal = 0.75 * LOAD * np.diff(edges - edges**3 / 3, axis=0)[0]
    found = steady(x, normal, pitch, slip, tread * pitch, np.zeros((len(x), len(x))))
    wanted = brush_force(slip, FRICTION, LOAD, HALF, tread)
    assert found.sum() == pytest.approx(wanted, rel=0.01)
