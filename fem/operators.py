"""Matrices of small motions about a static state, with the clamped rim eliminated.

For basis functions phi on the undeformed mesh, w = e_y x X (speed taken out), K the tangent with
geometric and follower-pressure stiffness:

    M_ij = int rho phi_i . phi_j                    G_ij = skew part of int rho phi_i . (grad phi_j w)
    S_ij = -int rho (grad phi_i w) . (grad phi_j w) Q_ij = int rho phi_i . (e_y x phi_j),  B = G - Q
    S_B_ij = -int rho (grad phi_i w - e_y x phi_i) . (grad phi_j w - e_y x phi_j)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fem import compat, kinematics
from fem.body import Body
from fem.virtual_work import AT_REST, body_rate_form, convection_form, static_residual, tangent


@dataclass(frozen=True)
class Rotation:
    """G, S and B of the full inertia, and S_B of the doppler one; Omega is taken out of all."""

    gyroscopic: PETSc.Mat
    convective: PETSc.Mat
    body: PETSc.Mat
    body_convective: PETSc.Mat


class Operators:
    """Matrices on the free dofs of a body at its present displacement. Collective.

    `mass` is the diagonal of the Gauss-Lobatto mass matrix, kg: positive, and of the full order of
    the elements (the quadrature points are the nodes). `free` are this process's owned free dofs.
    """

    def __init__(self, body: Body, inflation: float):
        self.body = body
        rim = body.rim[body.rim < body.nodes]
        self.free_nodes = np.setdiff1d(np.arange(body.nodes), rim)
        self.free = (3 * self.free_nodes[:, None] + np.arange(3)).ravel()
        first = body.space.dofmap.index_map.local_range[0]
        self._rows = PETSc.IS().createGeneral(
            (self.free + 3 * first).astype(PETSc.IntType), comm=body.comm
        )
        self.mass = body.nodal_mass()[self.free]
        self.stiffness = self._assemble(self._tangent(inflation))
        self.stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def _tangent(self, inflation: float):
        pressure = fem.Constant(self.body.mesh, inflation)
        return tangent(self.body, static_residual(self.body, pressure, AT_REST))

    def rotation(self) -> Rotation:
        """The matrices of the rotating frame. Collective."""
        body = self.body
        u, v = body.trial, body.test
        w = kinematics.wheel_velocity(body.mesh)
        density, convect = body.wall.density, kinematics.convective
        rate, test_rate = kinematics.body_rate(u, w), kinematics.body_rate(v, w)
        forms = (
            convection_form(body),
            -density * ufl.inner(convect(v, w), convect(u, w)) * body.dx,
            body_rate_form(body),
            -density * ufl.inner(test_rate, rate) * body.dx,
        )
        return Rotation(*(self._assemble(form) for form in forms))

    def consistent_mass(self) -> PETSc.Mat:
        """int rho phi_i . phi_j by full integration, kg: what the diagonal `mass` is compared to. Collective."""
        body = self.body
        return self._assemble(body.wall.density * ufl.inner(body.trial, body.test) * body.dx)

    def _assemble(self, form) -> PETSc.Mat:
        matrix = fem.petsc.assemble_matrix(compat.form(form))
        matrix.assemble()
        reduced = matrix.createSubMatrix(self._rows, self._rows)
        matrix.destroy()
        return reduced

    def spread(self, free: np.ndarray) -> np.ndarray:
        """Owned nodal values (nodes, 3, ...) with zeros on the rim from values at the free dofs."""
        out = np.zeros((3 * self.body.nodes, *free.shape[1:]))
        out[self.free] = free
        return out.reshape(self.body.nodes, 3, *free.shape[1:])

    def restrict(self, nodal: np.ndarray) -> np.ndarray:
        """Values at the free dofs from owned nodal values (nodes, 3, ...)."""
        return nodal.reshape(-1, *nodal.shape[2:])[self.free]
