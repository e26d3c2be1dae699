"""Contact with a half-space that gives way sideways, against closed forms of pushed, bonded and rolling bodies."""

import numpy as np
import pytest

from tireroad.contact.solver.complementarity import ActiveSet
from tireroad.contact.solver.friction import Friction
from tireroad.contact.solver.tangential import Stiffness, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import KernelShear, half_space_shear

YOUNG = 1e6


def half_space(nu: float):
    return lambda x, y, a, b: half_space_shear(x, y, a, b, YOUNG, nu)


def disc(n: int, margin: int = 0):
    """Cells of a square around a disc of radius 1, n across it: places of those in it, x, y, pitch."""
    pitch, count = 2.0 / n, n + 2 * margin
    i = (np.arange(count) - (count - 1) / 2) * pitch
    x, y = (v.ravel() for v in np.meshgrid(i, i, indexing="ij"))
    on = np.flatnonzero(x**2 + y**2 < 1)
    return GridPlaces((count, count), (pitch, pitch), on), x[on], y[on], pitch


def bonded(nu: float, n: int) -> float:
    """Load of a punch that sticks over that of one without friction."""
    grid, x, _, _ = disc(n)
    c = len(x)
    tread = KernelTread(grid, lambda *at: half_space_influence(*at, YOUNG, nu))
    solver = ActiveSet(tread.block(np.arange(c), np.arange(c)))
    brush = Brush(BrushLaw(np.inf, None, kind="spring"), x, np.arange(c), 0.0, 1.0)
    friction = Friction(brush, np.zeros((3 * c, 3 * c)), None, KernelShear(grid, half_space(nu)))
    q, touching = np.full(c, -1e-3), np.ones(c, dtype=bool)
    smooth = solver.solve(q, touching).sum()
    return float(
        friction.solve(solver, q, touching, np.zeros(c), np.zeros(2 * c))[0].sum() / smooth
    )


@pytest.mark.parametrize("nu", [0.0, 0.25])
def test_bonded_punch(nu: float) -> None:
    """Flat, round, stuck to a half-space: P = 4 G a d ln(3 - 4 nu)/(1 - 2 nu); Mossakovskii 1954, Spence 1968."""
    exact = np.log(3 - 4 * nu) * (1 - nu) / (1 - 2 * nu)
    coarse, fine = (bonded(nu, n) / exact - 1 for n in (12, 24))
    assert abs(fine) < 0.003
    assert abs(fine) < 0.6 * abs(coarse)


@pytest.mark.parametrize("nu", [0.25, 0.5])
def test_cattaneo_mindlin_with_any_poisson_ratio(nu: float) -> None:
    """Shift 3 mu P (2 - nu)/(16 a G) [1 - (1 - Q/mu P)^(2/3)], what sticks (1 - Q/mu P)^(1/3) a."""
    grid, x, y, pitch = disc(24)
    friction, modulus = 0.5, YOUNG / 2 / (1 + nu)
    normal = np.sqrt(1 - x**2 - y**2) * pitch**2
    total = normal.sum()
    tread = KernelShear(grid, half_space(nu)).between(np.arange(len(x)))
    stiffness = Stiffness(np.zeros((2 * len(x), 2 * len(x))), tread=tread)
    for share in (0.3, 0.7):
        shift = 3 * friction * total * (2 - nu) / (16 * modulus) * (1 - (1 - share) ** (2 / 3))
        constant = np.tile([-shift, 0.0], (len(x), 1))
        force = stick_slip(stiffness, constant, friction * normal, np.zeros((len(x), 2)))
        assert force[:, 0].sum() == pytest.approx(share * friction * total, rel=0.003)
        sticks = np.linalg.norm(force, axis=1) < friction * normal * (1 - 1e-6)
        radius = np.sqrt(sticks.sum() * pitch**2 / np.pi)
        assert radius == pytest.approx((1 - share) ** (1 / 3), abs=0.02)
