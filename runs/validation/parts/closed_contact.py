"""Contact on a half-space and under a brush against closed forms: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tireroad.contact import closed_forms as exact
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import Friction, Stiffness, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_compliance, rectangle_potential

YOUNG, POISSON = 3.4e6, 0.49
MODULUS = exact.contact_modulus(YOUNG, POISSON)
FRICTION, LOAD, HALF = 0.4, 1000.0, 0.02  # of the rolling cylinder and the brush: -, N, m


def rows() -> Iterator[tuple]:
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
    one = np.float64(1.0)
    for name, place, share in (("centre", 0.0, 1.0), ("corner", 1.0, 0.5)):
        found = float(rectangle_potential(np.array(place), np.array(place), one, one))
        yield (
            f"uniform pressure on a square, {name} (Love)",
            "-",
            found,
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
    found = float((force / (4 * half_sizes[0].prod())).max())
    yield "cylinder, pressure in the middle (Hertz)", "Pa", found, closed.peak_pressure


def _punch() -> tuple:
    """Aitken's extrapolation of three grids: the edge singularity leaves one power of the size."""
    side, approach, loads = 0.02, 1e-3, []
    for n in (8, 16, 32):
        points, half_sizes = _cells(side, side, n, n)
        loads.append(_half_space(points, half_sizes).solve(np.full(n * n, -approach)).sum())
    coarse, middle, fine = loads
    found = fine - (fine - middle) ** 2 / ((fine - middle) - (middle - coarse))
    return (
        "rigid square punch, load",
        "N",
        float(found),
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
    both = np.kron(potential / (2 * np.pi * pitch**2), np.eye(2))
    matrix = Stiffness(np.asarray(both, dtype=float))
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
        found = _steady(x, normal, slip, tread * pitch, np.zeros((len(x), len(x))))
        closed = exact.brush_force(slip, FRICTION, LOAD, HALF, tread)
        yield f"rolling brush, slip {slip:g} (Pacejka)", "N", found, closed


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
    friction, solver = Friction(brush, tire, None), ActiveSet(np.eye(c))
    gap, free = np.where(normal > 0, 0.0, 1.0), np.zeros(2 * c)
    for _ in range(10 * round(HALF / way)):
        _, horizontal = friction.solve(solver, gap, normal > 0, normal, free)
    return float(horizontal[:, 0].sum())
