"""Contact on a half-space and under a brush against closed forms: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import brentq, root_scalar

from tireroad.contact.loop import roll
from tireroad.contact.patch import Patch
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.setup import ContactSetup, Rolled
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction, PlaneCompliance, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import (
    Influence,
    dense_compliance,
    half_space_compliance,
    half_space_influence,
    rectangle_potential,
    winkler_compliance,
)
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.memory import TreadMemory, WholeGrid, steadily
from tireroad.contact.tread.pattern import Pattern, pitch_starts
from tireroad.contact.tread.shear import KernelShear, half_space_shear
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.sections.mesh2d import product_mesh
from tireroad.fem.sections.torus import Torus
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import RubbingEquilibrium
from tireroad.fem.static.friction_road import Passing, Sliding, StandingFriction
from tireroad.fem.static.virtual_work import AT_REST
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import INNER, TREAD
from tireroad.runs.scene.tables.contact import GrooveTable
from tireroad.tests.reference import closed_forms as exact
from tireroad.tests.validation.cases import oval_patch

YOUNG, POISSON = 3.4e6, 0.49
MODULUS = exact.contact_modulus(YOUNG, POISSON)
FRICTION, LOAD, HALF = 0.4, 1000.0, 0.02  # of the rolling cylinder and the brush: -, N, m

# C11, C22, C23 of a circle by Poisson's ratio: Kalker, Three-Dimensional Elastic Bodies in Rolling
# Contact, table E.3.
KALKER = {0.25: (4.12, 3.67, 1.47), 0.5: (5.20, 3.98, 1.63)}
CELLS = (6, 12, 24)
CREEP, SHEAR_FRICTION = 1e-3, 0.5
Array = NDArray[np.float64]
SETTLED = 1e-5  # relative change of the force in a step
SHEAR, NU, RADIUS, CREEP_LOAD, CREEP_SPEED = 1143e6, 0.4, 0.05, 600e3, 1.0
POINTS, DX, DY = 99, 0.16e-3, 1.0
PUBLISHED = {1e-9: 60.32, 0.009: 78.74, 0.045: 84.72, 2.0: 85.31}  # MPa at relaxation times, s
# Creepages at a traction of 0.6 of the bound: the program CONTACT's example of the same cylinders.
CREEPAGES = {1e-9: 1.378e-2, 0.009: 1.365e-2, 0.045: 1.152e-2, 2.0: 9.932e-3}
CREEP_FRICTION, TRACTION = 0.3, 0.6
BEHIND = 1000  # cells behind the patch that creep: 0.16 m, of which a relaxation of 45 ms needs all
PASSED = 100  # cells, more than the contact has
# One body against a rigid one deforms like two with twice its modulus.
INFLUENCE = partial(half_space_influence, youngs_modulus=(1 + NU) * SHEAR, poisson_ratio=NU)
BED, SPEED, STEP, PITCHES = 2e8, 20.0, 1e-4, 40
AROUND = 2.0  # m
WIDTH, GROOVED_LOAD, TIMES = (
    0.012,
    500.0,
    10,
)  # m: width of a groove; N; number of pitches that pass
FLAT = 1e3  # m, radius of the section circle
_GROWTH = 1.5
E = TypeVar("E", bound=Equilibrium)
STATIC_FRICTION, STATIC_HALF = 0.3, 0.015  # -; m, half the length of the contact


def normal_rows() -> Iterator[tuple]:
    """All cases."""
    yield from _love()
    yield from _sphere()
    yield from _cylinder()
    yield _punch()
    yield from _cattaneo_mindlin()
    yield from _carter()
    yield from _brush()


def _cells(half_x: float, half_y: float, nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres and half sizes of nx x ny equal rectangles that fill 2 half_x x 2 half_y."""
    x, y = (half * ((2 * np.arange(n) + 1) / n - 1) for half, n in ((half_x, nx), (half_y, ny)))
    points = np.column_stack([c.ravel() for c in np.meshgrid(x, y, indexing="ij")])
    return points, np.tile([half_x / nx, half_y / ny], (nx * ny, 1))


def _half_space(points: np.ndarray, half_sizes: np.ndarray) -> ActiveSet:
    return ActiveSet(half_space_compliance(points, half_sizes, YOUNG, POISSON))


