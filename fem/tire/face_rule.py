"""Integrals over one face of each cell as cell integrals whose quadrature points lie on the face.

    int_face f dA = int_cell-rule f |J^-T n| |det J|,   n the reference normal (Nanson's formula)

Facet integrals on a surface inside the body would couple the two adjacent cells in the sparsity
pattern, order each facet's sides differently on each process, and need cells of other processes.
Here each cell, and thus each process, owns its faces.
"""

from __future__ import annotations

import itertools

import numpy as np
import ufl
from dolfinx.mesh import Mesh
from ufl.core.expr import Expr

from tireroad.fem import compat

AXES = 3


def edge_rule(order: int, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights on [0, 1]: "reduced": `order` Gauss points, "full": one more, "nodes":
    Lobatto's."""
    if kind == "nodes":
        nodes = compat.field_nodes(order)
        points = np.sort(nodes[(nodes[:, 1] == 0) & (nodes[:, 2] == 0), 0])
        powers = np.arange(order + 1)
        return points, np.linalg.solve(points ** powers[:, None], 1 / (powers + 1))
    points, weights = np.polynomial.legendre.leggauss(order + (kind == "full"))
    return (points + 1) / 2, weights / 2


def face_points(axis: int, side: int, line: np.ndarray) -> np.ndarray:
    """Tensor points (n^2, 3) of a line on a face; the lower of the other axes varies slowest."""
    points = np.full((len(line) ** 2, AXES), float(side))
    first, second = (other for other in range(AXES) if other != axis)
    grid = np.array(list(itertools.product(line, line)))
    points[:, first], points[:, second] = grid[:, 0], grid[:, 1]
    return points


class Face:
    """The face of all cells of a mesh where reference coordinate `axis` is `side` (0 or 1)."""

    def __init__(self, mesh: Mesh, axis: int, side: int, order: int) -> None:
        self.mesh, self.axis, self.side, self._order = mesh, axis, side, order
        reference = np.zeros(AXES)
        reference[axis] = 2 * side - 1
        scaled = ufl.inv(ufl.Jacobian(mesh)).T * ufl.as_vector([float(v) for v in reference])
        self.area = ufl.sqrt(ufl.dot(scaled, scaled))
        self.normal = scaled / self.area

    def integral(self, integrand: Expr, kind: str) -> ufl.Form:
        """UFL form of the surface integral with the rule `kind` of `edge_rule`."""
        line, weights = edge_rule(self._order, kind)
        metadata = {
            "quadrature_rule": "custom",
            "quadrature_degree": 2 * self._order,  # no effect, but UFL requires one
            # Tuples: UFL writes them into the form's signature in full, but arrays only to eight
            # digits.
            "quadrature_points": _nested(face_points(self.axis, self.side, line)),
            "quadrature_weights": _nested(np.outer(weights, weights).ravel()),
        }
        return self.area * integrand * ufl.Measure("dx", domain=self.mesh, metadata=metadata)

    def tangents(self) -> tuple[Expr, Expr]:
        """(e_circ, e_across) in UFL: around the axle, and e_circ x normal, both in the face."""
        X = ufl.SpatialCoordinate(self.mesh)
        along = ufl.as_vector((-X[2], 0.0, X[0]))
        # The polynomial face is not exactly a surface of revolution.
        along = along - ufl.dot(along, self.normal) * self.normal
        around = along / ufl.sqrt(ufl.dot(along, along))
        return around, ufl.cross(around, self.normal)


def _nested(values: np.ndarray) -> tuple:
    return tuple(_nested(part) if part.ndim else float(part) for part in values)
