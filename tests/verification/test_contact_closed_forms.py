"""The tread and the contact solver together, against Hertz and the rigid square punch."""

import numpy as np
import pytest
from scipy.optimize import brentq

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import MatrixCompliance, ProjectedCG
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.tests.reference.closed_forms import (
    SQUARE_PUNCH,
    contact_modulus,
    hertz_cylinder,
    hertz_sphere,
    hertz_sphere_load,
    square_punch_load,
    westergaard_mean,
    westergaard_pressure,
)

YOUNG, POISSON = 3.4e6, 0.49
MODULUS = contact_modulus(YOUNG, POISSON)


def cells(half_x: float, half_y: float, nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres and half sizes of nx x ny equal rectangles that fill 2 half_x x 2 half_y."""
    x = half_x * ((2 * np.arange(nx) + 1) / nx - 1)
    y = half_y * ((2 * np.arange(ny) + 1) / ny - 1)
    points = np.column_stack([c.ravel() for c in np.meshgrid(x, y, indexing="ij")])
    return points, np.tile([half_x / nx, half_y / ny], (nx * ny, 1))


def test_hertz_sphere() -> None:
    radius, approach = 0.3, 1e-3
    contact_radius = np.sqrt(radius * approach)
    points, half_sizes = cells(1.15 * contact_radius, 1.15 * contact_radius, 29, 29)
    solver = ActiveSet(half_space_compliance(points, half_sizes, YOUNG, POISSON))
    force = solver.solve((points**2).sum(axis=1) / (2 * radius) - approach)
    load = force.sum()
    exact = hertz_sphere(load, radius, MODULUS)
    area = 4 * half_sizes[0].prod()
    assert load == pytest.approx(hertz_sphere_load(approach, radius, MODULUS), rel=5e-3)
    assert approach == pytest.approx(exact.approach, rel=5e-3)
    assert force.max() / area == pytest.approx(exact.peak_pressure, rel=5e-3)
    measured = np.sqrt(solver.active.sum() * area / np.pi)
    assert measured == pytest.approx(exact.radius, rel=2e-2)


def test_hertz_cylinder() -> None:
    # Strips 2000 half widths long: their ends change the middle by (1/2000)^2.
    radius, half_width = 0.3, 0.02
    points, half_sizes = cells(1.2 * half_width, 40.0, 120, 1)
    solver = ActiveSet(half_space_compliance(points, half_sizes, YOUNG, POISSON))
    curved = points[:, 0] ** 2 / (2 * radius)
    approach = 2.0e-3
    force = solver.solve(curved - approach)
    per_length = force.sum() / 80.0
    exact = hertz_cylinder(per_length, radius, MODULUS)
    pressure = force / (4 * half_sizes[0].prod())
    inside = np.abs(points[:, 0]) < 0.8 * exact.half_width
    profile = exact.peak_pressure * np.sqrt(1 - (points[inside, 0] / exact.half_width) ** 2)
    assert pressure.max() == pytest.approx(exact.peak_pressure, rel=5e-3)
    assert np.abs(pressure[inside] - profile).max() < 5e-3 * exact.peak_pressure
    assert 2 * exact.half_width == pytest.approx(
        solver.active.sum() * 2 * half_sizes[0, 0], rel=5e-2
    )


def test_rigid_square_punch_by_extrapolation() -> None:
    half_side, approach = 0.02, 1e-3
    loads = []
    for n in (8, 16, 32):
        points, half_sizes = cells(half_side, half_side, n, n)
        solver = ActiveSet(half_space_compliance(points, half_sizes, YOUNG, POISSON))
        loads.append(solver.solve(np.full(n * n, -approach)).sum())
    coarse, middle, fine = np.array(loads) / (MODULUS * half_side * approach)
    # Aitken: the edge singularity leaves one power of the cell size.
    limit = fine - (fine - middle) ** 2 / ((fine - middle) - (middle - coarse))
    assert limit == pytest.approx(SQUARE_PUNCH, rel=1e-3)
    errors = SQUARE_PUNCH - np.array([coarse, middle, fine])
    slopes = np.log2(errors[:-1] / errors[1:])
    assert np.all(slopes > 0.9) and np.all(slopes < 1.1)
    assert square_punch_load(approach, half_side, MODULUS) == pytest.approx(loads[-1], rel=2e-2)


class Waves:
    """A period of a half-space under rigid waves: pressure of wave number k moves it by 2/(E* |k|).

    That of k = 0 is free, as the approach is: any positive value will do.
    """

    def __init__(self, cells: int, solver: str) -> None:
        self.length, self.height = 0.05, 1e-4
        self.x = self.length / cells * (np.arange(cells) - cells // 2)
        wave = np.abs(2 * np.pi * np.fft.fftfreq(cells, self.length / cells))
        wave[0] = 2 * np.pi / self.length
        kernel = np.fft.ifft(2 / (MODULUS * wave)).real
        matrix = kernel[np.subtract.outer(np.arange(cells), np.arange(cells)) % cells]
        many = solver == "projected-cg"
        self.solver = ProjectedCG(MatrixCompliance(matrix)) if many else ActiveSet(matrix)

    def pressed(self, mean: float) -> np.ndarray:
        """Pressure (Pa) under a mean one."""
        raised = self.height * (1 - np.cos(2 * np.pi * self.x / self.length))

        def excess(approach: float) -> float:
            return self.solver.solve(raised - approach).mean() - mean

        approach = brentq(excess, 0.0, 20 * self.height, xtol=1e-14)
        return self.solver.solve(raised - approach)


@pytest.mark.parametrize("solver", ["active-set", "projected-cg"])
@pytest.mark.parametrize("fraction", [0.03, 0.3, 0.7, 0.97])
def test_westergaard_from_near_no_contact_to_near_full(fraction: float, solver: str) -> None:
    waves, cells = Waves(600, solver), 600
    given = fraction, waves.height, waves.length, MODULUS
    found = waves.pressed(westergaard_mean(*given))
    assert np.mean(found > 0) == pytest.approx(fraction, abs=2.1 / cells)
    exact = westergaard_pressure(waves.x, *given)
    # Vertical at the edges of contact: half a cell there is worth more than anywhere else.
    inside = np.abs(2 * np.abs(waves.x) / waves.length - fraction) > 2 / cells
    assert np.abs(found - exact)[inside].max() < 0.02 * exact.max()


@pytest.mark.parametrize("solver", ["active-set", "projected-cg"])
def test_full_contact_of_waves_is_linear(solver: str) -> None:
    waves = Waves(200, solver)
    full = westergaard_mean(1.0, waves.height, waves.length, MODULUS)
    found = waves.pressed(1.05 * full)
    exact = full * (1.05 + np.cos(2 * np.pi * waves.x / waves.length))
    assert np.abs(found - exact).max() < 1e-6 * full


@pytest.mark.slow
def test_figure_5_5_of_the_thesis() -> None:
    """Roughness peaks in a half-space of 20 MPa, nu = 0.49: they touch, nothing goes through, and the
    surface around a peak that is one point wide follows, as it would not if points were on their own."""
    points, half_sizes = cells(0.02, 0.02, 41, 41)
    matrix = half_space_compliance(points, half_sizes, 20e6, 0.49)
    peaks = {(20, 20): 4e-4, (8, 30): 3e-4, (30, 12): 3e-4, (31, 12): 3e-4, (21, 21): 5e-5}
    road = np.full((41, 41), -5e-3)
    for place, height in peaks.items():
        road[place] = height
    solver = ActiveSet(matrix)
    force = solver.solve(-road.ravel())
    moved = (matrix @ force).reshape(41, 41)
    pressed = force.reshape(41, 41) > 0
    # The lowest peak stands in the hollow that its higher neighbour makes, and carries nothing.
    assert pressed[20, 20] and pressed[8, 30] and pressed[30, 12] and pressed[31, 12]
    assert pressed.sum() == 4
    assert np.allclose(moved[pressed], road[pressed], rtol=1e-9)
    assert np.all(moved >= road - 1e-12)
    # One peak alone, away from it: Boussinesq's F/(pi E* r).
    alone = np.where(np.arange(41 * 41) == 20 * 41 + 20, 4e-4, -5e-3)
    force = solver.solve(-alone)
    moved = (matrix @ force).reshape(41, 41)
    away = points.reshape(41, 41, 2)[20, 22:, 1]
    around = force.sum() / (np.pi * contact_modulus(20e6, 0.49) * away)
    assert np.allclose(moved[20, 22:], around, rtol=0.02)
    assert moved[20, 21] > 0.25 * moved[20, 20]
