"""Full finite elements in time about a static state, in the non-rotating frame: the reference.

    M u'' + (D + 2 Omega G) u' + K_Omega u = W^T f,   D = gamma1 M + gamma2 K,

by the method of Wood, Bossak and Zienkiewicz (1980), M [(1 - a) u''_{n+1} + a u''_n] + ... = f_{n+1}:
second order, unconditionally stable, damping what the step does not resolve down to a spectral
radius rho: a = (rho - 1)/(rho + 1), gamma = 1/2 - a, beta = (1 - a)^2/4. rho = 1 is Newmark's average
acceleration, which chatters in unilateral contact and does not converge there; rho = 0 is quiet.
One factorisation, then one pair of triangular solves a step.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.matrices.compliance import on_own_rows, rotating_damping, rotating_stiffness
from tireroad.fem.matrices.direct import factorise, solve_columns
from tireroad.fem.matrices.operators import Operators, Rotation
from tireroad.fem.transient.modal_damping import ModalDamping

# What a step needs of the one before; `balanced` is the mean of two accelerations that balances the
# forces at the step's end.
_STATE = ("displacement", "velocity", "acceleration", "balanced")


class FullTire:
    """All degrees of freedom of the tire between the patch's forces and displacements.

    The interface of greens.recursion.Recursion, so the same contact loop runs on it. `outputs` (r,
    3 s) and `loads` (k, 3 s) weigh the nodes of the outer face. `modal` damps beside `damping`, (gamma1
    1/s, gamma2 s). All methods are collective.
    """

    def __init__(
        self,
        operators: Operators,
        rotation: Rotation | None,
        speed: float,
        damping: tuple[float, float],
        step: float,
        outputs: sparse.csr_matrix,
        loads: sparse.csr_matrix,
        inertia: str = "full",
        spectral_radius: float = 0.0,
        modal: ModalDamping | None = None,
    ):
        self._set_scheme(step, spectral_radius)
        self._operators, self._comm, self._step = operators, operators.body.comm, step
        self._mass = operators.mass
        self._outputs = on_own_rows(operators, outputs).T.tocsr()
        self._drag = rotating_damping(operators, rotation, speed, damping, inertia)
        stiffness = rotating_stiffness(operators, rotation, speed, damping, inertia)
        system = stiffness.copy()
        different = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        share = self._gamma / (self._beta * step)
        system.axpy(share, self._drag, different)
        diagonal = system.getDiagonal()
        diagonal.array[:] += (1 - self._a) / (self._beta * step**2) * self._mass
        system.setDiagonal(diagonal)
        system.setOption(PETSc.Mat.Option.SYMMETRIC, speed == 0)
        self._solver = factorise(system)
        columns = on_own_rows(operators, loads).toarray()

        # Full motion per unit force at the end of a step: the step's answer is then one product.
        def solve(right: np.ndarray) -> np.ndarray:
            return solve_columns(self._solver, system, right)

        self._modal, self._joined = modal, modal.joined(solve, share) if modal else None
        self._answer = (self._joined or solve)(columns)
        self.same_step = self._comm.allreduce(self._outputs @ self._answer)
        n = len(self._mass)
        self.displacement, self.velocity, self.acceleration, self.balanced = np.zeros((4, n))
        self._columns = columns
        self._vectors = system.createVecs()

    def _set_scheme(self, step: float, spectral_radius: float) -> None:
        self._a = (spectral_radius - 1) / (spectral_radius + 1)
        self._gamma, self._beta = 0.5 - self._a, (1 - self._a) ** 2 / 4

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N that is already there at t = 0, the tire still at rest."""
        self.acceleration = self.balanced = self._columns @ force / self._mass

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step with no new force."""
        h, a, beta, gamma = self._step, self._a, self._beta, self._gamma
        moved = self.displacement + h * self.velocity
        kept = (0.5 / beta - 1) * self.acceleration
        right = (1 - a) * (moved / (beta * h**2) + kept) - a * self.acceleration
        rate = gamma / (beta * h) * moved - self.velocity
        rate += h * (gamma * kept - (1 - gamma) * self.acceleration)
        self._free = self._solved(self._mass * right + self._product(rate))
        return self._comm.allreduce(self._outputs @ self._free)

    def _solved(self, right: np.ndarray) -> np.ndarray:
        """Own rows of the step's system^-1 right."""
        if self._joined is not None:
            return self._joined(right[:, None])[:, 0]
        b, x = self._vectors
        b.array[:] = right
        self._solver.apply(b, x)
        return x.array_r.copy()

    def _product(self, values: np.ndarray) -> np.ndarray:
        """(D + 2 Omega G) values, own rows."""
        b, x = self._vectors
        b.array[:] = values
        self._drag.mult(b, x)
        out = x.array_r.copy()
        return out if self._modal is None else out + self._modal.force(values)

    def advance(self, force: np.ndarray) -> None:
        """Take the force (k,) N at the end of the step; after `predict`."""
        h, beta, gamma = self._step, self._beta, self._gamma
        new = self._free + self._answer @ force
        moved = new - self.displacement - h * self.velocity
        acceleration = moved / (beta * h**2) - (0.5 / beta - 1) * self.acceleration
        self.velocity += h * ((1 - gamma) * self.acceleration + gamma * acceleration)
        # The scheme's own unknown lags: this is the mean that balances the forces at the step's end.
        self.balanced = (1 - self._a) * acceleration + self._a * self.acceleration
        self.displacement, self.acceleration = new, acceleration

    def snapshot(self) -> dict[str, np.ndarray]:
        """The state at all nodes of the lattice, (n, 3) each: m, m/s, m/s2, m/s2. On every process."""
        spread, everywhere = self._operators.spread, self._operators.body.everywhere
        return {name: everywhere(spread(getattr(self, name))) for name in _STATE}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from a snapshot, between `advance` and `predict`; written on any number of processes."""
        for name in _STATE:
            own = kept[name][self._operators.body.ids]
            setattr(self, name, self._operators.restrict(own))

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N: the convective parts cancel around the ring."""
        return self._comm.allreduce(self._operators.carried @ self.balanced)
