"""Static equilibrium under inflation, steady rolling and a flat, frictionless road.

F_int(u) + p F_pressure(u) + Omega^2 S (X + u) + gamma1 Omega B u = f_contact, with the road as a
bound z + u_z >= z_road on the tread dofs, f_contact >= 0 where it is active.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from fem import compat, kinematics
from fem.body import Body

TOUCH = 1e-15  # m above its bound up to which a dof touches the road: rounding, nothing else


@dataclass(frozen=True)
class Rolling:
    """Steady rolling: speed Omega in rad/s, damping gamma1 in 1/s. At speed 0 nothing is added."""

    speed: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Step:
    """How one equilibrium solve ended; `residual` is relative to the force scale."""

    converged: bool
    iterations: int
    residual: float
    reason: str


class Equilibrium:
    """The nonlinear problem of one body. Forms, matrix and SNES are made once. Collective.

    `inflation` (Pa) may be changed between solves; `solve` starts from the body's displacement and
    puts it back when it does not converge.
    """

    def __init__(self, body: Body, rolling: Rolling = Rolling()):
        self.body = body
        self.pressure = fem.Constant(body.mesh, 0.0)
        residual = static_residual(body, self.pressure, rolling)
        self._residual = compat.form(residual)
        self._tangent = compat.form(ufl.derivative(residual, body.u))
        self._clamp = [body.clamp()]
        self.matrix = fem.petsc.create_matrix(self._tangent)
        self._work = fem.petsc.create_vector(self._residual)
        self._lower = self._work.duplicate()
        self._upper = self._work.duplicate()
        self._upper.set(PETSc.INFINITY)
        symmetric = rolling.speed * rolling.damping == 0.0
        self._snes = self._make_snes("cholesky" if symmetric else "lu")
        self._scale: float | None = None

    def _make_snes(self, factorisation: str) -> PETSc.SNES:
        prefix = "static_"
        options = PETSc.Options(prefix)
        defaults = {
            "snes_type": "vinewtonrsls",
            # PETSc takes a dof within 1e-8 (metres, here) of its bound as touching; only contact is.
            "snes_vi_zero_tolerance": TOUCH,
            "snes_max_it": 25,
            "snes_rtol": 0.0,
            "snes_stol": 0.0,
            "ksp_type": "preonly",
            "pc_type": factorisation,
            "pc_factor_mat_solver_type": "mumps",
        }
        for key, value in defaults.items():
            if not options.hasName(key):
                options[key] = value
        snes = PETSc.SNES().create(self.body.comm)
        snes.setOptionsPrefix(prefix)
        snes.setFunction(self._assemble_residual, self._work.duplicate())
        snes.setJacobian(self._assemble_tangent, self.matrix)
        snes.setFromOptions()
        return snes

    def solve(self, road_height: float | None = None) -> Step:
        """Equilibrium with the road plane at the given height (m), or without a road. Collective."""
        body = self.body
        start = body.owned(body.u.x.array).copy()
        x = self._work.duplicate()
        x.array[:] = start.ravel()
        self._place_road(road_height, x)
        self._snes.setTolerances(atol=1e-12 * self._force_scale(x), rtol=0.0, stol=0.0)
        self._snes.solve(None, x)
        reason = self._snes.getConvergedReason()
        step = Step(
            reason > 0,
            self._snes.getIterationNumber(),
            self._snes.getFunctionNorm() / self._scale,
            _reason_name(reason),
        )
        self._take(x if step.converged else start)
        x.destroy()
        return step

    def contact_force(self) -> np.ndarray:
        """Vertical force of the road on the owned nodes (nodes,), N: the residual where the bound acts."""
        body = self.body
        x = self._work.duplicate()
        x.array[:] = body.owned(body.u.x.array).ravel()
        out = self._work.duplicate()
        self._assemble_residual(None, x, out)
        force = np.zeros(body.nodes)
        vertical = out.array.reshape(-1, 3)[body.tread, 2]
        bound = self._lower.array.reshape(-1, 3)[body.tread, 2]
        at_road = x.array.reshape(-1, 3)[body.tread, 2] <= bound + TOUCH
        force[body.tread] = np.where(at_road, vertical, 0.0)
        x.destroy()
        out.destroy()
        return force

    def tread_height(self) -> np.ndarray:
        """Height z + u_z of the owned tread nodes, m, in the order of `body.tread`."""
        return self._tread_z + self.body.owned(self.body.u.x.array)[self.body.tread, 2]

    @property
    def _tread_z(self) -> np.ndarray:
        return self.body.space.tabulate_dof_coordinates()[self.body.tread, 2]

    def _place_road(self, road_height: float | None, x: PETSc.Vec) -> None:
        """Set the bound and lift what is below it: the reduced-space Newton starts feasible."""
        self._lower.set(-PETSc.INFINITY)
        if road_height is not None:
            bound = road_height - self._tread_z
            self._lower.array.reshape(-1, 3)[self.body.tread, 2] = bound
            x.array[:] = np.maximum(x.array, self._lower.array)
        self._snes.setVariableBounds(self._lower, self._upper)

    def _force_scale(self, x: PETSc.Vec) -> float:
        """N: stiffness of a dof times the wall, so that 1e-12 of it is far below any load of interest.

        Once per problem: the tangent at the first state is stiff enough a yardstick for all.
        """
        if self._scale is None:
            self._assemble_tangent(None, x, self.matrix, self.matrix)
            diagonal = self.matrix.getDiagonal()
            self._scale = (
                self.body.tire.section.thickness * diagonal.norm() / np.sqrt(diagonal.size)
            )
        return self._scale

    def _take(self, x: PETSc.Vec | np.ndarray) -> None:
        """Make x the body's displacement."""
        values = x.array_r if isinstance(x, PETSc.Vec) else x
        self.body.owned(self.body.u.x.array)[:] = values.reshape(-1, 3)
        self.body.u.x.scatter_forward()

    def _assemble_residual(self, _snes, x: PETSc.Vec, out: PETSc.Vec) -> None:
        self._take(x)
        with self._work.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._work, self._residual)
        self._work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        out.array[:] = self._work.array
        rim = self.body.rim[self.body.rim < self.body.nodes]
        out.array.reshape(-1, 3)[rim] = x.array_r.reshape(-1, 3)[rim]

    def _assemble_tangent(self, _snes, x: PETSc.Vec, matrix: PETSc.Mat, _p: PETSc.Mat) -> None:
        self._take(x)
        matrix.zeroEntries()
        fem.petsc.assemble_matrix(matrix, self._tangent, bcs=self._clamp)
        matrix.assemble()


