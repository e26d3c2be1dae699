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

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.road_shape import FLAT, RoadShape
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body


def make_equilibrium(body: Body, rolling: Rolling = AT_REST, road: RoadShape = FLAT) -> Equilibrium:
    """The problem of a body on a road of that shape. Collective."""
    return Equilibrium(body, rolling) if road.flat else CurvedEquilibrium(body, rolling, road)


class CurvedEquilibrium(Equilibrium):
    """As `Equilibrium`, its height of the road being that under the axle. Collective."""

    def __init__(self, body: Body, rolling: Rolling, road: RoadShape) -> None:
        self._curved: PETSc.Mat | None = None
        self._across = body.space.tabulate_dof_coordinates()[body.tread, :2]
        super().__init__(body, rolling)
        self.road = road

    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """x and y of the owned tread nodes, m."""
        field = self.body.u.x.array
        x, y = (self._across[:, k] + field[self._vertical - 2 + k] for k in (0, 1))
        return x, y

    def tread_height(self) -> np.ndarray:
        """Height of the owned tread nodes over the road's shape, m, in the order of `body.tread`."""
        return super().tread_height() - self.road.height(*self._places())

    def _to_road(self) -> np.ndarray:
        return super()._to_road() + self.road.height(*self._places())

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """As on a level road: without one in its linearised step."""
        kept, self._active = self._active, np.zeros_like(self._active)
        try:
            return super().sinking(weights, load)
        finally:
            self._active = kept

    def _assemble_residual(self) -> np.ndarray:
        """T^T out."""
        super()._assemble_residual()
        out, held = self._work.array, self._vertical[self._active]
        for back, slope in zip((2, 1), self._slopes(), strict=True):
            out[held - back] += slope * out[held]
        return self._work.array_r

    def _assemble_tangent(self) -> None:
        """T^T K T, and the turning of the force."""
        self.matrix = self._local_tangent
        super()._assemble_tangent()
        if self._height == -np.inf:
            return
        if self._curved is not None:
            self._curved.destroy()
        transform = self._transform()
        self.matrix = self._curved = self.matrix.ptap(transform)
        transform.destroy()
        x, _ = self._places()
        turning = (self.road.curvature(x) * self._force)[self._active]
        diagonal = self.matrix.getDiagonal()
        diagonal.array[self._vertical[self._active] - 2] += turning
        self.matrix.setDiagonal(diagonal)

    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """s_x and s_y at the held nodes."""
        along, across = self.road.slopes(*self._places())
        return along[self._active], across[self._active]

    def _transform(self) -> PETSc.Mat:
        """T, in rows of this process's dofs."""
        count, first = len(self._work.array_r), self.matrix.getOwnershipRange()[0]
        held = self._vertical[self._active]
        rows = np.concatenate([np.arange(count), held, held])
        columns = np.concatenate([np.arange(count), held - 2, held - 1]) + first
        values = np.concatenate([np.ones(count), *self._slopes()])
        whole = self.matrix.getSize()[0]
        local = sparse.csr_matrix((values, (rows, columns)), shape=(count, whole))
        parts = (part.astype(PETSc.IntType) for part in (local.indptr, local.indices))
        sizes = (count, whole), (count, whole)
        return PETSc.Mat().createAIJ(sizes, csr=(*parts, local.data), comm=self.body.comm)
