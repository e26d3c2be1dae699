"""Vibration of the whole tire: against the response it stands for, and on surfaces known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from tireroad.contact.results.spectra import a_weighting, band_sums
from tireroad.greens.outputs import Surface, mean_square_velocity


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
