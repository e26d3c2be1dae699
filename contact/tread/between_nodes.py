"""Compliance of the wall under a grid of points that the finite elements do not resolve.

A point is a uniform pressure on its rectangle. The elements see only what their shape functions can
represent: nodal forces W^T f, whose pressures W^T f / A_i have T f = a W A^-1 W^T f on the
rectangles (a: their areas, A: those of the nodes). Locally the wall is a half-space of its outer
rubber, or a layer of it; with the compliance C of that, the elements lack

    C - T^T C T,

all of it within a few nodes. It decreases only as the element size, and its share in the compliance
of a point is what makes results on rough roads depend on the mesh: soft torus, 18 x 8 and 24 x 12
elements of order 3 (nodes 13 and 10 mm apart), points 8 mm apart: 1.07 and 0.90 um/N from this
formula; 1.17 and 0.87 from those and 30 x 12 and 40 x 16 elements, extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.patch import Patch
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.kernel import KernelTread
from tireroad.contact.tread.law import TreadLaw

Array = NDArray[np.float64]

_CORNERS = (-1, -1), (-1, 1), (1, -1), (1, 1)


@dataclass(frozen=True, kw_only=True)
class OuterRubber(TreadLaw):
    """A tread `law` on a compliant `wall`, for forces normal to the road."""

    law: TreadLaw
    wall: Influence

    def influence(self, farthest: float) -> Influence:
        """The sum of both influences."""
        own = self.law.influence(farthest)

        def of(x: Array, y: Array, a: Array, b: Array) -> Array:
            return own(x, y, a, b) + self.wall(x, y, a, b)

        return of


def over_rectangles(influence: Influence) -> Influence:
    """The mean over a rectangle by 2 x 2 Gauss points, as in contact.grid_patch."""

    def of(x: Array, y: Array, a: Array, b: Array) -> Array:
        parts = [influence(x + i * a / 3**0.5, y + j * b / 3**0.5, a, b) for i, j in _CORNERS]
        return np.mean(parts, axis=0)

    return of


def on_nodes(patch: Patch, node_area: Array, wall: Influence) -> Array:
    """N (p, p) m/N between the patch's nodes, such that T^T C T = W N W^T.

    `node_area` (s,) m2 of the outer face; `wall`: the influence that makes C.
    """
    assert patch.weights is not None and patch.places is not None  # of every grid
    compliance = KernelTread(patch.places, wall)
    pressed = (patch.weights.multiply(patch.area[:, None])).T.tocsr()
    moved = np.array([compliance.apply(row.toarray().ravel()) for row in pressed])
    area = node_area[patch.index]
    product = (pressed @ moved.T) / np.outer(area, area)
    return (product + product.T) / 2


def before_equilibrium(patch: Patch, known: Array, nodal_force: Array) -> Patch:
    """The patch before its equilibrium for nodes more rigid by `known` N (p, p), of the same unloaded shape.

    `nodal_force` (p,) N: the forces under which its gap was computed.
    """
    assert patch.weights is not None
    return replace(patch, gap=patch.gap - patch.weights @ (known @ nodal_force))
