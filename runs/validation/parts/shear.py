"""A half-space sheared, against closed forms and Kalker: (case, unit, computed, exact).

For a disc of radius 1 m in cells, `n` across it; forces are scaled by the cells' total area. A body
on a rigid road behaves like two equal ones with twice the shear modulus.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import Friction, Stiffness, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import Influence, half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import KernelShear, half_space_shear

# C11, C22, C23 of a circle by Poisson's ratio: Kalker, Three-Dimensional Elastic Bodies in Rolling
# Contact, table E.3.
KALKER = {0.25: (4.12, 3.67, 1.47), 0.5: (5.20, 3.98, 1.63)}
CELLS = (6, 12, 24)
CREEP, FRICTION = 1e-3, 0.5
Array = NDArray[np.float64]
SETTLED = 1e-5  # relative change of the force in a step


def rows() -> Iterator[tuple]:
    """All cases."""
    for nu in (0.25, 0.5):
        yield from pushed(nu, 24)
    for cells in (12, 24):
        exact = float(np.log(3.0))
        name = f"punch that sticks to a half-space, nu = 0, {cells} cells (Mossakovskii, Spence)"
        yield name, "-", bonded(0.0, cells), exact
    for nu, table in KALKER.items():
        for cells in CELLS:
            for k, (found, exact) in enumerate(zip(creep(nu, cells), table, strict=True)):
                name = f"rolling, C{('11', '22', '23')[k]}, nu = {nu:g}, {cells} cells (Kalker)"
                yield name, "-", found, exact


class Disc:
    """A disc of cells, with or without the cells `around` it.

    `grid` of the cells, their `x`, `y` and `line`; `inside`: which lie in the disc; their `pitch`;
    `radius` of a circle with the area of those inside.
    """

    def __init__(self, cells: int, *, around: bool = False) -> None:
        self.pitch = 2.0 / cells
        count = cells + 2 * around
        i = (np.arange(count) - (count - 1) / 2) * self.pitch
        x, y = (v.ravel() for v in np.meshgrid(i, i, indexing="ij"))
        inside = x**2 + y**2 < 1
        place = np.flatnonzero(inside | around)
        self.x, self.y, self.inside = x[place], y[place], inside[place]
        self.grid = GridPlaces((count, count), (self.pitch, self.pitch), place)
        self.line: Any = place % count
        self.radius = float(np.sqrt(inside.sum() * self.pitch**2 / np.pi))

    def shear(self, nu: float) -> KernelShear:
        """The tangential compliance for a shear modulus of 1 Pa."""
        return KernelShear(self.grid, _sideways(nu))


class _Alone(KernelShear):
    """For two equal bodies: pressure moves both sideways by the same amount."""

    def __init__(self, disc: Disc, nu: float) -> None:
        super().__init__(disc.grid, _sideways(nu))
        self.coupled = False


def _sideways(nu: float) -> Influence:
    def of(x: Array, y: Array, a: Array, b: Array) -> Array:
        return half_space_shear(x, y, a, b, 2 * (1 + nu), nu)

    return of


def _down(nu: float) -> Influence:
    def of(x: Array, y: Array, a: Array, b: Array) -> Array:
        return half_space_influence(x, y, a, b, 2 * (1 + nu), nu)

    return of


def pushed(nu: float, cells: int) -> Iterator[tuple]:
    """Under Hertzian pressure: shift 3 mu P (2 - nu)/(16 a G) [1 - (1 - Q/mu P)^(2/3)]."""
    disc = Disc(cells)
    normal = np.sqrt(1 - disc.x**2 - disc.y**2) * disc.pitch**2
    total, count = float(normal.sum()), len(normal)
    tread = disc.shear(nu).between(np.arange(count))
    stiffness = Stiffness(np.zeros((2 * count, 2 * count)), tread=tread)
    for share in (0.3, 0.7):
        shift = 3 * FRICTION * total * (2 - nu) / 16 * (1 - (1 - share) ** (2 / 3))
        moved = np.tile([-shift, 0.0], (count, 1))
        force = stick_slip(stiffness, moved, FRICTION * normal, np.zeros((count, 2)))
        sticks = np.linalg.norm(force, axis=1) < FRICTION * normal * (1 - 1e-6)
        name = f"sphere, nu = {nu:g}, {cells} cells, pushed to {share:g} of sliding (Cattaneo, Mindlin), "
        yield name + "force", "N", float(force[:, 0].sum()), share * FRICTION * total
        radius = float(np.sqrt(sticks.sum() * disc.pitch**2 / np.pi))
        yield name + "radius that sticks", "m", radius, (1 - share) ** (1 / 3)


def bonded(nu: float, cells: int) -> float:
    """Load of a sticking flat punch over a frictionless one: ln(3 - 4 nu)(1 - nu)/(1 - 2 nu)."""
    disc = Disc(cells)
    count = len(disc.x)
    tread = KernelTread(disc.grid, _down(nu))
    solver = ActiveSet(tread.block(np.arange(count), np.arange(count)))
    brush = Brush(BrushLaw(np.inf, kind="spring"), disc.x, disc.line, 0.0, 1.0)
    friction = Friction(brush, np.zeros((3 * count, 3 * count)), None, disc.shear(nu))
    gap, touching, none = np.full(count, -1e-3), np.ones(count, dtype=bool), np.zeros(count)
    found = friction.solve(solver, gap, touching, none, np.zeros(2 * count))[0]
    return float(found.sum() / solver.solve(gap, touching).sum())


def creep(nu: float, cells: int) -> tuple[float, float, float]:
    """C11, C22, C23 of rolling without sliding: C11 G a^2 xi, C22 G a^2 eta, C23 G a^3 phi."""
    disc = Disc(cells, around=True)
    spin = CREEP * np.stack([disc.y, disc.x], axis=-1)
    along, across, turned = (_rolled(disc, nu, slip) for slip in ((CREEP, 0.0), (0.0, CREEP), spin))
    unit = 2.0 * disc.radius**2 * CREEP
    return along[0] / unit, -across[1] / unit, -turned[1] / (unit * disc.radius)


def _rolled(disc: Disc, nu: float, slip) -> np.ndarray:
    """Horizontal force (2,) N, rolled one cell per step until steady."""
    count = len(disc.x)
    brush = Brush(BrushLaw(np.inf, None, slip), disc.x, disc.line, disc.pitch, 1.0)
    brush.begin(disc.inside)
    friction = Friction(brush, np.zeros((3 * count, 3 * count)), None, _Alone(disc, nu))
    solver, normal = ActiveSet(np.eye(count)), 1.0 * disc.inside
    gap, free, last = 1.0 - normal, np.zeros(2 * count), np.zeros(2)
    for _ in range(round(10 / disc.pitch)):
        total = friction.solve(solver, gap, disc.inside, normal, free)[1].sum(axis=0)
        if np.abs(total - last).max() < SETTLED * np.abs(total).max():
            break
        last = total
    return last
