"""The restoring force of the hyperelastic tire about a static state, with the moduli of small motions.

    F(u) = forces of stresses, cords, follower pressure and steady rolling
           + the share (dynamic - static) of the rubber's stress added since the static state u_0,
    r(q) = F(u_0 + q) - F(u_0) - K q,

K being the stiffness of `Operators`, the derivative of F at u_0. In a belted tire r is the finite rotation
of cords that hardly stretch and of rubber that hardly changes its volume, which K takes for strain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from tireroad.fem import compat, kinematics
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import multiply
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    added_energy,
    added_stress,
    static_residual,
    stress_prediction,
    tangent,
)
from tireroad.fem.tire.body import Body

T = TypeVar("T")


class RestoringForce:
    """F of a tire with a fixed rim about the static state of `operators` at `inflation` (Pa).

    Motions and forces are own rows (n,), m and N; the body's displacement is restored after every call. Raises
    InputError for a free rim. Collective, as are all methods.
    """

    def __init__(self, operators: Operators, inflation: float, rolling: Rolling = AT_REST) -> None:
        if operators.unknowns.rim:
            raise InputError('large motions: modal.rim = "free" is not available; take "fixed"')
        self.operators, self.body = operators, operators.body
        self._pressure = fem.Constant(self.body.mesh, float(inflation))
        self._static = fem.Function(self.body.space)
        self._static.x.array[:] = self.body.u.x.array
        self.work = force_work(self.body, self._pressure, self._static, rolling)
        self._form = compat.form(self.work)
        self._assembled = compat.force_vector(self._form, self.body.space)
        self.at_rest = self._at(np.zeros(len(operators.mass)), self._forces)

    def change(self, motion: np.ndarray) -> np.ndarray:
        """F(u_0 + q) - F(u_0)."""
        return self._at(motion, self._forces) - self.at_rest

    def nonlinear(self, motions: np.ndarray) -> np.ndarray:
        """r (n, s) of motions q (n, s)."""
        out = np.stack([self.change(motion) for motion in motions.T], axis=1)
        return out - multiply(self.operators.stiffness, motions)

    def tangent(self, motion: np.ndarray, before: np.ndarray) -> PETSc.Mat:
        """The derivative of F at u_0 + q with stresses predicted from the motion `before`
        (stress_prediction), on the unknowns, N/m. The caller destroys it."""
        if not hasattr(self, "_tangent"):
            self._before = fem.Function(self.body.space)
            share = self.body.wall.stiffening() if self.body.wall.stiffens else 0.0
            form = tangent(self.body, self.work)
            self._tangent = compat.form(form + stress_prediction(self.body, self._before, share))
            self._matrix = fem.petsc.create_matrix(self._tangent)

        def last() -> None:
            self._before.x.array[:] = self.body.u.x.array

        def assembled() -> PETSc.Mat:
            self._matrix.zeroEntries()
            fem.petsc.assemble_matrix(self._matrix, self._tangent)
            self._matrix.assemble()
            return self.operators.unknowns.reduced(self._matrix)

        self._at(before, last)
        out = self._at(motion, assembled)
        out.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return out

    def energy(self, motion: np.ndarray) -> float:
        """Energy stored since the static state, J; of a standing wheel."""
        if not hasattr(self, "_potential"):
            self._potential = compat.form(potential(self.body, self._pressure, self._static))
            self._stored_at_rest = self._at(np.zeros(len(motion)), self._stored)
        return self._at(motion, self._stored) - self._stored_at_rest

    def local(self, motion: np.ndarray) -> np.ndarray:
        """u_0 + q at all of this process's nodes, ghosts included, (3 nodes,) m."""
        return self._at(motion, self.body.u.x.array.copy)

    def _at(self, motion: np.ndarray, evaluate: Callable[[], T]) -> T:
        field = self.body.u.x
        field.array[:] = self._static.x.array
        field.array[self.operators.unknowns.free] += motion
        field.scatter_forward()
        found = evaluate()
        field.array[:] = self._static.x.array
        return found

    def _forces(self) -> np.ndarray:
        with self._assembled.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._assembled, self._form)
        self._assembled.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return self._assembled.array_r[self.operators.unknowns.free]

    def _stored(self) -> float:
        return self.body.comm.allreduce(fem.assemble_scalar(self._potential))


def force_work(
    body: Body, pressure: fem.Constant, static: fem.Function, rolling: Rolling = AT_REST
) -> ufl.Form:
    """Virtual work of F, in UFL; `static`: the displacement u_0 from which dynamic moduli count."""
    work = static_residual(body, pressure, rolling)
    if body.wall.stiffens:
        work += added_stress(body, body.wall.stiffening(), static)
    return work


def potential(body: Body, pressure: fem.Constant, static: fem.Function) -> ufl.Form:
    """The potential of F at rest, J, in UFL: strain energy of wall and cords plus p V.

    V(u) is the volume enclosed by the inner face, whose edges are fixed."""
    F = kinematics.deformation_gradient(body.u)
    distortion, dilatation = body.wall.energy(F.T * F)
    place = ufl.SpatialCoordinate(body.mesh) + body.u
    swept = kinematics.pressure_virtual_work(body.u, place, ufl.FacetNormal(body.mesh)) / 3
    stored = distortion * body.dx + dilatation * body.reduced_dx + body.plies.energy(body.u)
    stored += pressure * swept * body.inner_ds
    if body.wall.stiffens:
        stored += added_energy(body, body.wall.stiffening(), static)
    return stored
