"""Compliance of the tread rubber between carcass and road: the half space under rectangles.

Each function returns a dense (n, n) array in m/N: entry (i, j) is the approach of point i to the
carcass under a unit force on point j. None of them is collective.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tireroad.fem.errors import InputError, UnsuitedSettings

Array = NDArray[np.float64]
# m/N at offsets x, y (m) from rectangles of half sizes a, b (m), under a unit force.
Influence = Callable[[Array, Array, Array, Array], Array]
Kernel = Callable[[Array, Array], Array]

# Love's primitive cancels as eps * (r / half size)^2, a 6-point Gauss rule has an error of (half
# size / r)^12: they cross near r = 10 half sizes, where both are below 1e-12.
FAR = 10.0
GAUSS_POINTS = 6


def half_space_compliance(
    points: Array, half_sizes: Array, youngs_modulus: float, poisson_ratio: float
) -> Array:
    """Elastic half-space under uniform pressure on rectangles, by Love's formula.

    Entry (i, j) = I(x_i - x_j; a_j, b_j) / (pi E* 4 a_j b_j), with E* = E/(1 - nu^2) and I the
    integral of 1/r over the rectangle 2a_j x 2b_j, seen from the centre of rectangle i; then made
    symmetric. The third term of I carries the factor (x - a), not (x + a) as in the thesis (5.4)
    and (E.10).

    points (n, 2) m, half_sizes (n, 2) m, youngs_modulus Pa. Returns (n, n) m/N, symmetric positive
    definite. InputError for sizes or moduli out of range, coinciding points, or rectangles so
    unequal or overlapping that the symmetric matrix is indefinite. Source: Love (1929); Johnson,
    Contact Mechanics, (3.25).
    """
    check_half_space(points, half_sizes, youngs_modulus, poisson_ratio)

    def influence(x: Array, y: Array, a: Array, b: Array) -> Array:
        return half_space_influence(x, y, a, b, youngs_modulus, poisson_ratio)

    return dense_compliance(points, half_sizes, influence)


def half_space_influence(
    x: Array, y: Array, a: Array, b: Array, youngs_modulus: float, poisson_ratio: float
) -> Array:
    """Approach (m/N) at offsets x, y (m) from a rectangle 2a x 2b (m) under a unit force."""
    modulus = youngs_modulus / (1.0 - poisson_ratio**2)
    return rectangle_potential(x, y, a, b) / (np.pi * modulus * 4.0 * a * b)


def dense_compliance(points: Array, half_sizes: Array, influence: Influence) -> Array:
    """Symmetric (n, n) m/N of an influence function between points (n, 2) m.

    InputError if it is not positive definite.
    """
    points, half_sizes = np.asarray(points, dtype=float), np.asarray(half_sizes, dtype=float)
    x = points[:, None, 0] - points[None, :, 0]
    y = points[:, None, 1] - points[None, :, 1]
    compliance = influence(x, y, half_sizes[None, :, 0], half_sizes[None, :, 1])
    compliance = 0.5 * (compliance + compliance.T)
    _check_positive_definite(compliance)
    return compliance


def winkler_compliance(areas: Array, stiffness: float) -> Array:
    """Independent springs, one per point: diagonal 1/(k A_i).

    areas (n,) m^2, stiffness k N/m^3 (force per area and approach). Returns (n, n) m/N. InputError
    if an area or the stiffness is not positive.
    """
    areas = np.asarray(areas, dtype=float)
    if not (np.all(np.isfinite(areas)) and np.all(areas > 0.0)):
        raise InputError("winkler tread: every contact area must be positive (m^2)")
    if not (np.isfinite(stiffness) and stiffness > 0.0):
        raise InputError(f"winkler tread: stiffness {stiffness:g} N/m^3 must be positive")
    return np.diag(1.0 / (stiffness * areas))


def no_tread(n: int) -> Array:
    """No compliance, (n, n) zeros, m/N: the tread is part of the finite elements."""
    return np.zeros((n, n))


def rectangle_potential(x: ArrayLike, y: ArrayLike, a: ArrayLike, b: ArrayLike) -> Array:
    """I(x, y) = integral of 1/r over the rectangle 2a x 2b around the origin, in its own plane, m.

    x, y, a, b broadcast against each other, all in m. Relative error below 1e-11 at any distance.
    """

    def primitive(p: Array, q: Array) -> Array:
        return primitive_product(p, q) + primitive_product(q, p)

    return over_rectangle(x, y, a, b, primitive, lambda p, q: 1.0 / np.hypot(p, q))


def over_rectangle(
    x: ArrayLike, y: ArrayLike, a: ArrayLike, b: ArrayLike, primitive: Kernel, kernel: Kernel
) -> Array:
    """Integral of kernel(x - s, y - t) over |s| < a, |t| < b; d2 primitive/dxdy = kernel.

    From four values of the primitive near the rectangle, and by a product Gauss rule far away,
    where the primitive would cancel.
    """
    x, y, a, b = np.broadcast_arrays(x, y, a, b)
    far = np.hypot(x, y) > FAR * np.maximum(a, b)
    result = np.empty(x.shape)
    result[far] = _by_gauss(x[far], y[far], a[far], b[far], kernel)
    near = ~far
    result[near] = _by_corners(x[near], y[near], a[near], b[near], primitive)
    return result


def primitive_product(p: Array, q: Array) -> Array:
    """p asinh(q/|p|), 0 where p is 0; asinh keeps the digits that ln(q + r) loses for q < 0."""
    size = np.abs(p)
    safe = np.where(size > 0.0, size, 1.0)
    return np.where(size > 0.0, p * np.arcsinh(q / safe), 0.0)


def _by_corners(x: Array, y: Array, a: Array, b: Array, primitive: Kernel) -> Array:
    above = primitive(x + a, y + b) - primitive(x - a, y + b)
    return above - primitive(x + a, y - b) + primitive(x - a, y - b)


def _by_gauss(x: Array, y: Array, a: Array, b: Array, kernel: Kernel) -> Array:
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    total = np.zeros_like(x)
    for s, ws in zip(nodes, weights, strict=True):
        for t, wt in zip(nodes, weights, strict=True):
            total += ws * wt * kernel(x - s * a, y - t * b)
    return total * a * b


def check_half_space(points: Array, half_sizes: Array, youngs_modulus: float, nu: float) -> None:
    """InputError for points (n, 2) m, half sizes (n, 2) m, a modulus or ratio out of range."""
    check_points(points, half_sizes)
    if not (np.isfinite(youngs_modulus) and youngs_modulus > 0.0):
        raise InputError(f"tread: Young's modulus {youngs_modulus:g} Pa must be positive")
    if not -1.0 < nu <= 0.5:
        raise InputError(f"tread: Poisson ratio {nu:g} must lie in (-1, 0.5]")


def check_points(points: Array, half_sizes: Array) -> None:
    """InputError for points (n, 2) m or half sizes (n, 2) m that are not finite or do not fit."""
    points, half_sizes = np.asarray(points, dtype=float), np.asarray(half_sizes, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or half_sizes.shape != points.shape:
        raise InputError(
            f"tread: points {points.shape} and half sizes {half_sizes.shape} must both be (n, 2)"
        )
    if not (np.all(np.isfinite(points)) and np.all(np.isfinite(half_sizes))):
        raise InputError("tread: a point or half size is not finite (m)")
    if not np.all(half_sizes > 0.0):
        raise InputError("tread: every half size must be positive (m)")


def _check_positive_definite(compliance: Array) -> None:
    try:
        np.linalg.cholesky(compliance)
    except np.linalg.LinAlgError:
        eigenvalues = np.linalg.eigvalsh(compliance)
        raise UnsuitedSettings(
            "tread: the contact points' rectangles overlap or differ so much in size "
            f"that the compliance is not positive definite (smallest eigenvalue "
            f"{eigenvalues[0]:.3g} m/N, "
            f'largest {eigenvalues[-1]:.3g}); use a more even contact grid, or tread = "winkler"'
        ) from None
