"""Tread nodes in the coordinates of a road that is not a level plane.

X = X(xi, eta, w): the point of the surface at xi, eta along and across it
(fem.static.curved.shape), displaced by w along the direction in which the road is raised, cos gamma
n_0 per metre of height, n_0 being its normal under the axle. With B = dX/d(xi, eta, w), whose
columns are e_xi, e_eta and cos gamma n_0, residual forces and tangent become

    B^T out,    B^T K B + out . d2X,    d2X/dxi2 = -n/R  on a drum, n/R inside one, all others 0,

so that a node is held in w alone, or in all three coordinates if it sticks, as on a level road. A
frictionless road exerts f = N n_z along the wheel's z, N being the normal force; f is the reaction
at w.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.matrices.local_rows import from_local_rows
from tireroad.fem.static.road import Road
from tireroad.fem.tire.body import Body

Array = np.ndarray


class Unrolled:
    """Road coordinates of the owned nodes that can touch a `road`, at their present positions. All
    methods except `turn` and `spread` are collective."""

    def __init__(self, body: Body, road: Road) -> None:
        self._body, self._road = body, road
        self._blocks = 3 * body.tread[:, None] + np.arange(3)

    def _basis(self) -> Array:
        """B (n, 3, 3), its columns along the last axis."""
        shape, places = self._road.shape, self._road.places()
        basis = shape.frames(*places.T[:2]).transpose(0, 2, 1)
        basis[:, :, 2] = shape.upright * shape.up
        return basis

    def turn(self, out: Array) -> None:
        """Replace the forces (N) of the owned unknowns by B^T out, in place."""
        out[self._blocks] = np.einsum("nij,ni->nj", self._basis(), out[self._blocks])

    def spread(self, change: Array) -> Array:
        """Motion of the owned unknowns in the wheel's axes, m, from one in road coordinates."""
        change = change.copy()
        change[self._blocks] = np.einsum("nij,nj->ni", self._basis(), change[self._blocks])
        return change

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Replace K by B^T K B plus the stiffness of the rotating normal forces, in place.

        B - 1 has entries of the tread only, so rows and columns are added: a general triple product
        takes longer than the factorisation where the matrix has many entries in a row.
        """
        same, off = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN, self._basis() - np.eye(3)
        for blocks, first in ((off.transpose(0, 2, 1), True), (off, False)):
            turning = self._in_blocks(matrix, blocks)
            added = turning.matMult(matrix) if first else matrix.matMult(turning)
            matrix.axpy(1.0, added, same)
            added.destroy()
            turning.destroy()
        road = self._road
        x, y, _ = road.places().T
        normal = road.pressing() * road.shape.stretch(x, y) * road.active
        diagonal = matrix.getDiagonal()
        diagonal.array[self._blocks[:, 0]] += road.shape.bending(x) * normal
        matrix.setDiagonal(diagonal)
        diagonal.destroy()

    def _in_blocks(self, matrix: PETSc.Mat, blocks: Array) -> PETSc.Mat:
        """A matrix with the blocks (n, 3, 3) of the tread's nodes and no other entries."""
        sizes, first = matrix.getSizes(), matrix.getOwnershipRange()[0]
        rows = np.repeat(self._blocks, 3, axis=1).ravel()
        columns = np.tile(self._blocks, 3).ravel() + first
        local = sparse.csr_matrix(
            (blocks.ravel(), (rows, columns)), shape=(sizes[0][0], sizes[0][1])
        )
        return from_local_rows(local, sizes, self._body.comm)
