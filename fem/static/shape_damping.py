"""Stiffness-proportional damping in the steady shape of the rolling tire: f = gamma2 Omega K(u) r,
r = M^-1 B u.

r is the body rate of the displacement per unit speed, projected on the finite-element space: its
gradient exists, unlike that of grad(u) w across elements. For small motions f becomes the term
gamma2 Omega K M^-1 B of the rotating pencil.
"""

from __future__ import annotations

import ufl
import ufl.algorithms
from dolfinx import fem
from petsc4py import PETSc
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.static.virtual_work import Rolling, body_rate_form, elastic_work
from tireroad.fem.tire.body import Body


class ShapeDamping:
    """The force as the UFL form `work`, and the part of its derivative that UFL does not see.

    Call `update` before assembling `work`. All methods are collective.
    """

    def __init__(self, body: Body, pressure: Expr, rolling: Rolling) -> None:
        self._body = body
        self._rate = fem.Function(body.space)
        self._factor = float(rolling.speed * rolling.stiffness_damping)
        elastic = elastic_work(body, pressure)
        factor = fem.Constant(body.mesh, self._factor)
        # Expanded at once: UFL numbers the arguments of nested derivatives wrongly.
        along = ufl.derivative(elastic, body.u, self._rate)
        self.work = factor * ufl.algorithms.expand_derivatives(along)
        self._clamp = [body.clamp()]
        self._stiffness_form = compat.form(ufl.derivative(elastic, body.u, body.trial))
        self._stiffness = fem.petsc.create_matrix(self._stiffness_form)
        # The rim rotates rigidly with the wheel: it has no body rate and contributes to none.
        self._rate_matrix = fem.petsc.assemble_matrix(
            compat.form(body_rate_form(body)), self._clamp, 0.0
        )
        self._rate_matrix.assemble()
        inverse_mass, self._out = self._rate_matrix.createVecs()
        inverse_mass.array[:] = 1 / body.nodal_mass()
        self._rate_matrix.diagonalScale(inverse_mass, None)
        self._in = inverse_mass
        self._product: PETSc.Mat | None = None

    def update(self) -> None:
        """Set the rate of the body's present displacement."""
        self._in.array[:] = self._body.owned(self._body.u.x.array).ravel()
        self._rate_matrix.mult(self._in, self._out)
        self._body.owned(self._rate.x.array)[:] = self._out.array_r.reshape(-1, 3)
        self._rate.x.scatter_forward()

    def added_to(self, tangent: PETSc.Mat) -> PETSc.Mat:
        """tangent + gamma2 Omega K M^-1 B, always in the same matrix."""
        self._stiffness.zeroEntries()
        fem.petsc.assemble_matrix(self._stiffness, self._stiffness_form, bcs=self._clamp)
        self._stiffness.assemble()
        self._product = self._stiffness.matMult(self._rate_matrix, result=self._product)
        self._product.scale(self._factor)
        self._product.axpy(1.0, tangent, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return self._product
