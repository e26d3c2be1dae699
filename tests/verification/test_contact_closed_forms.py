"""The tread and the contact solver together, against Hertz and the rigid square punch."""

import numpy as np
import pytest

from contact.closed_forms import (
    SQUARE_PUNCH,
    contact_modulus,
    hertz_cylinder,
    hertz_sphere,
    hertz_sphere_load,
    square_punch_load,
)
from contact.complementarity import ActiveSet
from contact.tread import half_space_compliance

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
