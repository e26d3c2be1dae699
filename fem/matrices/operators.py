"""Matrices of small motions about a static state, on the unknowns that its support leaves free.

For basis functions phi on the undeformed mesh and w = e_y x X (Omega factored out). K is the
tangent stiffness with its geometric and follower-pressure parts, the rubber's material part with
dynamic moduli:

    M_ij = int rho phi_i . phi_j                    G_ij = skew of int rho phi_i . (grad phi_j w)
    S_ij = -int rho (grad phi_i w) . (grad phi_j w) Q_ij = int rho phi_i . (e_y x phi_j),  B = G - Q
    S_B_ij = -int rho (grad phi_i w - e_y x phi_i) . (grad phi_j w - e_y x phi_j)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from scipy import sparse
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.matrices.local_rows import from_local_rows
from tireroad.fem.matrices.support import FIXED, Rim, Support, Unknowns
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    added_stress,
    body_convective_form,
    body_rate_form,
    convection_form,
    convective_form,
    static_residual,
    tangent,
)
from tireroad.fem.tire.body import Body

ROTATION = ("gyroscopic", "convective", "body", "body_convective")


class Rotation:
    """G, S and B of the full inertia and S_B of the doppler one, with Omega factored out.

    Each is assembled at first use (collective): a static flexibility needs only two of the four.
    """

    def __init__(self, body: Body, assemble: Callable[[ufl.Form], PETSc.Mat]) -> None:
        self._body, self._assemble = body, assemble

    @cached_property
    def gyroscopic(self) -> PETSc.Mat:
        """G, kg."""
        return self._assemble(convection_form(self._body))

    @cached_property
    def convective(self) -> PETSc.Mat:
        """S, kg."""
        return self._assemble(convective_form(self._body))

    @cached_property
    def body(self) -> PETSc.Mat:
        """B, kg."""
        return self._assemble(body_rate_form(self._body))

    @cached_property
    def body_convective(self) -> PETSc.Mat:
        """S_B, kg."""
        return self._assemble(body_convective_form(self._body))

    def coriolis(self, inertia: str) -> PETSc.Mat:
        """The factor of 2 Omega, kg: G, or B for the doppler inertia."""
        return self.gyroscopic if inertia == "full" else self.body

    def carrying(self, inertia: str) -> PETSc.Mat:
        """The factor of Omega^2, kg: S, or S_B for the doppler inertia."""
        return self.convective if inertia == "full" else self.body_convective


class Operators:
    """Matrices on the unknowns of a body at its present displacement. Collective.

    `mass`: diagonal of the Gauss-Lobatto mass matrix, kg, positive and of the full order of the
    elements (the quadrature points are the nodes); `carried` (3, n) kg: momentum per unit rate of
    each unknown; `unknowns` describes them. With a free rim the static forces on the rim contribute
    to the stiffness, including those of the `rolling` shape (mass damping only).
    """

    def __init__(
        self,
        body: Body,
        inflation: float,
        support: Support = FIXED,
        rolling: Rolling = AT_REST,
    ) -> None:
        self.body = body
        self.unknowns = Unknowns(body, support)
        self.mass, self.carried = self.unknowns.mass, self.unknowns.carried
        self.stiffness = self._assemble(self._tangent(inflation))
        if self.unknowns.rim:
            self._add_turning(self.unknowns.rim, inflation, rolling)
        self.stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def _add_turning(self, rim: Rim, inflation: float, rolling: Rolling) -> None:
        """Add the stiffness against rotations of the rim due to its static forces. Collective."""
        body = self.body
        pressure = fem.Constant(body.mesh, inflation)
        out = fem.petsc.assemble_vector(compat.form(static_residual(body, pressure, rolling)))
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        turning = rim.turning_stiffness(out.array_r[rim.dofs])
        if rim.mine:
            end = self.stiffness.getOwnershipRange()[1]
            six = np.arange(end - 6, end, dtype=PETSc.IntType)
            self.stiffness.setValues(six, six, turning, PETSc.InsertMode.ADD)
        self.stiffness.assemble()

    def _tangent(self, inflation: float) -> ufl.Form:
        pressure = fem.Constant(self.body.mesh, inflation)
        static = tangent(self.body, static_residual(self.body, pressure, AT_REST))
        wall = self.body.wall
        return static + self._material(wall.stiffening()) if wall.stiffens else static

    def _material(self, share: Expr) -> ufl.Form:
        """A share (constant in each cell) of the rubber's material tangent, in UFL."""
        here = fem.Function(self.body.space)
        here.x.array[:] = self.body.u.x.array
        return tangent(self.body, added_stress(self.body, share, here))

    def loss_stiffness(self) -> PETSc.Mat | None:
        """sum_r eta_r K_r, N/m, over the material tangents of the regions at dynamic moduli.

        It is the imaginary part of the stiffness for a complex modulus; None without losses.
        Collective.
        """
        wall = self.body.wall
        return self._assemble(self._material(wall.losses())) if wall.loses else None

    def rotation(self) -> Rotation:
        """The matrices of the rotating frame."""
        return Rotation(self.body, lambda form: _without_zeros(self._assemble(form)))

    def consistent_mass(self) -> PETSc.Mat:
        """int rho phi_i . phi_j fully integrated, kg: reference for the diagonal. Collective."""
        body = self.body
        return self._assemble(body.inertia(ufl.inner(body.trial, body.test)))

    def _assemble(self, form: ufl.Form) -> PETSc.Mat:
        matrix = fem.petsc.assemble_matrix(compat.form(form))
        matrix.assemble()
        reduced = self.unknowns.reduced(matrix)
        matrix.destroy()
        return reduced

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Owned nodal values (nodes, 3, ...) from own unknowns (n, ...). Collective."""
        return self.unknowns.spread(values)

    def restrict(self, nodal: np.ndarray) -> np.ndarray:
        """Own unknowns (n, ...) from owned nodal values (nodes, 3, ...) of an admissible motion.
        Collective."""
        return self.unknowns.restrict(nodal)

    def trace(self, values: np.ndarray) -> np.ndarray:
        """Outer-face motion (3 s, m) of the motions (n, m), on every process. Collective.

        With a free rim its translation and rotation (6, m) follow.
        """
        face = self.body.surface(self.spread(values)).reshape(-1, values.shape[1])
        if self.unknowns.rim is None:
            return face
        return np.vstack([face, self.unknowns.rim_motion(values)])


def _without_zeros(matrix: PETSc.Mat) -> PETSc.Mat:
    """The matrix without its zero entries; the one given is destroyed.

    G and S couple like components alone, a third of the mesh's pattern: their products take a third
    of the time and of the memory. Collective.
    """
    sizes, comm = matrix.getSizes(), matrix.comm
    indptr, indices, values = matrix.getValuesCSR()
    matrix.destroy()
    own = sparse.csr_matrix((values, indices, indptr), sizes[0])
    own.eliminate_zeros()
    return from_local_rows(own, sizes, comm)
