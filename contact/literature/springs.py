"""Winkler stiffness from the indentation of another tread law (Kropp fits his to measurements)."""

from __future__ import annotations

import numpy as np

from tireroad.contact.solver.complementarity import ActiveSet
from tireroad.contact.tread.law import TreadLaw

_ACROSS = 21  # points across the square that the sphere is pressed into


def fitted_stiffness(law: TreadLaw, radius: float, depth: float) -> float:
    """Stiffness (N/m^3) of the bed that carries as much as the tread under a rigid sphere.

    The sphere has the `radius` (m) and is pressed in by `depth` (m). The complementarity problem is
    solved on 21 x 21 points over the sphere's undeformed cut, sqrt(2 r d).
    """
    reach = 1.1 * np.sqrt(2 * radius * depth)
    pitch = 2 * reach / _ACROSS
    line = (np.arange(_ACROSS) - _ACROSS // 2) * pitch
    x, y = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    half = np.full((len(x), 2), pitch / 2)
    sunk = depth - (x**2 + y**2) / (2 * radius)
    points = np.stack([x, y], axis=-1)
    matrix = law.matrix(points, half, 4 * reach)
    force = float(ActiveSet(matrix).solve(-sunk).sum())
    return force / float(np.maximum(sunk, 0.0).sum() * pitch**2)