def _love() -> Iterator[tuple]:
    unit = np.float64(1.0)
    for name, place, share in (("centre", 0.0, 1.0), ("corner", 1.0, 0.5)):
        potential = float(rectangle_potential(np.array(place), np.array(place), unit, unit))
        yield (
            f"uniform pressure on a square, {name} (Love)",
            "-",
            potential,
            share * exact.LOVE_SQUARE_CENTRE,
        )


def _sphere() -> Iterator[tuple]:
    radius, approach = 0.3, 1e-3
    side = 1.15 * np.sqrt(radius * approach)
    points, half_sizes = _cells(side, side, 29, 29)
    force = _half_space(points, half_sizes).solve((points**2).sum(axis=1) / (2 * radius) - approach)
    load = exact.hertz_sphere_load(approach, radius, MODULUS)
    yield "sphere, load (Hertz)", "N", float(force.sum()), load
    peak = exact.hertz_sphere(load, radius, MODULUS).peak_pressure
    yield (
        "sphere, pressure in the middle (Hertz)",
        "Pa",
        float(force.max() / 4 / half_sizes[0].prod()),
        peak,
    )


def _cylinder() -> Iterator[tuple]:
    # Strips of 2000 half widths: their ends change the middle by (1/2000)^2.
    radius, half_width = 0.3, 0.02
    points, half_sizes = _cells(1.2 * half_width, 40.0, 120, 1)
    force = _half_space(points, half_sizes).solve(points[:, 0] ** 2 / (2 * radius) - 2e-3)
    closed = exact.hertz_cylinder(force.sum() / 80.0, radius, MODULUS)
    pressure = float((force / (4 * half_sizes[0].prod())).max())
    yield "cylinder, pressure in the middle (Hertz)", "Pa", pressure, closed.peak_pressure


def _punch() -> tuple:
    """Aitken's extrapolation of three grids: the edge singularity leaves one power of the size."""
    side, approach, loads = 0.02, 1e-3, []
    for n in (8, 16, 32):
        points, half_sizes = _cells(side, side, n, n)
        loads.append(_half_space(points, half_sizes).solve(np.full(n * n, -approach)).sum())
    coarse, middle, fine = loads
    limit = fine - (fine - middle) ** 2 / ((fine - middle) - (middle - coarse))
    return (
        "rigid square punch, load",
        "N",
        float(limit),
        exact.square_punch_load(approach, side, MODULUS),
    )


