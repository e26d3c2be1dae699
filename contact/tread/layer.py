"""A tread layer bonded to a rigid base, its belt: influence of pressure and of horizontal forces."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import j0, j1, jv

from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.shear import half_space_shear
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

_FIRST = 1e-4  # thicknesses: the table begins near 0, where J1/rho and J2/rho^2 are limits


def transform_ratio(m: Array, poisson_ratio: float) -> Array:
    """Compliance of the bonded layer over that of the half-space, at m = wave number x thickness.

    [(3 - 4 nu) sinh 2m - 2m] / [(3 - 4 nu) cosh 2m + 2 m^2 + 5 - 4 nu (3 - 2 nu)], divided by
    e^(2m) throughout. Source: Carbone and Mangialardi, J. Mech. Phys. Solids 56 (2008) 684.
    """
    a, decay = 3.0 - 4.0 * poisson_ratio, np.exp(-2.0 * m)
    above = 0.5 * a * (1.0 - decay**2) - 2.0 * m * decay
    constant = 5.0 - 4.0 * poisson_ratio * (3.0 - 2.0 * poisson_ratio)
    return above / (0.5 * a * (1.0 + decay**2) + (2.0 * m**2 + constant) * decay)


@lru_cache(maxsize=1)
def _wave_numbers() -> tuple[Array, Array]:
    """Wave numbers x thickness from 0 to LAST, and their weights in an integral over these (Gauss)."""
    nodes, weights = np.polynomial.legendre.leggauss(200 + int(4 * LAST * REACH / np.pi))
    return 0.5 * LAST * (nodes + 1.0), 0.5 * LAST * weights


@lru_cache(maxsize=8)
def _bounded(nu: float) -> CubicSpline:
    """rho int_0^oo ratio(m)/m J1(m rho) dm of a layer with Poisson's ratio `nu`."""
    m, weights = _wave_numbers()
    density = weights * (transform_ratio(m, nu) - 1.0) / m
    rho = np.linspace(0.0, REACH, int(PER_THICKNESS * REACH) + 1)
    return CubicSpline(rho, rho + [r * (j1(m * r) @ density) for r in rho])


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
        self._bounded = _bounded(poisson_ratio)

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


def transforms(m: Array, poisson_ratio: float) -> tuple[Array, Array, Array]:
    """T, S and C at m = wave number x thickness, with e^(2m) divided out."""
    nu, decay = poisson_ratio, np.exp(-2.0 * m)
    a = 3.0 - 4.0 * nu
    cosh, sinh = 0.5 * (1.0 + decay**2), 0.5 * (1.0 - decay**2)
    below = a * cosh + (2.0 * m**2 + 5.0 - 4.0 * nu * (3.0 - 2.0 * nu)) * decay
    along = (1.0 - nu) * (a * sinh + 2.0 * m * decay) / below
    coupling = (0.5 * a * (1.0 - 2.0 * nu) * (cosh - decay) - m**2 * decay) / below
    return along, np.tanh(m), coupling


@lru_cache(maxsize=8)
def _tables(nu: float) -> list[CubicSpline]:
    """Integrals of J_n over rho^n, n = 0 to 2, of a layer with Poisson's ratio `nu`: even and smooth at 0."""
    m, weights = _wave_numbers()
    along, across, coupling = transforms(m, nu)
    parts = (
        0.5 * (along + across) - 0.5 * (2.0 - nu),
        coupling - 0.5 * (1.0 - 2.0 * nu),
        0.5 * (along - across) + 0.5 * nu,
    )
    rho = np.linspace(_FIRST, REACH, int(PER_THICKNESS * REACH) + 1)
    return [
        CubicSpline(rho, bessel(np.outer(rho, m)) @ (weights * part) / rho**n)
        for n, (bessel, part) in enumerate(zip((j0, j1, _j2), parts, strict=True))
    ]


def _j2(x: Array) -> Array:
    """J2, a tenth of the time of `jv`: by recurrence, which loses digits only near 0."""
    near = x < 1.0
    return np.where(near, jv(2, np.where(near, x, 0.0)), 2.0 * j1(x) / x - j0(x))


class LayerShear:
    """As `half_space_shear`, for a layer of `thickness` m.

    The half-space's displacements plus a smooth correction, the mean over the rectangle by Gauss
    points of

        2 pi G u_x = [p0 - cos 2t q2] t_x - sin 2t q2 t_y,
        2 pi G u_z = c1 (cos t t_x + sin t t_y),

    t being the direction of the offset r, p0 = 1/h int (T + S - 2 + nu)/2 J0(m r/h) dm, q2 with
    (T - S + nu)/2 J2, c1 with (C - (1 - 2 nu)/2) J1.

    Forces in waves of wave number k = m/h along a direction of the surface, h the thickness and G
    the shear modulus, move it by 1/(G k) times

        T = (1 - nu) [(3 - 4 nu) sinh 2m + 2m] / D      along, under forces along,
        S = tanh m                                      across, under forces across,
        C = [(3 - 4 nu)(1 - 2 nu)/2 (cosh 2m - 1) - m^2] / D
                                                        upwards, under forces along, in quadrature,
        D = (3 - 4 nu) cosh 2m + 2 m^2 + 5 - 4 nu (3 - 2 nu)

    (tests/contact/tread/test_shear.py solves the layer's equations for them). The limit m to
    infinity is the half-space: T = 1 - nu, S = 1, C = (1 - 2 nu)/2. Unlike a half-space, a thin
    incompressible layer is squeezed out sideways by pressure.
    """

    def __init__(self, youngs_modulus: float, poisson_ratio: float, thickness: float) -> None:
        self._elastic, self._thickness = (youngs_modulus, poisson_ratio), thickness
        self._nu = poisson_ratio
        self._tables = _tables(poisson_ratio)

    def __call__(self, x: Array, y: Array, a: Array, b: Array) -> Array:
        """(5, ...) m/N at offsets x, y (m) from rectangles 2a x 2b (m)."""
        whole = half_space_shear(x, y, a, b, *self._elastic)
        h = self._thickness
        x, y, p, q = np.broadcast_arrays(x / h, y / h, a / h, b / h)
        count = 6 + int(4 * max(p.max(initial=0.0), q.max(initial=0.0)))
        nodes, weights = np.polynomial.legendre.leggauss(count)
        total = np.zeros((5, *x.shape))
        for s, ws in zip(nodes, weights, strict=True):
            for t, wt in zip(nodes, weights, strict=True):
                total += 0.25 * ws * wt * self._at(x - s * p, y - t * q)
        youngs_modulus, nu = self._elastic
        return whole + total * (1.0 + nu) / (np.pi * youngs_modulus * h)

    def _at(self, x: Array, y: Array) -> Array:
        """Correction (5, ...) for a point force, in thicknesses; far away minus the half-space."""
        rho, nu = np.hypot(x, y), self._nu
        far = np.maximum(rho, REACH)
        none = -0.5 * (2.0 - nu) / far, -0.5 * (1.0 - 2.0 * nu) / far**2, 0.5 * nu / far**3
        near = np.clip(rho, _FIRST, REACH)
        p0, c1, q2 = (
            np.where(rho < REACH, table(near), beyond)
            for table, beyond in zip(self._tables, none, strict=True)
        )
        turned = q2 * (x**2 - y**2)
        return np.stack([p0 - turned, -2.0 * x * y * q2, p0 + turned, x * c1, y * c1])
