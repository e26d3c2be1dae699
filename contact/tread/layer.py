"""An elastic layer bonded to a rigid base, like a tread on its belt."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import j1

from tireroad.contact.tread.compliance import half_space_influence
from tireroad.fem.errors import InputError, UnsuitedSettings

Array = NDArray[np.float64]

# (C/C_half-space) - 1 decays as e^(-2m) in m = k h: negligible beyond.
LAST = 20.0
# Thicknesses beyond which a point force moves nothing: 4e-8 of the bound at 0.5, none at 0.49.
REACH = 24.0
PER_THICKNESS = 40  # entries of the table per thickness of distance
# Along a side: 1e-5 of a point's own compliance at aspect ratios of 1 to 30, 1e-8 at 1 to 1.
GAUSS_POINTS = 16
STIFFEST = 1e-4  # of the half-space's; below, a point's own compliance is lost in cancellation


def transform_ratio(m: Array, poisson_ratio: float) -> Array:
    """Compliance of the bonded layer over that of the half-space, at m = wave number x thickness.

    [(3 - 4 nu) sinh 2m - 2m] / [(3 - 4 nu) cosh 2m + 2 m^2 + 5 - 4 nu (3 - 2 nu)], divided by
    e^(2m) throughout. Source: Carbone and Mangialardi, J. Mech. Phys. Solids 56 (2008) 684.
    """
    a, decay = 3.0 - 4.0 * poisson_ratio, np.exp(-2.0 * m)
    above = 0.5 * a * (1.0 - decay**2) - 2.0 * m * decay
    constant = 5.0 - 4.0 * poisson_ratio * (3.0 - 2.0 * poisson_ratio)
    return above / (0.5 * a * (1.0 + decay**2) + (2.0 * m**2 + constant) * decay)


class LayerInfluence:
    """Approach per unit force, uniform over a rectangle: half-space plus a smooth correction.

    A point force moves the surface by

        u(r) = 1/(pi E*) [1/r + 1/h int_0^oo (ratio(m) - 1) J0(m r/h) dm];

    the integral of the second part over a disc of radius R = rho h is 2h/E* (bounded(rho) - rho),
    with bounded(rho) = rho int_0^oo ratio(m)/m J1(m rho) dm, which tends to
    (1 - 2nu)/(2(1 - nu)^2). The integral over a rectangle is that of four right-angled corners, in
    polar coordinates about the point of evaluation, r = X cosh t along a side. `thickness` h in m.
    InputError for a thickness that is not positive, and for rectangles so much wider than the
    thickness of an incompressible layer that it has no compliance left.
    """

    def __init__(self, youngs_modulus: float, poisson_ratio: float, thickness: float) -> None:
        if not (np.isfinite(thickness) and thickness > 0.0):
            raise InputError(f"layer tread: thickness {thickness:g} m must be positive")
        self._elastic = youngs_modulus, poisson_ratio
        self._thickness = thickness
        self._modulus = youngs_modulus / (1.0 - poisson_ratio**2)
        nodes, weights = np.polynomial.legendre.leggauss(200 + int(4 * LAST * REACH / np.pi))
        m = 0.5 * LAST * (nodes + 1.0)
        density = 0.5 * LAST * weights * (transform_ratio(m, poisson_ratio) - 1.0) / m
        rho = np.linspace(0.0, REACH, int(PER_THICKNESS * REACH) + 1)
        self._bounded = CubicSpline(rho, rho + [r * (j1(m * r) @ density) for r in rho])

    def __call__(self, x: Array, y: Array, a: Array, b: Array) -> Array:
        """m/N at offsets x, y (m) from the centre of rectangles 2a x 2b (m)."""
        half_space = half_space_influence(x, y, a, b, *self._elastic)
        h = self._thickness
        x, y, p, q = x / h, y / h, a / h, b / h
        corners = self._corner(x + p, y + q) - self._corner(x - p, y + q)
        corners += self._corner(x - p, y - q) - self._corner(x + p, y - q)
        total = half_space + h * corners / (np.pi * self._modulus * 4.0 * a * b)
        if np.any(total[(x == 0) & (y == 0)] < STIFFEST * half_space[(x == 0) & (y == 0)]):
            raise UnsuitedSettings(
                f"layer tread: for points {2e3 * np.min(a):.3g} x {2e3 * np.min(b):.3g} mm wide a layer of "
                f"{1e3 * h:.3g} mm is nearly rigid: take closer contact.points, or a smaller contact.poisson_ratio"
            )
        return total

    def _corner(self, x: Array, y: Array) -> Array:
        """Correction over the rectangle between (0, 0) and (x, y), all in thicknesses; signed."""
        sign, x, y = np.sign(x) * np.sign(y), np.abs(x), np.abs(y)
        return sign * (self._triangle(x, y) + self._triangle(y, x))

    def _triangle(self, x: Array, y: Array) -> Array:
        """Correction over the triangle (0, 0), (x, 0), (x, y).

        int_0^asinh(y/x) (bounded(r) - r)/cosh t dt, r = x cosh t.
        """
        top = 0.5 * np.arcsinh(y / np.where(x > 0.0, x, 1.0))
        total = np.zeros_like(top)
        for node, weight in zip(*np.polynomial.legendre.leggauss(GAUSS_POINTS), strict=True):
            cosh = np.cosh(top * (node + 1.0))
            total += weight * (self._bounded(np.minimum(x * cosh, REACH)) / cosh - x)
        return np.where(x > 0.0, top * total, 0.0)