def _cattaneo_mindlin() -> Iterator[tuple]:
    """Sphere, nu = 0, pushed sideways: shift 3 mu P/(8 a G) [1 - (1 - Q/mu P)^(2/3)]."""
    friction, n = 0.5, 25
    pitch = 2.1 / n
    i = (np.arange(n) - n // 2) * pitch
    x, y = (v.ravel() for v in np.meshgrid(i, i))
    pressure = np.sqrt(np.maximum(1 - x**2 - y**2, 0.0))
    on = pressure > 0
    x, y, normal = x[on], y[on], pressure[on] * pitch**2
    half = np.float64(pitch / 2)
    potential = rectangle_potential(x[:, None] - x, y[:, None] - y, half, half)
    matrix = PlaneCompliance(
        np.asarray(np.kron(np.eye(2), potential / (2 * np.pi * pitch**2)), dtype=float)
    )
    total = normal.sum()
    for share in (0.3, 0.7):
        shift = 3 * friction * total / 8 * (1 - (1 - share) ** (2 / 3))
        pushed = np.tile([-shift, 0.0], (len(x), 1))
        force = stick_slip(matrix, pushed, friction * normal, np.zeros((len(x), 2)))
        name = f"sphere pushed sideways to {share:g} of sliding (Cattaneo, Mindlin)"
        yield name, "N", float(force[:, 0].sum()), share * friction * total


def _brush() -> Iterator[tuple]:
    """Bristles on a rigid body under a parabolic pressure."""
    tread, (x, pitch) = 5e6, _line(200)
    edges = np.clip(np.stack([x - pitch / 2, x + pitch / 2]) / HALF, -1, 1)
    normal = 0.75 * LOAD * np.diff(edges - edges**3 / 3, axis=0)[0]
    for slip in (0.01, 0.1, 1.0):
        force = _steady(x, normal, slip, tread * pitch, np.zeros((len(x), len(x))))
        closed = exact.brush_force(slip, FRICTION, LOAD, HALF, tread)
        yield f"rolling brush, slip {slip:g} (Pacejka)", "N", force, closed


def _carter() -> Iterator[tuple]:
    """Bristles a thousand times stiffer than the half-space below them, nu = 0.

    A bristle enters one pitch behind the leading edge, a first-order error: removed by
    extrapolation from two pitches.
    """
    modulus = 4e6
    radius = np.pi * modulus * HALF**2 / (4 * LOAD)
    for share in (0.2, 0.6):
        creepage = share * FRICTION * HALF / radius
        coarse, fine = (_cylinder_force(cells, creepage, modulus) for cells in (40, 80))
        closed = exact.carter_force(creepage, FRICTION, HALF, radius) * FRICTION * LOAD
        name = f"rolling cylinder at {share:g} of the creepage that slides (Carter)"
        yield name, "N", 2 * fine - coarse, closed


def _cylinder_force(cells: int, creepage: float, modulus: float) -> float:
    """Traction of a cylinder 1 m wide on a half-space, N."""
    x, pitch = _line(cells)
    edges = np.clip(np.stack([x - pitch / 2, x + pitch / 2]) / HALF, -1, 1)
    over = edges * np.sqrt(1 - edges**2) + np.arcsin(edges)
    normal = LOAD * np.diff(over, axis=0)[0] / np.pi
    # Strips 80 m long; the displacement of plane strain has no zero: it is set to 0 at the
    # contact's width.
    strip, half = np.float64(40.0), np.float64(pitch / 2)
    lone = rectangle_potential(x[:, None] - x, 0 * x, half, strip)
    lone -= rectangle_potential(np.array(2.2 * HALF), np.array(0.0), half, strip)
    compliance = lone / (np.pi * modulus * pitch)
    return _steady(x, normal, creepage, 1e3 / compliance[0, 0], compliance)


def _line(cells: int) -> tuple[np.ndarray, float]:
    """Centres of `cells` cells over the contact and three more on each side, and their pitch, m."""
    pitch = 2 * HALF / cells
    return pitch * (np.arange(cells + 6) - (cells + 5) / 2), pitch


def _steady(x, normal, slip: float, stiffness: float, compliance) -> float:
    """Total horizontal force (N) on a line of points after five passages under given normal forces.

    `compliance` (c, c) m/N of the body to forces along the line.
    """
    c, way = len(x), x[1] - x[0]
    tire = np.zeros((3 * c, 3 * c))
    tire[c : 2 * c, c : 2 * c] = tire[2 * c :, 2 * c :] = compliance
    law = BrushLaw(stiffness, FRICTION, (slip, 0.0))
    brush = Brush(law, x, np.zeros(c, int), way, 1.0)
    brush.begin(normal > 0)
    friction, solver = BrushFriction(brush, tire, None), ActiveSet(np.eye(c))
    gap, free = np.where(normal > 0, 0.0, 1.0), np.zeros(2 * c)
    for _ in range(10 * round(HALF / way)):
        _, horizontal = friction.solve(solver, gap, normal > 0, normal, free)
    return float(horizontal[:, 0].sum())


def shear_rows() -> Iterator[tuple]:
    """All cases.

    For a disc of radius 1 m in cells, `n` across it; forces are scaled by the cells' total area. A
    body on a rigid road behaves like two equal ones with twice the shear modulus.
    """
    for nu in (0.25, 0.5):
        yield from pushed(nu, 24)
    for cells in (12, 24):
        exact = float(np.log(3.0))
        name = f"punch that sticks to a half-space, nu = 0, {cells} cells (Mossakovskii, Spence)"
        yield name, "-", bonded(0.0, cells), exact
    for nu, table in KALKER.items():
        for cells in CELLS:
            for k, (coefficient, exact) in enumerate(zip(creep(nu, cells), table, strict=True)):
                name = f"rolling, C{('11', '22', '23')[k]}, nu = {nu:g}, {cells} cells (Kalker)"
                yield name, "-", coefficient, exact


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


class _Uncoupled(KernelShear):
    """For two equal bodies: pressure moves both sideways by the same amount."""

    def __init__(self, grid: GridPlaces, shear: Influence) -> None:
        super().__init__(grid, shear)
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
    stiffness = PlaneCompliance(np.zeros((2 * count, 2 * count)), shear=disc.shear(nu))
    for share in (0.3, 0.7):
        shift = 3 * SHEAR_FRICTION * total * (2 - nu) / 16 * (1 - (1 - share) ** (2 / 3))
        moved = np.tile([-shift, 0.0], (count, 1))
        force = stick_slip(stiffness, moved, SHEAR_FRICTION * normal, np.zeros((count, 2)))
        sticks = np.linalg.norm(force, axis=1) < SHEAR_FRICTION * normal * (1 - 1e-6)
        name = f"sphere, nu = {nu:g}, {cells} cells, pushed to {share:g} of sliding (Cattaneo, Mindlin), "
        yield name + "force", "N", float(force[:, 0].sum()), share * SHEAR_FRICTION * total
        radius = float(np.sqrt(sticks.sum() * disc.pitch**2 / np.pi))
        yield name + "radius that sticks", "m", radius, (1 - share) ** (1 / 3)


def bonded(nu: float, cells: int) -> float:
    """Load of a sticking flat punch over a frictionless one: ln(3 - 4 nu)(1 - nu)/(1 - 2 nu)."""
    disc = Disc(cells)
    count = len(disc.x)
    tread = KernelTread(disc.grid, _down(nu))
    solver = ActiveSet(tread.block(np.arange(count), np.arange(count)))
    brush = Brush(BrushLaw(np.inf, kind="spring"), disc.x, disc.line, 0.0, 1.0)
    friction = BrushFriction(brush, np.zeros((3 * count, 3 * count)), None, disc.shear(nu))
    gap, touching, none = np.full(count, -1e-3), np.ones(count, dtype=bool), np.zeros(count)
    force = friction.solve(solver, gap, touching, none, np.zeros(2 * count))[0]
    return float(force.sum() / solver.solve(gap, touching).sum())


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
    friction = BrushFriction(
        brush, np.zeros((3 * count, 3 * count)), None, _Uncoupled(disc.grid, _sideways(nu))
    )
    solver, normal = ActiveSet(np.eye(count)), 1.0 * disc.inside
    gap, free, last = 1.0 - normal, np.zeros(2 * count), np.zeros(2)
    for _ in range(round(10 / disc.pitch)):
        total = friction.solve(solver, gap, disc.inside, normal, free)[1].sum(axis=0)
        if np.abs(total - last).max() < SETTLED * np.abs(total).max():
            break
        last = total
    return last


def creep_rows() -> Iterator[tuple]:
    """The largest pressure at each relaxation time.

    Two cylinders of polyamide: G, nu, common radius, load of 1 m, speed. Wang and Knothe, J. Appl.
    Mech. 60 (1993) 310.
    """
    for time, published in PUBLISHED.items():
        name = f"rolling cylinder that creeps, relaxation in {time:g} s, largest pressure (Wang, Knothe)"
        yield name, "MPa", rolled_strip(time).max(), published
    for time, published in CREEPAGES.items():
        name = f"the same with traction, relaxation in {time:g} s, creepage (CONTACT)"
        yield name, "-", CreepingRoller(time).creepage(), published


def influence(x: Array, y: Array, a: Array, b: Array) -> Array:
    """Influence of one point's rectangle, m/Pa."""
    return INFLUENCE(x, y, a, b)


def _plane_strain(x: Array, y: Array, a: Array, b: Array) -> Array:
    """Influence of one point's rectangle in the plane, m/N."""
    return half_space_shear(x, y, a, b, (1 + NU) * SHEAR, NU)


def cylinder() -> Patch:
    """One line of points a metre wide: plane strain in the middle."""
    x = (np.arange(POINTS) - POINTS // 2) * DX
    nothing = np.zeros(POINTS)
    return Patch(
        index=np.arange(POINTS),
        points=np.stack([x, nothing, nothing], axis=-1),
        half_sizes=np.tile([DX / 2, DY / 2], (POINTS, 1)),
        force=nothing,
        gap=x**2 / (2 * RADIUS),
        edge=np.zeros(POINTS, bool),
        line=np.zeros(POINTS, int),
        places=GridPlaces((POINTS, 1), (DX, DY), np.arange(POINTS)),
    )


def pressed(solver: ActiveSet, gap: np.ndarray) -> np.ndarray:
    """Pressures (MPa) under the load."""

    def excess(approach: float) -> float:
        return float(solver.solve(gap - approach).sum() - CREEP_LOAD)

    approach = brentq(excess, 0.0, 1e-2, xtol=1e-15)
    return solver.solve(gap - approach) / (DX * DY) / 1e6


def matrix(patch: Patch) -> np.ndarray:
    """Compliance between the points, m/N."""
    return dense_compliance(patch.points[:, :2], patch.half_sizes, influence)


def rolled_strip(time: float) -> np.ndarray:
    """Pressures (MPa) of the rolling cylinder with one relaxation `time` (s), modulus halved."""
    patch, creep = cylinder(), (np.array([1.0]), np.array([time]))
    tread = WholeGrid(patch.places, influence, behind=BEHIND)
    past = steadily(creep, tread.places, CREEP_SPEED, np.eye(len(patch.points)))
    moved = np.stack([tread(each[None])[0] for each in past.T], axis=1)
    return pressed(ActiveSet(moved), patch.gap)


class CreepingRoller:
    """The rolling cylinder with traction, in steps of a cell: bristles, and the memory of the tread in its plane."""

    def __init__(self, time: float) -> None:
        patch = cylinder()
        self.normal = rolled_strip(time) * 1e6 * DX * DY
        self.inside = self.normal > 0
        creep = np.array([1.0]), np.array([time])
        tread = WholeGrid(patch.places, influence, _plane_strain, BEHIND)
        self.memory = TreadMemory(creep, tread, DX, CREEP_SPEED, DX / CREEP_SPEED)
        self._steady = partial(steadily, creep, tread.places, CREEP_SPEED)
        brush = Brush(BrushLaw(np.inf, CREEP_FRICTION), patch.points[:, 0], patch.line, DX, 1.0)
        brush.begin(self.inside)
        at_once = self.memory.at_once
        alone = _Uncoupled(patch.places, lambda *at: at_once * _plane_strain(*at))
        self.friction = BrushFriction(
            brush, np.zeros((3 * POINTS,) * 2), None, alone, tolerance=1e-6
        )

    def creepage(self) -> float:
        """The creepage that has the traction."""
        wanted = TRACTION * CREEP_FRICTION * CREEP_LOAD
        found = root_scalar(lambda creep: self.force(creep) - wanted, x0=8e-3, x1=1.2e-2, rtol=1e-4)
        return float(found.root)

    def force(self, creepage: float) -> float:
        """Force (N) along the road at a creepage, rolled until steady."""
        self.friction.creep((creepage, 0.0))
        gap, none, last = np.where(self.inside, 0.0, 1.0), np.zeros(POINTS), np.inf
        for _ in range(PASSED):
            for _ in range(PASSED):
                moved = np.ascontiguousarray(self.memory.predict()[1:]).ravel()
                t = self.friction.solve(
                    ActiveSet(np.eye(POINTS)), gap, self.inside, self.normal, moved
                )[1]
                self.memory.advance(np.concatenate([none, *t.T]))
            total = abs(t[:, 0].sum())
            if abs(total - last) < SETTLED * total:
                return float(total)
            last = total
            # A slow creep takes many passages: it goes on from what the present forces would have in the end.
            field = self.memory.state()["creep_force"]
            crept = self._steady(t).T - field[1:].reshape(2, -1)
            parts = np.stack([np.zeros(crept.shape[1]), *crept]).reshape(1, *field.shape)
            self.memory.set_state({"creep": parts, "creep_force": field})
        raise ConvergenceError("the rolling cylinder is not steady")


class Rigid:
    """A rigid tire."""

    comm = MPI.COMM_SELF

    def __init__(self, count: int) -> None:
        self.same_step = np.zeros((count, count))

    def start(self, force: np.ndarray) -> None: ...

    def predict(self) -> np.ndarray:
        return np.zeros(len(self.same_step))

    def advance(self, force: np.ndarray) -> None: ...

    def inertia_force(self) -> np.ndarray:
        return np.zeros(3)

    def snapshot(self) -> dict[str, np.ndarray]:
        return {}

    def restore(self, state: dict[str, np.ndarray]) -> None: ...


def grooved_rows() -> Iterator[tuple]:
    """Mean and the first three orders.

    For grooves that never touch, on a bed of springs, F(t) is the sum of the slick's forces over
    the land. Its order n is the groove's Fourier coefficient sin(n pi w/l)/(n pi), with groove
    width w and pitch l, times the transform of the slick's force along x.
    """
    force, _ = rolled(
        grooves(width=WIDTH, depth=0.05, flank=1e-4), round(TIMES * AROUND / PITCHES / SPEED / STEP)
    )
    yield (
        "patterned tread, mean force",
        "N",
        force.mean(),
        GROOVED_LOAD * (1 - WIDTH * PITCHES / AROUND),
    )
    for order, value in zip((1, 2, 3), orders(force), strict=True):
        yield f"patterned tread, order {order} of its pitches", "N", value, by_hand(order)


def orders(force: np.ndarray) -> np.ndarray:
    """Amplitudes (3,) N of the first orders of a force (steps,) N."""
    lines = 2 * np.abs(np.fft.rfft(force - force.mean())) / len(force)
    return lines[TIMES * np.array([1, 2, 3])]


def by_hand(order: int) -> float:
    """The amplitude of an order in closed form, N."""
    slick, pitch = oval(), AROUND / PITCHES
    along = abs(np.sum(slick.force * np.exp(2j * np.pi * order * slick.points[:, 0] / pitch)))
    return float(abs(2 * np.sin(np.pi * order * WIDTH / pitch) / (np.pi * order)) * along)


def oval() -> Patch:
    """The footprint of a slick."""
    return oval_patch((120, 5), (0.001, 0.02), GROOVED_LOAD)


def grooves(**given) -> Pattern:
    """One groove per pitch, all pitches equal."""
    return Pattern(AROUND, [GrooveTable(**given)], pitch_starts(PITCHES, [1.0], 1, AROUND))


def rolled(pattern: Pattern | None, steps: int) -> tuple[np.ndarray, Patch]:
    """Vertical force (steps,) N of a rigid tire on springs on a flat road, and its patch."""
    patch = oval()
    bed = winkler_compliance(patch.area, BED)
    patch = replace(patch, gap=np.where(patch.force > 0, 0.0, patch.gap))
    way = Rolled(speed=SPEED, duration=steps * STEP)
    _, x1, y0, y1 = patch.extent
    road = RoadUnderTire(Flat()).prepare(x1, x1 + way.travel, y0, y1)
    setup = ContactSetup(patch=patch, reach=1.0, road=road, rolled=way, pattern=pattern)
    if pattern is not None:  # settled: points over a groove carry nothing
        begun = setup.begun
        free = np.maximum(patch.force - begun / np.diag(bed), 0.0)
        lifted = np.maximum(begun - np.diag(bed) * patch.force, 0.0)
        carried = np.where(begun > 0, free, patch.force)
        setup = replace(setup, patch=replace(patch, force=carried, gap=patch.gap + lifted))
    run = roll(Rigid(len(patch.points)), ActiveSet(bed), setup.patch, setup.drive, STEP, steps)
    return np.array([row.force.sum() for row in run]), setup.patch


@dataclass(frozen=True, kw_only=True)
class Roller:
    """Dimensions of the roller and its mesh, m.

    `outer` radius; `thickness` of the rubber; `width`; elements of `size` up to a distance `reach`
    from the lowest point.

    A torus with such a large section circle that the strip in use is flat; its inner face is held,
    and nothing moves along the axle. Elements are small at the road and grow from there around and
    inwards.
    """

    outer: float = 0.3
    thickness: float = 0.1
    width: float = 0.01
    size: float = 2.5e-3
    reach: float = 0.019
    youngs_modulus: float = 1e6
    poisson_ratio: float = 0.49

    @property
    def modulus(self) -> float:
        """E / (1 - nu^2), Pa."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    def hertz_load(self, half: float) -> float:
        """Load (N) of a contact of half length `half` (m) on a half-space of this rubber."""
        return np.pi / 4 * self.modulus * half**2 / self.outer * self.width

    def body(self) -> Body:
        """The finite-element body, on this process alone."""
        half = self.width / 2 / FLAT
        torus = Torus(
            outer_radius=self.outer,
            minor_radius=FLAT,
            thickness=self.thickness,
            half_angle=half,
            segments=8,
            elements_arc=1,
            elements_thickness=1,
            order=2,
            grading="uniform",
        )
        around = _graded(self.size, np.pi * self.outer, self.reach) / self.outer
        depth = _graded(self.size, self.thickness, self.reach / 2) / self.thickness
        section = product_mesh(
            order=2, wall=1 - depth[::-1], arc=np.array([-half, half]), place=torus._place
        )
        ring = replace(
            torus.ring(),
            section=section,
            ring_corners=np.append(around, 2 * np.pi - around[-2::-1]),
            coarser=lambda: None,
        )
        rubber = compound(
            "neo-hookean",
            1000.0,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
        )
        body = Body(MPI.COMM_SELF, ring, {"wall": rubber})
        body.rim, tread = body._face_dofs(INNER), body._face_dofs(TREAD)
        body.tread = tread[tread < body.nodes]
        return body


def _graded(size: float, end: float, reach: float) -> np.ndarray:
    """Corners (m) from 0 to `end`, spaced by `size` up to `reach`, then increasingly wider."""
    places = [0.0]
    while places[-1] < end:
        if places[-1] >= reach:
            size *= _GROWTH
        places.append(places[-1] + size)
    return np.array(places) * end / places[-1]


def plane(equilibrium: E) -> E:
    """The same problem without motion along the axle."""
    body, axial = equilibrium.body, equilibrium.body.space.sub(1)
    collapsed, _ = axial.collapse()
    everywhere = fem.locate_dofs_geometrical(
        (axial, collapsed), lambda x: np.full(x.shape[1], True)
    )
    equilibrium._clamp.append(fem.dirichletbc(fem.Function(collapsed), everywhere, axial))
    along = np.setdiff1d(np.arange(1, 3 * body.nodes, 3), 3 * body.rim + 1)
    equilibrium._rim = np.union1d(equilibrium._rim, along)
    return equilibrium


def middle(equilibrium: Equilibrium) -> tuple[np.ndarray, np.ndarray]:
    """Positions x (m) of the touching nodes in the middle of the width, and their tread indices."""
    body = equilibrium.body
    points = body.space.tabulate_dof_coordinates()[body.tread]
    x = points[:, 0] + body.owned(body.u.x.array)[body.tread, 0]
    some = np.flatnonzero((np.abs(points[:, 1]) < 1e-9) & equilibrium.road.active)
    some = some[np.argsort(x[some])]
    return x[some], some


STIFF = Roller()
LAYER = Roller(outer=1.0, size=1e-3, reach=0.025, poisson_ratio=0.0)


def static_friction_rows() -> Iterator[tuple]:
    """All cases."""
    for pushed in standing(STIFF):
        name = f"roller pushed sideways to {pushed.share:.2f} of sliding, traction in the middle (Cattaneo, Mindlin)"
        yield name, "-", pushed.in_the_middle, 1 - np.sqrt(1 - pushed.share)
    for share, value in rolling(STIFF, (0.2, 0.6)):
        closed = exact.carter_force(
            share * STATIC_FRICTION * STATIC_HALF / STIFF.outer,
            STATIC_FRICTION,
            STATIC_HALF,
            STIFF.outer,
        )
        name = (
            f"roller at {share:g} of the creepage that slides, force over that of sliding (Carter)"
        )
        yield name, "-", value, closed
    thick, thin = (over_brush(replace(LAYER, thickness=thickness)) for thickness in (4e-3, 2e-3))
    name = "roller with a layer that sticks, force over that of bristles, from 4 and 2 mm to none (brush)"
    yield name, "-", 2 * thin - thick, 1.0


class Pressed:
    """A roller under a load (N) without friction; `rubbing` adds the friction of a tread model."""

    def __init__(self, roller: Roller, load: float, friction: float) -> None:
        self.roller, self.load, self.friction = roller, load, friction
        self.body = roller.body()
        self._without = plane(Equilibrium(self.body, AT_REST))
        height = -roller.outer + 0.01 * roller.thickness
        for part in (0.25, 0.5, 1.0):
            step = self._without.solve(height, load=part * load)
            height = self._without.road.height
            _check(step.converged)

    def rubbing(self, sliding: Sliding) -> RubbingEquilibrium:
        """The problem with friction, starting from the state without."""
        arguments = self.body, AT_REST, self.friction, sliding
        problem = plane(RubbingEquilibrium(*arguments))
        problem.road.take(self._without.contact_force(), self._without.road_height)
        return problem


class Pushed:
    """`x` (n,) m of the touching nodes in the middle of the width, `normal` and `pull` (n,) N."""

    def __init__(self, problem: RubbingEquilibrium, friction: float) -> None:
        self.x, some = middle(problem)
        self.normal, self.pull = problem.road.force[some], problem.road.pull[some, 0]
        self._friction = friction
        self.share = float(problem.road.pull[:, 0].sum() / friction / problem.road.force.sum())

    @cached_property
    def used(self) -> np.ndarray:
        """Tangential force over the force at which a node slides, (n,)."""
        return self.pull / (self._friction * self.normal)

    @property
    def in_the_middle(self) -> float:
        """`used` in the middle of the contact."""
        return float(np.interp(0.5 * (self.x[0] + self.x[-1]), self.x, self.used))


def standing(roller: Roller, pushes: tuple[float, ...] = (2e-4, 4e-4)) -> Iterator[Pushed]:
    """The road pushed sideways (m) under the roller."""
    load = roller.hertz_load(STATIC_HALF)
    pressed = Pressed(roller, load, STATIC_FRICTION)
    sliding = StandingFriction(pressed.body)
    problem = pressed.rubbing(sliding)
    for push in pushes:
        sliding.place[0] = push
        _check(problem.solve(problem.road.height, load=load).converged)
        yield Pushed(problem, STATIC_FRICTION)


def rolling(roller: Roller, shares: tuple[float, ...]) -> Iterator[tuple[float, float]]:
    """(share of the creepage of full sliding, force over that of full sliding), driving."""
    full = STATIC_FRICTION * STATIC_HALF / roller.outer
    drag = RollingCase(Pressed(roller, roller.hertz_load(STATIC_HALF), STATIC_FRICTION))
    for share in shares:
        yield share, drag(drag.free * (1 - share * full)).share


class RollingCase:
    """The rolling roller; `free` m: its travel per radian without drag."""

    def __init__(self, pressed: Pressed) -> None:
        self._pressed, radius = pressed, pressed.roller.outer
        self._sliding = Passing(pressed.body, radius)
        self._problem = pressed.rubbing(self._sliding)
        root = root_scalar(
            lambda trial: self(trial).share,
            method="secant",
            x0=radius,
            x1=radius * (1 - 1e-5),
            xtol=1e-9 * radius,
        )
        _check(root.converged)
        self.free = float(root.root)

    def __call__(self, travel: float) -> Pushed:
        """The state at that travel, m per radian."""
        self._sliding.radius = travel
        step = self._problem.solve(self._problem.road.height, load=self._pressed.load)
        _check(step.converged)
        return Pushed(self._problem, self._pressed.friction)


def over_brush(roller: Roller, creepage: float = 1e-3, half: float = 0.02) -> float:
    """Force of a layer that sticks throughout, over that of a brush of its G / thickness.

    nu = 0: each column of the layer carries for itself, p = E/h (half^2 - x^2)/2R. It drags its
    neighbours along over a length of its thickness, so the difference is of first order in that.
    """
    h, width, young = roller.thickness, roller.width, roller.youngs_modulus
    load = young / h * 2 * half**3 / 3 / roller.outer * width
    drag = RollingCase(Pressed(roller, load, friction := 10.0))
    force = drag(drag.free * (1 - creepage)).share * friction * load
    return force / (young / 2 / h * creepage * 2 * half**2 * width)


def _check(fine: bool) -> None:
    if not fine:
        raise ConvergenceError("roller: no balance with friction was found: take other elements")
