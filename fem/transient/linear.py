"""Full finite elements in time about a static state, in the non-rotating frame: the reference.

    M u'' + (D + 2 Omega G) u' + K_Omega u = W^T f,   D = gamma1 M + gamma2 K,

integrated by the method of Wood, Bossak and Zienkiewicz (1980), M [(1 - a) u''_{n+1} + a u''_n] +
... = f_{n+1}: second order, unconditionally stable, with spectral radius rho for frequencies that
the step does not resolve: a = (rho - 1)/(rho + 1), gamma = 1/2 - a, beta = (1 - a)^2/4. rho = 1 is
Newmark's average acceleration, which chatters in unilateral contact and does not converge there;
rho = 0 does not chatter. One factorisation in total, and one pair of triangular solves per step.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.axle import Axle
from tireroad.fem.cavity.column import Column
from tireroad.fem.collective import summed
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import on_own_rows, rotating_damping, rotating_stiffness
from tireroad.fem.matrices.direct import factorise, solve_columns
from tireroad.fem.matrices.operators import Operators, Rotation
from tireroad.fem.matrices.rim_motion import RimMotion
from tireroad.fem.transient.air_step import AirStep
from tireroad.fem.transient.modal_damping import ModalDamping
from tireroad.fem.transient.wheel_step import Wheel, WheelStep

# State carried from step to step; `balanced` is the mean of two accelerations that satisfies
# equilibrium at the end of the step.
_STATE = ("displacement", "velocity", "acceleration", "balanced")


class FullTire:
    """All degrees of freedom of the tire, between forces and displacements of the patch.

    The interface is that of greens.recursion.Recursion, so the same contact loop runs on it.
    `outputs` (r, 3 s) and `loads` (k, 3 s) are weights of the outer face's nodes; `air`: the
    cavity's air, whose coordinates follow the tire's; `corner`: suspension and rim coupling of a
    moving wheel, without `air` and `modal`; the unknowns are then the tire's whole motion, followed
    by the wheel's. `modal`: damping by modes in addition to `damping`, (gamma1 1/s, gamma2 s). All
    methods are collective.
    """

    def __init__(
        self,
        *,
        operators: Operators,
        rotation: Rotation | None,
        speed: float,
        damping: tuple[float, float],
        step: float,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        inertia: str = "full",
        spectral_radius: float = 0.0,
        air: Column | None = None,
        modal: ModalDamping | None = None,
        corner: tuple[Axle, RimMotion] | None = None,
    ) -> None:
        if corner and (air or modal):
            raise InputError("a full tire on a corner has neither air nor loss factors here")
        self._set_scheme(step, spectral_radius)
        self._operators, self.comm, self._step = operators, operators.body.comm, step
        self._mass, self._carried = operators.mass, operators.carried
        self._outputs = on_own_rows(operators, outputs).T.tocsr()
        self._drag = rotating_damping(operators, rotation, speed, damping, inertia)
        stiffness = rotating_stiffness(operators, rotation, speed, damping, inertia)
        wheel = Wheel(operators, *corner[::-1], speed, self._drag, stiffness) if corner else None
        system = stiffness.copy()
        different = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        share = self._gamma / (self._beta * step)
        system.axpy(share, self._drag, different)
        diagonal = system.getDiagonal()
        diagonal.array[:] += (1 - self._a) / (self._beta * step**2) * self._mass
        system.setDiagonal(diagonal)
        system.setOption(PETSc.Mat.Option.SYMMETRIC, speed == 0)
        self._solver = factorise(system)
        self._columns = on_own_rows(operators, loads).toarray()
        self._modal, self._system = modal, system
        self._joined = modal.joined(self._by_factors, share) if modal else None
        # Full motion per unit force at the end of a step: the response of a step is then one
        # product.
        self._answer = self._solved_columns(self._columns)
        self._tire = len(self._mass)
        self.wheel, self._air = wheel, None
        if air or wheel:
            self._air = self._with(air, wheel)
        self.same_step = summed(self.comm, self._outputs @ self._answer[: self._tire])
        n = len(self._mass)
        self.displacement, self.velocity, self.acceleration, self.balanced = np.zeros((4, n))
        self._vectors = system.createVecs()

    def _with(self, air: Column | None, wheel: Wheel | None) -> AirStep | WheelStep:
        """Include air or wheel: append its unknowns to all arrays with one row each. Collective."""
        first = self._gamma / (self._beta * self._step)
        second = (1 - self._a) / (self._beta * self._step**2)
        part: AirStep | WheelStep
        if air is not None:
            part = AirStep(air, self._solved_columns, (first, second))
        else:
            assert wheel is not None, "neither air nor wheel"
            part = WheelStep(wheel, self._solved_columns, (first, second))
        self._answer = part.complete(self._answer, np.zeros((part.count, self._answer.shape[1])))
        self._columns = np.pad(self._columns, ((0, part.rows), (0, 0)))
        self._mass = np.append(self._mass, np.ones(part.rows))
        self._carried = np.hstack([self._carried, part.momentum()])
        return part

    def _set_scheme(self, step: float, spectral_radius: float) -> None:
        self._a = (spectral_radius - 1) / (spectral_radius + 1)
        self._gamma, self._beta = 0.5 - self._a, (1 - self._a) ** 2 / 4

    def start(self, force: np.ndarray) -> None:
        """Start from rest with a force (k,) N that is present at t = 0."""
        self.acceleration = self.balanced = self._columns @ force / self._mass

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step without new force."""
        h, a, beta, gamma = self._step, self._a, self._beta, self._gamma
        moved = self.displacement + h * self.velocity
        kept = (0.5 / beta - 1) * self.acceleration
        right = (1 - a) * (moved / (beta * h**2) + kept) - a * self.acceleration
        rate = gamma / (beta * h) * moved - self.velocity
        rate += h * (gamma * kept - (1 - gamma) * self.acceleration)
        self._free = self._solved(self._mass * right + self._product(rate))
        return summed(self.comm, self._outputs @ self._free[: self._tire])

    def _by_factors(self, right: np.ndarray) -> np.ndarray:
        """Own rows (n, k) of the sparse system^-1 right, checked."""
        return solve_columns(self._solver, self._system, right)

    def _solved_columns(self, right: np.ndarray) -> np.ndarray:
        """As `_by_factors`, with the modal damping in the system."""
        return (self._joined or self._by_factors)(right)

    def _solved(self, right: np.ndarray) -> np.ndarray:
        """Displacement (own rows) in equilibrium with forces (own rows) at the end of the step."""
        own, air = np.split(right, [self._tire])
        if self._air:
            air = self._air.shared(air)
            own = self._air.right(own, air)
        if self._joined:
            free = self._joined(own[:, None])[:, 0]
        else:
            b, x = self._vectors
            b.array[:] = own
            self._solver.apply(b, x)
            free = x.array_r.copy()
        return self._air.complete(free, air) if self._air else free

    def _product(self, values: np.ndarray) -> np.ndarray:
        """(D + 2 Omega G) values, own rows."""
        b, x = self._vectors
        own, air = np.split(values, [self._tire])
        b.array[:] = own
        self._drag.mult(b, x)
        product = x.array_r.copy()
        if self._modal:
            product += self._modal.force(own)
        if self._air is None:
            return product
        added, dragged = self._air.dragged(own, air)
        return np.concatenate([product + added, dragged])

    def advance(self, force: np.ndarray) -> None:
        """Apply the force (k,) N at the end of the step; call after `predict`."""
        h, beta, gamma = self._step, self._beta, self._gamma
        new = self._free + self._answer @ force
        moved = new - self.displacement - h * self.velocity
        acceleration = moved / (beta * h**2) - (0.5 / beta - 1) * self.acceleration
        self.velocity += h * ((1 - gamma) * self.acceleration + gamma * acceleration)
        # The scheme's own acceleration lags; this mean satisfies equilibrium at the end of the
        # step.
        self.balanced = (1 - self._a) * acceleration + self._a * self.acceleration
        self.displacement, self.acceleration = new, acceleration

    def wheel_motion(self) -> np.ndarray:
        """Motion (7,) of rim and body: three translations m, three rotations rad, height m."""
        assert self.wheel is not None and self._air is not None, "the wheel is held"
        return self.wheel.shown @ self._air.shared(self.displacement[self._tire :])

    def snapshot(self) -> dict[str, np.ndarray]:
        """State at all lattice nodes, (n, 3) each: m, m/s, m/s2, m/s2, on every process; "air": (4,
        a).
        """
        spread, everywhere = self._operators.spread, self._operators.body.everywhere
        states = {name: np.split(getattr(self, name), [self._tire]) for name in _STATE}
        kept = {name: everywhere(spread(own)) for name, (own, _) in states.items()}
        if self._air:
            kept["air"] = self._air.shared(np.array([air for _, air in states.values()]))
        return kept

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, before `predict`; written by any number of processes."""
        for k, name in enumerate(_STATE):
            own = self._operators.restrict(kept[name][self._operators.body.ids])
            if self._air and self._air.mine:
                own = np.concatenate([own, kept["air"][k]])
            setattr(self, name, own)

    def inertia_force(self) -> np.ndarray:
        """Rate of momentum (3,) of tire and air, N; convective parts cancel around the ring."""
        return summed(self.comm, self._carried @ self.balanced)
