"""The isotropic surface whose profiles have a given spectrum.

C(q) (m^4) is the two-sided density of the surface's heights over wave vectors of length q (1/m,
waves per metre). A profile along any line has the one-sided density

    G(n) = 4 int_n^inf C(q) q dq / sqrt(q^2 - n^2)       (m^3),

so long waves of a profile are partly short ones cut obliquely. With C constant in each of k bands
the power of a profile in each band is a triangular matrix times C, which is solved for nonnegative
C.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
THIRD = 10.0**0.1  # ratio of two third octaves (IEC 61260, base ten)


def bands(shortest: float, longest: float) -> Array:
    """Edges (k + 1,) 1/m, ascending, of bands that fill the waves from `shortest` to `longest` (m).

    The bands are as near to third octaves as possible.
    """
    count = max(round(np.log(longest / shortest) / np.log(THIRD)), 1)
    return np.geomspace(1.0 / longest, 1.0 / shortest, count + 1)


def profile_power(edges: Array) -> Array:
    """(k, k) 1/m^2: variance of a profile in each band for C = 1 in one band."""
    low, high = edges[:-1, None], edges[1:, None]

    def within(radius: Array) -> Array:
        """int sqrt(radius^2 - n^2) dn over each band, for n < radius."""
        ends = [np.minimum(end, radius) for end in (low, high)]
        parts = [n * np.sqrt(radius**2 - n**2) + radius**2 * np.arcsin(n / radius) for n in ends]
        return 0.5 * (parts[1] - parts[0])

    return 4.0 * (within(edges[None, 1:]) - within(edges[None, :-1]))


def surface_density(edges: Array, power: Array) -> Array:
    """C (k,) m^4 in the bands between the `edges`, for profile variances `power` (k,) m^2 there.

    The least-squares nearest, since not every spectrum belongs to a surface (none that falls too
    fast towards long waves).
    """
    from scipy.optimize import nnls  # not needed to read a scene

    matrix = profile_power(edges)
    unit = power / np.diag(matrix)  # of C in each band, to remove the scale
    found, _ = nnls(matrix * unit / power.max(), power / power.max())
    return found * unit


def filter_of(edges: Array, density: Array, wave: Array) -> Array:
    """sqrt(C) (m^2) at wave numbers (1/m) of any shape; 0 outside the bands."""
    band = np.searchsorted(edges, wave, side="right") - 1
    inside = (band >= 0) & (band < len(density))
    return np.where(inside, np.sqrt(density[np.clip(band, 0, len(density) - 1)]), 0.0)