def static_residual(body: Body, pressure, rolling: Rolling):
    """The virtual work of everything but the road, as a UFL form in the body's displacement."""
    work = elastic_work(body, pressure)
    return work + _rolling_work(body, rolling) if rolling.speed else work


def elastic_work(body: Body, pressure):
    """The virtual work of the stresses and of the follower pressure.

    The dilatation is integrated by one Gauss point a direction less than the rest. In full it locks:
    first frequency of the clamped torus at Poisson's ratio 0.4995, order 2, 20 x 8 and 40 x 16
    elements, 137 and 99 Hz against 94 and 88 Hz so (87 Hz with discontinuous pressures of order 1);
    at 0.45 it is 104 and 87.1 against 91 and 85.6 (84.9 converged). No unknowns are added: every
    one keeps a positive mass. Source: Malkus and Hughes 1978, doi 10.1016/0045-7825(78)90005-1.
    """
    u, v = body.u, ufl.TestFunction(body.space)
    F = ufl.variable(kinematics.deformation_gradient(u))
    distortion, dilatation = body.wall.energy(F.T * F)
    work = ufl.inner(ufl.diff(distortion, F), ufl.grad(v)) * body.dx
    work += ufl.inner(ufl.diff(dilatation, F), ufl.grad(v)) * body.reduced_dx
    normal = ufl.FacetNormal(body.mesh)
    return work + pressure * kinematics.pressure_virtual_work(u, v, normal) * body.inner_ds


def _rolling_work(body: Body, rolling: Rolling):
    """The virtual work of inertia and of damping by the mass."""
    u, v = body.u, ufl.TestFunction(body.space)
    w = kinematics.wheel_velocity(body.mesh)
    rate, test_rate = w + kinematics.convective(u, w), kinematics.convective(v, w)
    # Constants and not numbers: another speed compiles nothing.
    inertia = fem.Constant(body.mesh, rolling.speed**2)
    drag = fem.Constant(body.mesh, rolling.speed * rolling.damping)
    work = -inertia * body.wall.density * ufl.inner(rate, test_rate) * body.dx
    return work + drag * body.wall.density * ufl.inner(kinematics.body_rate(u, w), v) * body.dx


def _reason_name(reason: int) -> str:
    """PETSc's name of a converged or diverged reason."""
    names = vars(PETSc.SNES.ConvergedReason)
    return next((n for n, v in names.items() if v == reason and not n.startswith("_")), str(reason))
