"""An elastic layer bonded to a stiff base: what a tread on its belt is."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.special import j0

from tireroad.contact.tread.compliance import half_space_influence
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# (C/C_half-space) - 1 falls as e^(-2m) in m = k h: nothing is left beyond.
LAST = 20.0
PER_THICKNESS = 40  # places in the table of the correction for each thickness of distance


def transform_ratio(m: Array, poisson_ratio: float) -> Array:
    """Compliance of the bonded layer over that of the half-space, at m = wavenumber x thickness.

    [(3 - 4 nu) sinh 2m - 2m] / [(3 - 4 nu) cosh 2m + 2 m^2 + 5 - 4 nu (3 - 2 nu)], with e^(2m)
    divided out. Source: Carbone and Mangialardi, J. Mech. Phys. Solids 56 (2008) 684.
    """
    a, decay = 3.0 - 4.0 * poisson_ratio, np.exp(-2.0 * m)
    above = 0.5 * a * (1.0 - decay**2) - 2.0 * m * decay
    constant = 5.0 - 4.0 * poisson_ratio * (3.0 - 2.0 * poisson_ratio)
    return above / (0.5 * a * (1.0 + decay**2) + (2.0 * m**2 + constant) * decay)


class LayerInfluence:
    """Approach per unit force spread evenly over a rectangle: half-space plus a smooth correction.

    The correction is d(r) = 1/(pi E* h) int_0^oo (ratio(m) - 1) J0(m r/h) dm, averaged over the
    rectangle. `thickness` h in m, `farthest` (m) the largest distance asked for. InputError for a
    thickness that is not positive.
    """

    def __init__(
        self, youngs_modulus: float, poisson_ratio: float, thickness: float, farthest: float
    ) -> None:
        if not (np.isfinite(thickness) and thickness > 0.0):
            raise InputError(f"layer tread: thickness {thickness:g} m must be positive")
        self._elastic = youngs_modulus, poisson_ratio
        reach = farthest / thickness + 1.0
        nodes, weights = np.polynomial.legendre.leggauss(200 + int(4 * LAST * reach / np.pi))
        m = 0.5 * LAST * (nodes + 1.0)
        modulus = youngs_modulus / (1.0 - poisson_ratio**2)
        density = 0.5 * LAST * weights * (transform_ratio(m, poisson_ratio) - 1.0)
        distance = np.linspace(0.0, reach, int(PER_THICKNESS * reach) + 2)
        table = np.array([j0(m * r) @ density for r in distance]) / (np.pi * modulus * thickness)
        self._correction = CubicSpline(distance * thickness, table)

    def __call__(self, x: Array, y: Array, a: Array, b: Array) -> Array:
        """m/N at offsets x, y (m) from the centre of rectangles 2a x 2b (m)."""
        total = half_space_influence(x, y, a, b, *self._elastic)
        nodes, weights = np.polynomial.legendre.leggauss(3)
        for s, ws in zip(nodes, weights, strict=True):
            for t, wt in zip(nodes, weights, strict=True):
                total += 0.25 * ws * wt * self._correction(np.hypot(x - s * a, y - t * b))
        return total
