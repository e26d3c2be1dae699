"""Rolling cylinders of creeping rubber, published pressures: (case, unit, computed, exact).

Two cylinders of polyamide: G, nu, common radius, load of 1 m, speed. Wang and Knothe, J. Appl.
Mech. 60 (1993) 310.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from tireroad.contact.patch import Patch
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import dense_compliance, half_space_influence
from tireroad.contact.tread.creep import steady
from tireroad.contact.tread.kernel import GridPlaces

Array = NDArray[np.float64]
SHEAR, NU, RADIUS, LOAD, SPEED = 1143e6, 0.4, 0.05, 600e3, 1.0
POINTS, DX, DY = 99, 0.16e-3, 1.0
PUBLISHED = {1e-9: 60.32, 0.009: 78.74, 0.045: 84.72, 2.0: 85.31}  # MPa at relaxation times, s
# One body against a rigid one deforms like two with twice its modulus.
INFLUENCE = partial(half_space_influence, youngs_modulus=(1 + NU) * SHEAR, poisson_ratio=NU)


def rows() -> Iterator[tuple]:
    """The largest pressure at each relaxation time."""
    for time, published in PUBLISHED.items():
        name = f"rolling cylinder that creeps, relaxation in {time:g} s, largest pressure (Wang, Knothe)"
        yield name, "MPa", rolled(time).max(), published


def influence(x: Array, y: Array, a: Array, b: Array) -> Array:
    """Influence of one point's rectangle, m/Pa."""
    return INFLUENCE(x, y, a, b)


def cylinder() -> Patch:
    """One line of points a metre wide: plane strain in the middle."""
    x = (np.arange(POINTS) - POINTS // 2) * DX
    nothing = np.zeros(POINTS)
    return Patch(
        index=np.arange(POINTS),
        points=np.stack([x, nothing, nothing], axis=-1),
        half_sizes=np.tile([DX / 2, DY / 2], (POINTS, 1)),
        force=nothing,
        gap=x**2 / (2 * RADIUS),
        edge=np.zeros(POINTS, bool),
        line=np.zeros(POINTS, int),
        places=GridPlaces((POINTS, 1), (DX, DY), np.arange(POINTS)),
    )


def pressed(solver: ActiveSet, gap: np.ndarray) -> np.ndarray:
    """Pressures (MPa) under the load."""

    def excess(approach: float) -> float:
        return float(solver.solve(gap - approach).sum() - LOAD)

    approach = brentq(excess, 0.0, 1e-2, xtol=1e-15)
    return solver.solve(gap - approach) / (DX * DY) / 1e6


def matrix(patch: Patch) -> np.ndarray:
    """Compliance between the points, m/N."""
    return dense_compliance(patch.points[:, :2], patch.half_sizes, influence)


def rolled(time: float) -> np.ndarray:
    """Pressures (MPa) of the rolling cylinder with one relaxation `time` (s), modulus halved."""
    patch, creep = cylinder(), (np.array([1.0]), np.array([time]))
    return pressed(ActiveSet(matrix(patch) @ steady(creep, patch, SPEED)), patch.gap)
