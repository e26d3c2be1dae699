"""Contact on a half-space and under a brush against closed forms: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from contact import closed_forms as exact
from contact.brush import Brush, BrushLaw
from contact.complementarity import ActiveSet
from contact.flat import Flat
from contact.friction import Friction
from contact.patch import Patch
from contact.rolling import Drive, roll
from contact.tangential import stick_slip
from contact.tread import half_space_compliance, rectangle_potential, winkler_compliance

YOUNG, POISSON = 3.4e6, 0.49
MODULUS = exact.contact_modulus(YOUNG, POISSON)


def rows() -> Iterator[tuple]:
    """All of them."""
    yield from _love()
    yield from _sphere()
    yield from _cylinder()
    yield _punch()
    yield from _cattaneo_mindlin()
    yield from _rolling_brush()


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
    # Strips 2000 half widths long: their ends change the middle by (1/2000)^2.
    radius, half_width = 0.3, 0.02
    points, half_sizes = _cells(1.2 * half_width, 40.0, 120, 1)
    force = _half_space(points, half_sizes).solve(points[:, 0] ** 2 / (2 * radius) - 2e-3)
    closed = exact.hertz_cylinder(force.sum() / 80.0, radius, MODULUS)
    found = float((force / (4 * half_sizes[0].prod())).max())
    yield "cylinder, pressure in the middle (Hertz)", "Pa", found, closed.peak_pressure


def _punch() -> tuple:
    """Aitken's extrapolation of three grids: the edge singularity leaves one power of the cell size."""
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
    matrix = np.kron(potential / (2 * np.pi * pitch**2), np.eye(2))
    total = normal.sum()
    for share in (0.3, 0.7):
        shift = 3 * friction * total / 8 * (1 - (1 - share) ** (2 / 3))
        pushed = np.tile([-shift, 0.0], (len(x), 1))
        force = stick_slip(matrix, pushed, friction * normal, np.zeros((len(x), 2)))
        name = f"sphere pushed sideways to {share:g} of sliding (Cattaneo, Mindlin)"
        yield name, "N", float(force[:, 0].sum()), share * friction * total


class _Rigid:
    """A tire that does not give way."""

    def __init__(self, count: int) -> None:
        self.same_step = np.zeros((3 * count, 3 * count))

    def predict(self) -> np.ndarray:
        return np.zeros(len(self.same_step))

    def advance(self, force: np.ndarray) -> None:
        pass

    def inertia_force(self) -> np.ndarray:
        return np.zeros(3)


def _rolling_brush() -> Iterator[tuple]:
    """Bristles under a parabola of pressure (Fromm 1927; Pacejka, Tire and Vehicle Dynamics, 3.2):

    F = mu P (3 z - 3 z^2 + z^3), z = theta s <= 1, theta = 2 c a^2/(3 mu P), c the bristles' stiffness
    per length, s the slip.
    """
    half, load, friction, count = 0.1, 500.0, 0.8, 120
    pitch = 2 * half / count
    x = (np.arange(count) - (count - 1) / 2) * pitch
    patch = _line(x, load * (1 - (x / half) ** 2) / (1 - (x / half) ** 2).sum(), pitch)
    stiffness = 2e6 * pitch
    theta = 2 * (stiffness / pitch) * half**2 / (3 * friction * load)
    for part in (0.1, 0.5, 2.0):
        law = BrushLaw(stiffness, friction, (part / theta, 0.0))
        brush = Brush(law, x, patch.line, 10.0, pitch / 10.0)
        brush.begin(patch.force > 0)
        rigid = _Rigid(count)
        solver = ActiveSet(winkler_compliance(patch.area, 1e9))
        drive = Drive(Flat().height, lambda t: 0.0, 10.0)
        coupling = Friction(brush, rigid.same_step, None)
        *_, last = roll(rigid, solver, patch, drive, pitch / 10.0, count + 5, coupling)
        z = min(part, 1.0)
        name = f"rolling brush at {part:g} of the slip that slides (Fromm, Pacejka)"
        closed = friction * load * (3 * z - 3 * z**2 + z**3)
        yield name, "N", float(last.horizontal[:, 0].sum()), closed


def _line(x: np.ndarray, force: np.ndarray, pitch: float) -> Patch:
    """Points of one line along the rolling direction, all touching."""
    count = len(x)
    return Patch(
        index=np.arange(count),
        points=np.column_stack([x, 0 * x, 0 * x]),
        half_sizes=np.full((count, 2), pitch / 2),
        force=force,
        gap=np.zeros(count),
        edge=np.zeros(count, dtype=bool),
        line=np.zeros(count, dtype=int),
    )
