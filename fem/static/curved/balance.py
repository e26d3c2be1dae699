"""Equilibrium on a road that is no level plane: camber, or a drum.

The gap of a tread node is g = z + u_z - h - s(x + u_x, y + u_y), and the frictionless road pushes along its gradient,
f (-s_x, -s_y, 1), f the force along the wheel's z. With du_z = w + s_x du_x + s_y du_y at the nodes that are held, du = T du',
the road's dof is w alone, held as the vertical one of a level road is: T^T K T du' = -T^T out, and f is the reaction of
its row. The force turning with the drum's slope adds f s_xx to the tangent, so that Newton's method stays quadratic.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.static.curved.shape import FLAT, RoadShape
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.road import Road
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body


def make_equilibrium(
    body: Body, rolling: Rolling = AT_REST, shape: RoadShape = FLAT
) -> Equilibrium:
    """The problem of a body on a road of that shape. Collective."""
    return Equilibrium(body, rolling) if shape.flat else CurvedEquilibrium(body, rolling, shape)


class CurvedRoad(Road):
    """As `Road`, its height being that under the axle."""

    def __init__(self, body: Body, shape: RoadShape) -> None:
        super().__init__(body)
        self._across = body.space.tabulate_dof_coordinates()[body.tread, :2]
        self._shape = shape

    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """x and y of the owned tread nodes, m."""
        field = self._body.u.x.array
        x, y = (self._across[:, k] + field[self.dofs - 2 + k] for k in (0, 1))
        return x, y

    def tread_height(self) -> np.ndarray:
        """Height of the owned tread nodes over the road's shape, m."""
        return super().tread_height() - self._shape.height(*self.places())

    def lay_on(self) -> None:
        """As of a level road. Collective."""
        field = self._body.u.x
        level = self.height + self._shape.height(*self.places()) - self._z
        field.array[self.held] = level[self.active]
        field.scatter_forward()

    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """s_x and s_y at the held nodes."""
        along, across = self._shape.slopes(*self.places())
        return along[self.active], across[self.active]

    def turning(self) -> np.ndarray:
        """f s_xx of the held nodes, N/m."""
        return (self._shape.curvature(self.places()[0]) * self.force)[self.active]


class CurvedEquilibrium(Equilibrium):
    """As `Equilibrium`, its heights of the road being those under the axle. Collective."""

    road: CurvedRoad

    def __init__(self, body: Body, rolling: Rolling, shape: RoadShape) -> None:
        self._curved: PETSc.Mat | None = None
        self.shape = shape
        super().__init__(body, rolling)

    def _make_road(self) -> CurvedRoad:
        return CurvedRoad(self.body, self.shape)

    def _make_contact(self) -> None:
        """None: T depends on what is held."""

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """As on a level road: without one in its linearised step."""
        kept, self.road.active = self.road.active, np.zeros_like(self.road.active)
        try:
            return super().sinking(weights, load)
        finally:
            self.road.active = kept

    def _assemble_residual(self) -> np.ndarray:
        """T^T out."""
        super()._assemble_residual()
        out, held = self._work.array, self.road.held
        for back, slope in zip((2, 1), self.road.slopes(), strict=True):
            out[held - back] += slope * out[held]
        return self._work.array_r

    def _assemble_tangent(self) -> None:
        """T^T K T, and the turning of the force."""
        self.matrix = self._local_tangent
        super()._assemble_tangent()
        if self.road.height == -np.inf:
            return
        if self._curved is not None:
            self._curved.destroy()
        transform = self._transform()
        self.matrix = self._curved = self.matrix.ptap(transform)
        transform.destroy()
        diagonal = self.matrix.getDiagonal()
        diagonal.array[self.road.held - 2] += self.road.turning()
        self.matrix.setDiagonal(diagonal)

    def _transform(self) -> PETSc.Mat:
        """T, in rows of this process's dofs."""
        count, first = len(self._work.array_r), self.matrix.getOwnershipRange()[0]
        held = self.road.held
        rows = np.concatenate([np.arange(count), held, held])
        columns = np.concatenate([np.arange(count), held - 2, held - 1]) + first
        values = np.concatenate([np.ones(count), *self.road.slopes()])
        whole = self.matrix.getSize()[0]
        local = sparse.csr_matrix((values, (rows, columns)), shape=(count, whole))
        parts = (part.astype(PETSc.IntType) for part in (local.indptr, local.indices))
        sizes = (count, whole), (count, whole)
        return PETSc.Mat().createAIJ(sizes, csr=(*parts, local.data), comm=self.body.comm)
