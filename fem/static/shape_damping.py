"""Stiffness-proportional damping in the steady shape of the rolling tire: f = gamma2 Omega K(u) r,
r = M^-1 B u.

r is the body rate of the displacement per unit speed, projected on the finite-element space: its
gradient exists, unlike that of grad(u) w across elements. For small motions f becomes the term
gamma2 Omega K M^-1 B of the rotating pencil.

That product couples each node with the neighbours of its neighbours: with it in the tangent a
factorisation takes three to six times as long. Newton's method without it leaves K^-1 (gamma2 Omega
K M^-1 B) = gamma2 Omega M^-1 B of an error in each step, so it converges if the spectral radius of
this is well below 1, to the same state, as the force is complete.
"""

from __future__ import annotations

import numpy as np
import ufl
import ufl.algorithms
from dolfinx import fem
from petsc4py import PETSc
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.static.virtual_work import Rolling, body_rate_form, elastic_work
from tireroad.fem.tire.body import Body

_WEAK = 0.5  # spectral radius up to which the tangent does without the product
_MARGIN = 1.3  # over it: held nodes and the deformed tire's other tangent
_ROUNDS = 20  # of the power method: within 2 % of the spectral radius


class ShapeDamping:
    """The force as the UFL form `work`, and the part of its derivative that UFL does not see.

    `lag`: most of an error that a Newton step leaves because its tangent lacks that part; 0 if it
    has it. Call `update` before assembling `work`. All methods are collective.
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
        self._rate_matrix, fastest = _rates(body, self._clamp)
        self._in, self._out = self._rate_matrix.createVecs()
        radius = abs(self._factor) * fastest
        self.lag = _MARGIN * radius if radius < _WEAK else 0.0
        self._stiffness_form = compat.form(ufl.derivative(elastic, body.u, body.trial))
        self._stiffness: PETSc.Mat | None = None
        self._assembled = False
        self._product: PETSc.Mat | None = None

    def update(self) -> None:
        """Set the rate of the body's present displacement."""
        self._in.array[:] = self._body.owned(self._body.u.x.array).ravel()
        self._rate_matrix.mult(self._in, self._out)
        self._body.owned(self._rate.x.array)[:] = self._out.array_r.reshape(-1, 3)
        self._rate.x.scatter_forward()

    def completed(self, tangent: PETSc.Mat) -> PETSc.Mat:
        """tangent + gamma2 Omega K M^-1 B, always in the same matrix; the tangent if it lags."""
        self._assembled = False
        if self.lag:
            return tangent
        stiffness = self._tangent_stiffness()
        self._product = stiffness.matMult(self._rate_matrix, result=self._product)
        self._product.scale(self._factor)
        self._product.axpy(1.0, tangent, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return self._product

    def lacking(self, change: np.ndarray) -> np.ndarray:
        """Forces gamma2 Omega K M^-1 B change (N) at the owned unknowns that the last tangent lacks;
        `change` in m."""
        self._in.array[:] = change
        self._rate_matrix.mult(self._in, self._out)
        self._tangent_stiffness().mult(self._out, self._in)
        return self._factor * self._in.array_r

    def _tangent_stiffness(self) -> PETSc.Mat:
        """K at the displacement of the last tangent, of which it is a part."""
        if self._stiffness is None:
            self._stiffness = fem.petsc.create_matrix(self._stiffness_form)
        if not self._assembled:
            self._stiffness.zeroEntries()
            fem.petsc.assemble_matrix(self._stiffness, self._stiffness_form, bcs=self._clamp)
            self._stiffness.assemble()
            self._assembled = True
        return self._stiffness


def _rates(body: Body, clamp: list[fem.DirichletBC]) -> tuple[PETSc.Mat, float]:
    """M^-1 B with the lumped mass, and its spectral radius: strains per radian at most. Collective.

    The rim rotates rigidly with the wheel: it has no body rate and contributes to none.
    """
    rates = fem.petsc.assemble_matrix(compat.form(body_rate_form(body)), clamp, 0.0)
    rates.assemble()
    root, x = rates.createVecs()
    root.array[:] = np.sqrt(body.nodal_mass())
    inverse = root.copy()
    inverse.reciprocal()
    rates.diagonalScale(inverse, inverse)  # skew, so powers of it grow by its spectral radius
    start = np.random.default_rng(0).normal(size=(body.lattice.size, 3))
    fastest, before = 0.0, root.duplicate()
    x.array[:] = start[body.ids].ravel()
    for _ in range(_ROUNDS):
        x.normalize()
        x.swap(before)
        rates.mult(before, x)
        fastest = x.norm()
    rates.diagonalScale(inverse, root)
    return rates, fastest
