"""Fourier series around against another code, and the default elements against Fourier series."""

import numpy as np
import pytest

from tireroad.fem.sections.mesh2d import PlyLine
from tireroad.tests.bench.parts.harmonics import Membrane, Rubber, frequencies
from tireroad.tests.validation.cases import thesis_torus

HALF = np.radians(120)


def section(arc=24, layers=2, plies=()):
    torus = thesis_torus(segments=8, elements_arc=arc, elements_thickness=layers, order=3)
    return torus.section([], plies)


def test_the_clamped_torus():
    """Extrapolated values of a sequence of meshes, equal to those of an independent code."""
    rubber = {"wall": Rubber(480e6, 0.45, 1200.0)}
    expected = {0: [84.490, 309.118], 1: [130.963, 287.693], 2: [250.918]}
    for wave, values in expected.items():
        found = frequencies(section(), rubber, wave, len(values))
        np.testing.assert_allclose(found, values, rtol=2e-3)
        assert (found > np.array(values) - 2e-3).all()


def test_the_belted_torus():
    """An independent code's values, to 0.1 %."""
    quarter = np.pi / 4
    plies = [
        PlyLine("ply", (-HALF, HALF), 0.25),
        PlyLine("belt 1", (-quarter, quarter), 0.5),
        PlyLine("belt 2", (-quarter, quarter), 0.75),
    ]
    belt = 172.2e9 * 2.118e-7 / 1.16e-3
    cords = {
        "ply": Membrane(9.87e9 * 4.21e-7 / 1e-3, np.pi / 2),
        "belt 1": Membrane(belt, np.radians(20)),
        "belt 2": Membrane(belt, -np.radians(20)),
    }
    rubber = {"wall": Rubber(6e6, 0.45, 1200.0)}
    mesh = section(28, 4, plies)
    for wave, values in {0: [13.43, 35.22], 1: [21.40, 42.28], 2: [45.11, 52.45]}.items():
        assert frequencies(mesh, rubber, wave, 2, cords) == pytest.approx(values, rel=4e-3)
