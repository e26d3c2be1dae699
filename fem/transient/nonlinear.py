"""Full finite elements in time with large motions, standing or rolling.

    M u'' + (D + 2 Omega G) u' + F(u) = W^T f + f_static,   D = gamma1 M + gamma2 K,

F being the internal forces of the hyperelastic wall and its cords, the follower pressure and, for a
rotating wheel, the steady-rolling forces (fem.static.virtual_work) at the total displacement, K
their tangent at the static state. The integration method is that of `fem.transient.linear` (Wood,
Bossak and Zienkiewicz); the two differ in F only. Each step is solved by iterations with the
factorisation of the linear step, to which inertia keeps the true tangent close; contact is solved
in each iteration.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from ufl.core.expr import Expr

from tireroad.fem import compat, kinematics
from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices.operators import Operators, Rotation
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    added_energy,
    added_stress,
    static_residual,
)
from tireroad.fem.tire.body import Body
from tireroad.fem.transient.linear import FullTire, ModalDamping

TOLERANCE = 1e-9  # of the largest displacement
_FLOOR = 1e-11  # of the wall's thickness: rounding of F
MOST_TURNS = 60


class NonlinearTire(FullTire):
    """The nonlinear tire between forces and displacements of the patch, about its static state.

    FullTire's interface plus `settle`: after each contact solve it tells whether the motion is in
    equilibrium, or for which free displacement to solve the contact again. `operators` are those of
    the static state at `inflation` (Pa); `turning`: rotation matrices and rolling of that state,
    None: standing. `turns`: iterations so far. All methods are collective.
    """

    def __init__(
        self,
        *,
        operators: Operators,
        inflation: float,
        damping: tuple[float, float],
        step: float,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        spectral_radius: float = 0.0,
        modal: ModalDamping | None = None,
        turning: tuple[Rotation, Rolling] | None = None,
    ) -> None:
        if operators.unknowns.rim:
            raise InputError(
                'nonlinear tire in time: modal.rim = "free" is not available; take "fixed"'
            )
        rolling = turning[1] if turning else AT_REST
        super().__init__(
            operators=operators,
            rotation=turning[0] if turning else None,
            speed=rolling.speed,
            damping=damping,
            step=step,
            outputs=outputs,
            loads=loads,
            spectral_radius=spectral_radius,
            modal=modal,
        )
        body = operators.body
        self._body, self._small = body, _FLOOR * body.ring.thickness
        self._static = body.u.x.array.copy()
        pressure = fem.Constant(body.mesh, float(inflation))
        work, potential = static_residual(body, pressure, rolling), _potential(body, pressure)
        if body.wall.stiffens:
            before, share = fem.Function(body.space), body.wall.stiffening()
            before.x.array[:] = self._static
            work += added_stress(body, share, before)
            potential += added_energy(body, share, before)
        self._force_form, self._potential_form = compat.form(work), compat.form(potential)
        self._assembled = compat.force_vector(self._force_form, body.space)
        n = len(self._mass)
        self._rest = self._at(np.zeros(n), self._forces)
        self._rest_potential = self._at(np.zeros(n), self._stored)
        self._elastic = np.zeros(n)
        self.turns = 0

    def predict(self) -> np.ndarray:
        """First estimate of the displacement (r,) m at the end of the step without new force."""
        self._tried = 0
        here = self.displacement
        return self._freed(here - self._solved(self._dynamic(here) + self._elastic))

    def settle(self, force: np.ndarray) -> np.ndarray | None:
        """None if the motion under a force (k,) N is in equilibrium; then call `advance`.

        Otherwise a better displacement (r,) m without new force, for which to solve the contact
        again. Raises ConvergenceError after MOST_TURNS iterations.
        """
        new = self._free + self._answer @ force
        elastic = self._at(new, self._forces) - self._rest
        defect = self._dynamic(new) + elastic - self._columns @ force
        change = self._solved(defect)
        largest = (float(abs(v).max(initial=0.0)) for v in (change, new))
        off, size = (self.comm.allreduce(v, op=MPI.MAX) for v in largest)
        self.turns += 1
        if off <= TOLERANCE * size + self._small:
            self._elastic = elastic
            return None
        self._tried += 1
        if self._tried > MOST_TURNS or not np.isfinite(off):
            raise ConvergenceError(
                f"full finite elements: a step of {self._step:g} s leaves {off:.1e} m of "
                f"{size:.1e} m out of balance after {self._tried} iterations; the motion is too large for "
                "the step or the tire buckles: take a smaller step or a smaller motion."
            )
        return self._freed(new - change - self._answer @ force)

    def _freed(self, free: np.ndarray) -> np.ndarray:
        self._free = free
        return summed(self.comm, self._outputs @ free)

    def _dynamic(self, new: np.ndarray) -> np.ndarray:
        """Inertia and damping forces, N, if the step ends at displacement `new` (own rows)."""
        h, a, beta, gamma = self._step, self._a, self._beta, self._gamma
        moved = new - self.displacement - h * self.velocity
        acceleration = moved / (beta * h**2) - (0.5 / beta - 1) * self.acceleration
        rate = self.velocity + h * ((1 - gamma) * self.acceleration + gamma * acceleration)
        balanced = (1 - a) * acceleration + a * self.acceleration
        return self._mass * balanced + self._product(rate)

    def _at(self, motion: np.ndarray, work: ufl.Form) -> np.ndarray:
        """Value of `work()` at the static state plus a motion; the body is restored."""
        field = self._body.u.x
        field.array[self._operators.unknowns.free] += motion
        field.scatter_forward()
        result = work()
        field.array[:] = self._static
        return result

    def _forces(self) -> np.ndarray:
        """F at the body's displacement, own free rows, N."""
        with self._assembled.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._assembled, self._force_form)
        self._assembled.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        return self._assembled.array_r[self._operators.unknowns.free]

    def _stored(self) -> float:
        return self.comm.allreduce(fem.assemble_scalar(self._potential_form))

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, before `predict`; written by any number of processes."""
        super().restore(kept)
        self._elastic = self._at(self.displacement, self._forces) - self._rest

    def energy(self) -> float:
        """Kinetic energy and energy stored since the static state, J; standing wheel only."""
        kinetic = self.comm.allreduce(self._mass @ self.velocity**2) / 2
        return kinetic + self._at(self.displacement, self._stored) - self._rest_potential


def _potential(body: Body, pressure: Expr) -> ufl.Form:
    """Strain energy of wall and cords plus p V, J, in UFL.

    V(u) is the volume enclosed by the inner face, whose edges are fixed."""
    F = kinematics.deformation_gradient(body.u)
    distortion, dilatation = body.wall.energy(F.T * F)
    place = ufl.SpatialCoordinate(body.mesh) + body.u
    swept = kinematics.pressure_virtual_work(body.u, place, ufl.FacetNormal(body.mesh)) / 3
    wall = distortion * body.dx + dilatation * body.reduced_dx
    return wall + body.plies.energy(body.u) + pressure * swept * body.inner_ds
