"""Tread compliances: Love's values, symmetry, definiteness, the far field, and refusals."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from tireroad.contact.tread.compliance import (
    half_space_compliance,
    no_tread,
    rectangle_potential,
    winkler_compliance,
)
from tireroad.fem.errors import InputError
from tireroad.tests.reference.closed_forms import LOVE_SQUARE_CENTRE


def potential(x: float, y: float, a: float = 1.0, b: float = 1.0) -> float:
    return float(rectangle_potential(np.array(x), np.array(y), np.array(a), np.array(b)))


def grid(nx: int, ny: int, dx: float, dy: float) -> np.ndarray:
    x, y = np.meshgrid(np.arange(nx) * dx, np.arange(ny) * dy, indexing="ij")
    return np.column_stack((x.ravel(), y.ravel()))


def test_love_at_centre_and_corner() -> None:
    assert potential(0.0, 0.0) == pytest.approx(7.050989, abs=5e-7)
    assert potential(0.0, 0.0) == pytest.approx(LOVE_SQUARE_CENTRE, rel=1e-14)
    assert potential(1.0, 1.0) == pytest.approx(0.5 * LOVE_SQUARE_CENTRE, rel=1e-14)


@pytest.mark.parametrize(("x", "y"), [(1.7, 0.3), (-2.0, 5.0), (0.0, 3.0)])
def test_love_against_quadrature(x: float, y: float) -> None:
    a, b = 1.3, 0.4
    exact, _ = dblquad(lambda t, s: 1.0 / np.hypot(x - s, y - t), -a, a, -b, b, epsrel=1e-11)
    assert potential(x, y, a, b) == pytest.approx(exact, rel=1e-9)


def test_far_field_is_a_point_force_and_meets_the_near_field() -> None:
    assert potential(3e6, 4e6, 1.0, 2.0) == pytest.approx(8.0 / 5e6, rel=1e-12)
    for angle in np.linspace(0.0, np.pi, 7):
        inside, outside = 10.0 * (1.0 - 1e-13), 10.0 * (1.0 + 1e-13)
        near, far = (
            potential(r * np.cos(angle), r * np.sin(angle), 1.0, 0.6) for r in (inside, outside)
        )
        assert far == pytest.approx(near, rel=5e-12)


def test_half_space_is_symmetric_positive_definite_and_has_the_modulus() -> None:
    points = grid(12, 9, 0.01, 0.008)
    half_sizes = np.tile([0.005, 0.004], (len(points), 1))
    compliance = half_space_compliance(points, half_sizes, 3e6, 0.49)
    assert np.array_equal(compliance, compliance.T)
    assert np.linalg.eigvalsh(compliance)[0] > 0.0
    distance = np.hypot(*(points[-1] - points[0]))
    modulus = 3e6 / (1.0 - 0.49**2)
    assert compliance[0, -1] == pytest.approx(1.0 / (np.pi * modulus * distance), rel=1e-3)


def test_half_space_in_millimetres() -> None:
    points, sizes = grid(4, 3, 0.01, 0.01), np.full((12, 2), 0.005)
    in_m = half_space_compliance(points, sizes, 3e6, 0.45)
    in_mm = half_space_compliance(1e3 * points, 1e3 * sizes, 3.0, 0.45)
    assert np.allclose(in_mm, 1e3 * in_m, rtol=1e-12)


def test_overlapping_rectangles_are_refused_with_the_eigenvalue() -> None:
    points = grid(3, 3, 0.01, 0.01)
    sizes = np.full((9, 2), 0.005)
    sizes[4] = 0.05
    with pytest.raises(InputError, match="smallest eigenvalue -"):
        half_space_compliance(points, sizes, 3e6, 0.45)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"half_sizes": np.zeros((2, 2))}, "half size"),
        ({"half_sizes": np.ones((3, 2))}, r"\(n, 2\)"),
        ({"points": np.array([[0.0, np.nan], [1.0, 0.0]])}, "finite"),
        ({"youngs_modulus": -1.0}, "Young"),
        ({"poisson_ratio": 0.6}, "Poisson"),
    ],
)
def test_half_space_refuses(change: dict, message: str) -> None:
    arguments = {
        "points": np.array([[0.0, 0.0], [3.0, 0.0]]),
        "half_sizes": np.ones((2, 2)),
        "youngs_modulus": 1.0,
        "poisson_ratio": 0.3,
    }
    with pytest.raises(InputError, match=message):
        half_space_compliance(**{**arguments, **change})


def test_winkler_and_none() -> None:
    assert np.allclose(winkler_compliance(np.array([1e-4, 2e-4]), 2e8), np.diag([5e-5, 2.5e-5]))
    assert np.array_equal(no_tread(3), np.zeros((3, 3)))
    with pytest.raises(InputError, match="area"):
        winkler_compliance(np.array([1.0, 0.0]), 2e8)
    with pytest.raises(InputError, match="stiffness"):
        winkler_compliance(np.array([1.0]), np.nan)
