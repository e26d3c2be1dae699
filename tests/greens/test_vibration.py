"""Vibration of the whole tire: against the response it stands for, and on surfaces known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tireroad.contact.results.levels import a_weighting, band_sums
from tireroad.greens.vibration import Surface, coordinates, mean_square_velocity
from tireroad.modal.rotating import rotating


@pytest.fixture
def states():
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 6, 6))
    stiffness = 4e4 * (a @ a.T + 6 * np.eye(6))
    return rotating(40 * np.eye(6) + 30 * (b - b.T), stiffness), (
        40 * np.eye(6) + 30 * (b - b.T),
        stiffness,
    )


def test_coordinates_solve_the_equation_of_motion(states):
    """(-w^2 + i w D + K) a = F B^T, at several frequencies and forces at once."""
    found, (drag, stiffness) = states
    rng = np.random.default_rng(4)
    frequency = np.array([3.0, 40.0, 150.0])
    pushed = rng.normal(size=(3, 6)) + 1j * rng.normal(size=(3, 6))
    a = coordinates(found, pushed, frequency)
    for k, omega in enumerate(2 * np.pi * frequency):
        whole = -(omega**2) * np.eye(6) + 1j * omega * drag + stiffness
        np.testing.assert_allclose(a[k], np.linalg.solve(whole, pushed[k]), rtol=1e-9)


def _sphere(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and quadrilaterals of the unit sphere but for small caps."""
    polar, around = np.linspace(0.02, np.pi - 0.02, n), np.linspace(0, 2 * np.pi, 2 * n, False)
    p, t = np.meshgrid(polar, around, indexing="ij")
    points = np.stack([np.sin(p) * np.cos(t), np.sin(p) * np.sin(t), np.cos(p)], axis=-1)
    i, j = np.meshgrid(np.arange(n - 1), np.arange(2 * n), indexing="ij")
    k, width = (j + 1) % (2 * n), 2 * n
    quads = np.stack([i * width + j, (i + 1) * width + j, (i + 1) * width + k, i * width + k], -1)
    return points.reshape(-1, 3), quads.reshape(-1, 4)


def test_a_sphere_that_shakes_and_one_that_breathes():
    """<v_n^2> of a unit sphere: v^2/2 breathing, a third of it shaking."""
    points, quads = _sphere(60)
    surface = Surface.of(points, quads)
    assert surface.area == pytest.approx(4 * np.pi, rel=2e-3)
    shaking = np.tile([0.0, 0.0, 1.0], len(points))
    shape = np.stack([points.ravel(), shaking], axis=1)
    gram = surface.gram(shape)
    frequency = np.array([50.0, 50.0])
    found = mean_square_velocity(np.eye(2, dtype=complex), gram, surface.area, frequency)
    speed = (2 * np.pi * 50) ** 2 / 2
    np.testing.assert_allclose(found, [speed, speed / 3], rtol=5e-3)


def test_a_weighting_is_the_standards():
    """IEC 61672-1, table 3, to the tenth that it prints."""
    table = {
        31.5: -39.4,
        63: -26.2,
        125: -16.1,
        250: -8.6,
        500: -3.2,
        1000: 0.0,
        2000: 1.2,
        4000: 1.0,
    }
    exact = 1000.0 * 10.0 ** (np.round(10 * np.log10(np.array(list(table)) / 1000)) / 10)
    np.testing.assert_allclose(a_weighting(exact), list(table.values()), atol=0.05)


def test_bands_hold_what_the_lines_hold():
    frequency = np.arange(1, 2000) * 0.5
    centre, sums = band_sums(frequency, np.ones(len(frequency)))
    width = centre * (10**0.05 - 10**-0.05)
    np.testing.assert_allclose(sums, width / 0.5, rtol=1e-9)
    assert centre[-1] * 10**0.05 < frequency[-1] < centre[-1] * 10**0.15


def test_too_few_lines_have_no_band():
    for count in (0, 1):
        centre, sums = band_sums(np.full(count, 50.0), np.ones(count))
        assert centre.shape == sums.shape == (0,)
