"""Full finite elements in time about a static state, in the non-rotating frame: the reference.

    M u'' + (D + 2 Omega G) u' + K_Omega u = W^T f,   D = gamma1 M + gamma2 K,

integrated by the method of Wood, Bossak and Zienkiewicz (1980), M [(1 - a) u''_{n+1} + a u''_n] +
... = f_{n+1}: second order, unconditionally stable, with spectral radius rho for frequencies that
the step does not resolve: a = (rho - 1)/(rho + 1), gamma = 1/2 - a, beta = (1 - a)^2/4. rho = 1 is
Newmark's average acceleration, which chatters in unilateral contact and does not converge there;
rho = 0 does not chatter. One factorisation in total, and one pair of triangular solves per step.
Damping is that of the matrices D, of modes beside it (`ModalDamping`), or of the rubber itself
(`Relaxation`), whose memory turns with the material.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.cavity import Column
from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError, InputError, NearlySingular
from tireroad.fem.matrices.compliance import (
    add_part,
    factorise,
    multiply,
    on_own_rows,
    rotating_damping,
    rotating_stiffness,
    solve_columns,
    symmetric,
)
from tireroad.fem.matrices.operators import Operators, RimMotion, Rotation, carried_pencil
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.mesh import NodeGrid
from tireroad.fem.wheel import Axle

Array = np.ndarray
# State carried from step to step; `balanced` is the mean of two accelerations that satisfies
# equilibrium at the end of the step.
_STATE = ("displacement", "velocity", "acceleration", "balanced")
TOLERANCE = 1e-9  # of the largest displacement
_FLOOR = 1e-11  # of the wall's thickness: rounding of F
MOST_TURNS = 90
_MOST_MET = 500  # solutions of the contact in one of them
# Iterations of a step that may pass until a tenth is left of what is out of balance; then the matrix is factorised anew, which
# takes as long as some ten of them. From then on it is at every one that leaves more than a part.
PATIENT, GAIN, LEFT = 4, 0.1, 0.3
_ASTRAY = 10.0  # times what the nearest trial leaves: nothing is known of the motion there
SECANTS = 40  # kept at most
_DEPENDENT = 1e-12  # squares of their singular values that are taken for none, of the largest
_RESTING = 1e-11  # of the forces: residual of a shape at rest in space
_PART = 0.1  # of what is out of balance: changes of the contact's forces that are not felt


class ModalDamping:
    """`fields`: own rows (n, m) of M-orthonormal modes, kg^-1/2; `excess` (m, m) 1/s. Collective.

    `body`: the matrix B of a wheel that rotates at `speed` (rad/s), None if standing.

    A low-rank matrix in addition to the sparse ones,

        D_x = M Phi E Phi^T M,   and in the rolling pencil
        K_x = Omega D_x M^-1 B = Omega M Phi E Phi^T B,

    E being the damping of the modes in excess of the sparse matrices' uniform one. A system A + c
    D_x + K_x is solved with A's factorisation and a small matrix (Sherman, Morrison and Woodbury).
    """

    def __init__(
        self,
        operators: Operators,
        fields: np.ndarray,
        excess: np.ndarray,
        body: PETSc.Mat | None = None,
        speed: float = 0.0,
    ) -> None:
        self._comm, self._fields = operators.body.comm, fields
        self._weighted = operators.mass[:, None] * fields
        self._push = self._weighted @ excess
        # Phi^T B = -(B Phi)^T: B is skew.
        self._turned = np.zeros_like(fields) if body is None else -speed * multiply(body, fields)

    def force(self, rate: np.ndarray) -> np.ndarray:
        """D_x rate, own rows, N, for velocities (n,) m/s. Collective."""
        return self._push @ summed(self._comm, self._weighted.T @ rate)

    def carried(self, motion: np.ndarray) -> np.ndarray:
        """K_x motion, own rows, N, for displacements (n,) m. Collective."""
        return self._push @ summed(self._comm, self._turned.T @ motion)

    def solver_with(
        self, solve: Callable[[np.ndarray], np.ndarray], share: float
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Solver of A + share D_x + K_x, own rows (n, k), from `solve`, that of A. Collective."""
        reading = share * self._weighted + self._turned
        through = solve(self._push)
        small = np.eye(through.shape[1]) + summed(self._comm, reading.T @ through)

        def whole(right: np.ndarray) -> np.ndarray:
            first = solve(right)
            return first - through @ np.linalg.solve(small, summed(self._comm, reading.T @ first))

        return whole


def equal_angles(lattice: NodeGrid) -> bool:
    """Whether the nodes of a ring lie at equal angles around."""
    angle = lattice.ring
    return np.allclose(angle, 2 * np.pi * np.arange(len(angle)) / len(angle), rtol=0, atol=1e-9)


class Around:
    """Fourier factors of fields around the axle, by the harmonics of their cylindrical components. Collective to make.

    A field (n, k) on own unknowns is gathered on every process, whose section's nodes are at equal angles
    theta_j, and each component (radial, tangential, along the axle) becomes

        v(theta) = sum_m v_m e^{i m theta}  ->  sum_m f_m v_m e^{i m theta}

    with factors f (m, k or 1) for m from 0 to half the number of nodes around. Exact for what the nodes hold,
    nothing is interpolated. Each call sends the n k numbers of all processes to all, which transform them alike.
    InputError for nodes at unequal angles.
    """

    def __init__(self, operators: Operators) -> None:
        self._operators, lattice = operators, operators.body.lattice
        self._shape, angle = lattice.shape, lattice.ring
        if not equal_angles(lattice):
            raise InputError(
                "rubber that relaxes in full finite elements of a turning tire needs nodes at equal angles around the "
                "axle: take tire.footprint_size = 1 and tire.order = 1 or 2"
            )
        sine, cosine, none = np.sin(angle), np.cos(angle), np.zeros_like(angle)
        rows = (sine, none, -cosine), (cosine, none, sine), (none, none + 1, none)
        self._turn = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    def turning(self, angle: float) -> Array:
        """Factors (m, 1) of turning the field by an angle (rad), against theta.

        Real for two nodes a wave, which have no direction in which to move.
        """
        around = self._shape[0]
        factors = np.exp(1j * angle * np.arange(around // 2 + 1))
        if around % 2 == 0:
            factors[-1] = factors[-1].real
        return factors[:, None]

    def __call__(self, fields: Array, factors: Array) -> Array:
        """Own rows (n, k) of the fields (n, k) times the factors. Collective."""
        operators, (around, across) = self._operators, self._shape
        every = operators.body.everywhere(operators.spread(fields))
        every = every.reshape(around, across, 3, -1)
        series = np.fft.rfft(np.einsum("aij,asjk->asik", self._turn, every), axis=0)
        series *= factors[:, None, None, :]
        turned = np.fft.irfft(series, around, axis=0)
        back = np.einsum("aji,asjk->asik", self._turn, turned).reshape(around * across, 3, -1)
        return operators.restrict(back[operators.body.ids])


class Relaxation:
    """The memory of rubber in implicit steps of `step` s, of a tire that turns at `speed` (rad/s). Collective.

    Every compound c is a Prony series: of its instantaneous modulus e_c the parts g_ck relax in the times t_k,
    both moduli over the storage modulus at DYNAMIC_FREQUENCY, which the stiffness K has. With K_c the compounds' own
    part of K (fem.matrices.operators.Compound; stress, pressure and cords are elastic) the wall resists a motion u with

        F = K u + sum_c [(e_c - 1) K_c u - sum_k g_ck K_c z_k],     z_k + t_k Dz_k/Dt = u,

    a displacement z_k for each relaxation time. It is carried with the material through a mesh that stands, so that

        D/Dt = d/dt - Omega d/dtheta

    on cylindrical components. Along the path of the material u is taken to be linear over a step h: with x = h / t_k
    and S the turning by Omega h about the axle (`Around`),

        z+ = e^-x S z + (p - e^-x) S u + (1 - p) u+,    p = (1 - e^-x) / x,

    of second order in h and stable for any x. About a state that is not alike all around, K_c at a place is that of
    the material there now, as in the modes' law. `memory` (n, k) m: z on own unknowns.

    InputError if a compound has losses that are no Prony series, and for Omega where nodes are at unequal angles.
    """

    def __init__(self, operators: Operators, step: float, speed: float) -> None:
        compounds = operators.compounds()
        series = [one.kind.spectrum.relaxing() for one in compounds]
        times = np.array(sorted({time for _, parts in series for time in parts}))
        self._parts = [one.stiffness for one in compounds]
        self._instant = np.array([instant for instant, _ in series])
        shares = [[parts.get(t, 0.0) for t in times] for _, parts in series]
        self._shares = np.reshape(shares, (len(series), len(times)))
        self._around = Around(operators) if speed else None
        x = step / times
        self._kept, mean = np.exp(-x), -np.expm1(-x) / x
        self._before, self._after = mean - self._kept, 1 - mean
        self._turned = self._around.turning(speed * step) if self._around else np.ones((1, 1))
        self.memory = np.zeros((len(operators.mass), len(times)))

    def stiffen(self, stiffness: PETSc.Mat) -> None:
        """Give the matrix K its instantaneous moduli."""
        for instant, part in zip(self._instant, self._parts, strict=True):
            add_part(stiffness, instant - 1, part)

    def soften(self, system: PETSc.Mat) -> None:
        """Take from a matrix with instantaneous moduli what relaxes within a step."""
        for relaxed, part in zip(self._shares @ self._after, self._parts, strict=True):
            add_part(system, -relaxed, part)

    def remembered(self, before: Array) -> Array:
        """Force (own rows) N by the motions up to `before` (own rows), a step ago, at the end of the step."""
        carried = self._kept * self.memory + self._before * before[:, None]
        self._carried = self._around(carried, self._turned) if self._around else carried
        return self.force(self._carried)

    def advance(self, new: Array) -> None:
        """End the step at displacement `new` (own rows); call after `remembered`."""
        self.memory = self._carried + self._after * new[:, None]

    def steady(self, motion: Array) -> Array:
        """The memory of a motion (own rows) that has always rested in space."""
        whole = np.repeat(motion[:, None], len(self._kept), axis=1)
        if self._around is None:
            return whole
        turned = self._turned
        gone = (self._after + self._before * turned) / (1 - self._kept * turned)
        return self._around(whole, gone)

    def force(self, memory: Array) -> Array:
        """sum_c,k g_ck K_c z_k, own rows, N, of a memory (n, k)."""
        out = np.zeros(len(memory))
        for part, shares in zip(self._parts, self._shares, strict=True):
            out += multiply(part, (memory @ shares)[:, None])[:, 0]
        return out


class _Resting:
    """The stiffness of motions at rest in space (PETSc's Python matrix), of a matrix with instantaneous moduli."""

    def __init__(self, stiffness: PETSc.Mat, relaxation: Relaxation) -> None:
        self._stiffness, self._relaxation = stiffness, relaxation

    def mult(self, matrix: PETSc.Mat, motion: PETSc.Vec, force: PETSc.Vec) -> None:
        """The force of a motion. Collective."""
        self._stiffness.mult(motion, force)
        force.array[:] -= self._relaxation.force(self._relaxation.steady(motion.array_r))

    def solve(self, force: Array) -> Array:
        """The motion (own rows) under a force (own rows) N, by GMRES. Collective.

        ConvergenceError near a critical speed.
        """
        stiffness = self._stiffness
        whole = PETSc.Mat().createPython(stiffness.getSizes(), self, comm=stiffness.comm)
        whole.setUp()
        solver = PETSc.KSP().create(stiffness.comm)
        solver.setOperators(whole, stiffness)
        solver.setType(PETSc.KSP.Type.GMRES)
        solver.getPC().setType(PETSc.PC.Type.LU)
        solver.getPC().setFactorSolverType("mumps")
        solver.setTolerances(rtol=_RESTING)
        right, found = stiffness.createVecs()
        right.array[:] = force
        solver.solve(right, found)
        if solver.getConvergedReason() <= 0:
            raise ConvergenceError(
                "full finite elements: no shape at rest under constant forces was found, as at a critical speed. "
                "Lower the speed."
            )
        motion = found.array_r.copy()
        for used in (solver, whole, right, found):
            used.destroy()
        return motion


class AirStep:
    """`solve` maps own rows (n, k) to own rows of A^-1 times them; `weights` are (c1 1/s, c2 1/s2).
    Creation and all methods are collective.

    The air in an implicit step, eliminated:

        [A + E E^T    -E' w ] [u]   [r]
        [ -w E'^T       Z   ] [g] = [q],    Z = c2 + c1 D_a + K_a,

    A being the tire's matrix of the step, E = e^T, the rest as in fem.cavity. The air's unknowns
    follow the tire's on the last process.
    """

    def __init__(
        self,
        air: Column,
        solve: Callable[[np.ndarray], np.ndarray],
        weights: tuple[float, float],
    ) -> None:
        self._air, self._comm = air, air.comm
        self.mine = air.comm.rank == air.comm.size - 1
        self.count = len(air.duct.circular)
        self._drag, stiffness = air.duct.pencil(air.speed)
        first, second = weights
        own = second * np.eye(self.count) + first * self._drag + stiffness
        self._inverse = np.linalg.inv(own)
        self._driven = air.duct.circular
        weight = np.eye(1 + self.count)
        weight[1:, 1:] -= self._driven[:, None] * self._inverse * self._driven
        self._columns = solve(air.pushed.toarray())
        core = np.eye(1 + self.count) + air.coupling(self._columns) @ weight
        self._mend = weight @ np.linalg.inv(core)

    @property
    def rows(self) -> int:
        """Number of the air's unknowns on this process."""
        return self.count if self.mine else 0

    def shared(self, own: np.ndarray) -> np.ndarray:
        """The air's values (a, ...) on every process, from the owner's."""
        return self._comm.bcast(own if self.mine else None, root=self._comm.size - 1)

    def right(self, own: np.ndarray, air: np.ndarray) -> np.ndarray:
        """Own rows (n,) of the tire's right-hand side, with forces (a,) on the air eliminated."""
        return own + self._air.pushed[:, 1:] @ (self._driven * (self._inverse @ air))

    def complete(self, free: np.ndarray, air: np.ndarray) -> np.ndarray:
        """Own rows (n + rows, ...) of u and g, from A^-1 right (n, ...), air forces (a, ...)."""
        u = free - self._columns @ (self._mend @ self._air.coupling(free))
        moved = self._air.coupling(u)[1:]
        g = self._inverse @ (air + (self._driven * moved.T).T)
        return np.concatenate([u, g]) if self.mine else u

    def dragged(self, tire: np.ndarray, rates: np.ndarray) -> tuple[float, np.ndarray]:
        """Damping forces: none on the tire's rows, D_a g' (rows,) on the air's."""
        return 0.0, self._drag @ rates if self.mine else rates

    def momentum(self) -> np.ndarray:
        """Momentum (3, rows) kg^1/2 per unit rate."""
        return self._air.duct.momentum[:, : self.rows]


class MovingWheel:
    """Matrices of the moving wheel. Collective to make.

    `operators` have a fixed rim; `rim`: products with the rim's motions; `axle`: suspension; `drag`
    and `stiffness`: the tire's matrices as it rolls. For damping (1) and stiffness (0): `columns`
    and `rows` (n, c) on the tire's own unknowns and `own` (c, c); `carried` (3, c) kg^1/2: momentum
    per unit rate; `shown` (7, c): motions of rim and body per x.
    """

    def __init__(
        self,
        operators: Operators,
        rim: RimMotion,
        axle: Axle,
        speed: float,
        drag: PETSc.Mat,
        stiffness: PETSc.Mat,
    ) -> None:
        self.comm = operators.body.comm
        part = axle.taking_part
        motion = rim.rows["mass"] / operators.mass[:, None]
        mass, own_drag, own_stiffness = carried_pencil(axle, rim.whole, speed)
        mass[:6, :6] -= summed(self.comm, motion.T @ rim.rows["mass"])
        lower = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(part, part)]))
        self.shown = np.zeros((7, len(part)))
        self.shown[part] = lower.T
        self.carried = mass[:3] @ self.shown
        turning = 2 * speed * rim.rows["gyroscopic"] if speed else np.zeros_like(motion)
        static = rim.rows["stiffness"] + (speed**2 * rim.rows["convective"] if speed else 0.0)
        self.columns, self.rows, self.own = {}, {}, {}
        for order, matrix, across, sign, own in (
            (1, drag, turning, -1, own_drag),
            (0, stiffness, static, 1, own_stiffness),
        ):
            along, back = multiply(matrix, motion), _transposed(matrix, motion)
            whole = own.copy()
            whole[:6, :6] += summed(
                self.comm,
                motion.T @ along - motion.T @ across - sign * across.T @ motion,
            )
            self.columns[order] = (across - along) @ self.shown[:6]
            self.rows[order] = (sign * across - back) @ self.shown[:6]
            self.own[order] = self.shown.T @ whole @ self.shown


def _transposed(matrix: PETSc.Mat, vectors: Array) -> Array:
    """X^T v, own rows (n, k). Collective."""
    before, after = matrix.createVecs()
    out = np.empty_like(vectors)
    for k, vector in enumerate(vectors.T):
        after.array[:] = vector
        matrix.multTranspose(after, before)
        out[:, k] = before.array_r
    before.destroy()
    after.destroy()
    return out


class WheelStep:
    """AirStep's counterpart for the `wheel`; `weights` (c1 1/s, c2 1/s2). All is collective.

    Small motions w of the tire relative to its rim, and xi of rim and body, have the blocks of
    modal.corner with the unit matrix in place of modes:

        X_ww, X_wr = X R, X_rw = +-(X R)^T, X_rr    of mass, damping and stiffness.

    The unknowns are the tire's whole motion u = w + R xi, and x with xi = L^-T x, L L^T being the
    inertia of rim, wheel and body alone. The mass is then diagonal, and contact and loads involve u
    only. With T = (1, -R; 0, L^-T), X' = T^T X T, a step solves

        [A   B] [u]   [r]
        [C^T Z] [x] = [s].

    The wheel's unknowns follow the tire's on the last process.
    """

    def __init__(
        self, wheel: MovingWheel, solve: Callable[[Array], Array], weights: tuple[float, float]
    ) -> None:
        self._wheel, self._comm = wheel, wheel.comm
        self.mine = wheel.comm.rank == wheel.comm.size - 1
        self.count = wheel.own[0].shape[0]
        first, second = weights
        columns = first * wheel.columns[1] + wheel.columns[0]
        self._rows = first * wheel.rows[1] + wheel.rows[0]
        own = second * np.eye(self.count) + first * wheel.own[1] + wheel.own[0]
        self._columns = solve(columns)
        self._inverse = np.linalg.inv(own - summed(self._comm, self._rows.T @ self._columns))

    @property
    def rows(self) -> int:
        """Number of the wheel's unknowns on this process."""
        return self.count if self.mine else 0

    def shared(self, own: Array) -> Array:
        """The wheel's values (c, ...) on every process, from the owner's."""
        return self._comm.bcast(own if self.mine else None, root=self._comm.size - 1)

    def right(self, own: Array, wheel: Array) -> Array:
        """Own rows of the tire's right-hand side; forces on the wheel do not contribute."""
        return own

    def complete(self, free: Array, wheel: Array) -> Array:
        """Own rows (n + rows, ...) of u and x, from A^-1 right (n, ...), wheel forces (c, ...)."""
        x = self._inverse @ (wheel - summed(self._comm, self._rows.T @ free))
        u = free - self._columns @ x
        return np.concatenate([u, x]) if self.mine else u

    def dragged(self, tire: Array, rates: Array) -> tuple[Array, Array]:
        """Damping forces on the tire's own rows (n,) and the wheel's (rows,), from the velocities
        of both. On the tire only those due to the wheel's velocity."""
        x = self.shared(rates)
        back = summed(self._comm, self._wheel.rows[1].T @ tire) + self._wheel.own[1] @ x
        return self._wheel.columns[1] @ x, back if self.mine else rates

    def momentum(self) -> Array:
        """Momentum (3, rows) kg^1/2 per unit rate."""
        return self._wheel.carried[:, : self.rows]


class FullTire:
    """All degrees of freedom of the tire, between forces and displacements of the patch.

    The interface is that of greens.recursion.Recursion, so the same contact loop runs on it.
    `outputs` (r, 3 s) and `loads` (k, 3 s) are weights of the outer face's nodes; `air`: the
    cavity's air, whose coordinates follow the tire's; `corner`: suspension and rim coupling of a
    moving wheel, without `air`, `modal` and `relaxes`; the unknowns are then the tire's whole motion, followed
    by the wheel's. `modal`: damping by modes in addition to `damping`, (gamma1 1/s, gamma2 s);
    `relaxes`: the rubber's own losses and moduli instead, by the Prony series of its compounds
    (`Relaxation`). All methods are collective.
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
        relaxes: bool = False,
        corner: tuple[Axle, RimMotion] | None = None,
    ) -> None:
        if corner and (air or modal or relaxes):
            raise InputError("a full tire on a corner has neither air nor loss factors here")
        if modal and relaxes:
            raise InputError(
                "a full tire loses by its modes or by its rubber that relaxes, not by both"
            )
        self._set_scheme(step, spectral_radius)
        self._operators, self.comm, self._step = operators, operators.body.comm, step
        self._mass, self._carried = operators.mass, operators.carried
        self._outputs = on_own_rows(operators, outputs).T.tocsr()
        self._drag = rotating_damping(operators, rotation, speed, damping, inertia)
        stiffness = rotating_stiffness(operators, rotation, speed, damping, inertia)
        wheel = (
            MovingWheel(operators, *corner[::-1], speed, self._drag, stiffness) if corner else None
        )
        relaxing = relaxes and operators.body.wall.kinds()
        self._relaxation = Relaxation(operators, step, speed) if relaxing else None
        if self._relaxation:
            self._relaxation.stiffen(stiffness)
        system = stiffness.copy()
        different = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        self._stiffness = stiffness
        share = self._gamma / (self._beta * step)
        system.axpy(share, self._drag, different)
        diagonal = system.getDiagonal()
        diagonal.array[:] += (1 - self._a) / (self._beta * step**2) * self._mass
        system.setDiagonal(diagonal)
        if self._relaxation:
            self._relaxation.soften(system)
        system.setOption(PETSc.Mat.Option.SYMMETRIC, speed == 0)
        self._columns = on_own_rows(operators, loads).toarray()
        self._modal, self._share = modal, share
        self._factorise(system)
        # Full motion per unit force at the end of a step: the response of a step is then one product.
        self._answer = self._solved_columns(self._columns)
        self._tire = len(self._mass)
        self.wheel, self._air = wheel, None
        if air or wheel:
            self._air = self._with(air, wheel)
        self.same_step = summed(self.comm, self._outputs @ self._answer[: self._tire])
        n = len(self._mass)
        self.displacement, self.velocity, self.acceleration, self.balanced = np.zeros((4, n))
        self._vectors = system.createVecs()

    def _factorise(self, system: PETSc.Mat) -> None:
        """Take this matrix of a step, and its factor. Collective."""
        self._system, self._solver = system, factorise(system)
        self._with_modes = None
        if self._modal:
            self._with_modes = self._modal.solver_with(self._by_factors, self._share)

    def _with(self, air: Column | None, wheel: MovingWheel | None) -> AirStep | WheelStep:
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

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray:
        """Begin at rest in the non-rotating frame under a force (k,) N that always was, with a `sudden` one beside it.

        Factorises the stiffness once. Returns the displacement (r,) m; InputError with air or a moving wheel.
        """
        if self._air:
            raise InputError(
                "full finite elements with air or a moving wheel begin without horizontal forces"
            )
        self.start(np.zeros_like(force) if sudden is None else sudden)
        pushed = self._columns @ force
        if self._relaxation:
            self.displacement = _Resting(self._stiffness, self._relaxation).solve(pushed)
            self._relaxation.memory = self._relaxation.steady(self.displacement)
        else:
            factor = factorise(self._stiffness)
            self.displacement = solve_columns(factor, self._stiffness, pushed[:, None])[:, 0]
        return summed(self.comm, self._outputs @ self.displacement)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step without new force."""
        h, a, beta, gamma = self._step, self._a, self._beta, self._gamma
        moved = self.displacement + h * self.velocity
        kept = (0.5 / beta - 1) * self.acceleration
        right = (1 - a) * (moved / (beta * h**2) + kept) - a * self.acceleration
        rate = gamma / (beta * h) * moved - self.velocity
        rate += h * (gamma * kept - (1 - gamma) * self.acceleration)
        right = self._mass * right + self._product(rate)
        if self._relaxation:
            right[: self._tire] += self._relaxation.remembered(self.displacement[: self._tire])
        self._free = self._solved(right)
        return summed(self.comm, self._outputs @ self._free[: self._tire])

    def _by_factors(self, right: np.ndarray) -> np.ndarray:
        """Own rows (n, k) of the sparse system^-1 right, checked."""
        return solve_columns(self._solver, self._system, right)

    def _solved_columns(self, right: np.ndarray) -> np.ndarray:
        """As `_by_factors`, with the modal damping in the system."""
        return (self._with_modes or self._by_factors)(right)

    def _solved(self, right: np.ndarray) -> np.ndarray:
        """Displacement (own rows) in equilibrium with forces (own rows) at the end of the step."""
        own, air = np.split(right, [self._tire])
        if self._air:
            air = self._air.shared(air)
            own = self._air.right(own, air)
        if self._with_modes:
            free = self._with_modes(own[:, None])[:, 0]
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
        self._move_to(self._free + self._answer @ force)

    def _move_to(self, new: np.ndarray) -> None:
        """End the step with a displacement (own rows)."""
        h, beta, gamma = self._step, self._beta, self._gamma
        moved = new - self.displacement - h * self.velocity
        acceleration = moved / (beta * h**2) - (0.5 / beta - 1) * self.acceleration
        self.velocity += h * ((1 - gamma) * self.acceleration + gamma * acceleration)
        # The scheme's own acceleration lags; this mean satisfies equilibrium at the end of the
        # step.
        self.balanced = (1 - self._a) * acceleration + self._a * self.acceleration
        self.displacement, self.acceleration = new, acceleration
        if self._relaxation:
            self._relaxation.advance(new[: self._tire])

    def wheel_motion(self) -> np.ndarray:
        """Motion (7,) of rim and body: three translations m, three rotations rad, height m."""
        assert self.wheel is not None and self._air is not None, "the wheel is held"
        return self.wheel.shown @ self._air.shared(self.displacement[self._tire :])

    def snapshot(self) -> dict[str, np.ndarray]:
        """State at all lattice nodes, (n, 3) each: m, m/s, m/s2, m/s2, on every process; "air": (4,
        a); "memory" (n, 3, k) m of rubber that relaxes.
        """
        spread, everywhere = self._operators.spread, self._operators.body.everywhere
        states = {name: np.split(getattr(self, name), [self._tire]) for name in _STATE}
        kept = {name: everywhere(spread(own)) for name, (own, _) in states.items()}
        if self._air:
            kept["air"] = self._air.shared(np.array([air for _, air in states.values()]))
        if self._relaxation:
            kept["memory"] = everywhere(spread(self._relaxation.memory))
        return kept

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, before `predict`; written by any number of processes."""
        for k, name in enumerate(_STATE):
            own = self._operators.restrict(state[name][self._operators.body.ids])
            if self._air and self._air.mine:
                own = np.concatenate([own, state["air"][k]])
            setattr(self, name, own)
        if self._relaxation:
            memory = state["memory"][self._operators.body.ids]
            self._relaxation.memory = self._operators.restrict(memory)

    def inertia_force(self) -> np.ndarray:
        """Rate of momentum (3,) of tire and air, N; convective parts cancel around the ring."""
        return summed(self.comm, self._carried @ self.balanced)


class Secants:
    """Quasi-Newton steps by least squares for x (n,) whose rest d(x) is to be 0, kept from problem to problem.

    With the differences dX, dD (n, m) of the last m tries x + dX a + d + dD a follows x, a that of the least |d + dD a|
    (IQN-ILS: Degroote, Bathe and Vierendeels 2009, doi 10.1016/j.compstruc.2008.11.013). Own rows; collective.
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self._comm = comm
        self._moves: list[np.ndarray] = []
        self._changes: list[np.ndarray] = []
        self._last: tuple[np.ndarray, np.ndarray] | None = None

    def begin(self) -> None:
        """Another problem begins, near the last one."""
        self._last = None

    def state(self) -> np.ndarray:
        """The differences (n, 2 m) between two problems."""
        held = self._moves + self._changes
        return np.stack(held, axis=1) if held else np.zeros((0, 0))

    def set_state(self, held: np.ndarray) -> None:
        """Continue from a `state`."""
        count = held.shape[1] // 2
        self._moves, self._changes = list(held.T[:count].copy()), list(held.T[count:].copy())

    def next(self, x: np.ndarray, rest: np.ndarray) -> np.ndarray:
        """The next x, from one and its rest."""
        if self._last is not None:
            self._moves.append(x - self._last[0])
            self._changes.append(rest - self._last[1])
            del self._moves[:-SECANTS], self._changes[:-SECANTS]
        self._last = x, rest
        if not self._moves:
            return x + rest
        changes = np.stack(self._changes, axis=1)
        gram = summed(self._comm, changes.T @ np.column_stack([changes, rest]))
        size = np.sqrt(np.maximum(gram.diagonal(), np.finfo(float).tiny))
        squares, turn = np.linalg.eigh(gram[:, :-1] / size / size[:, None])
        kept = squares > _DEPENDENT * squares[-1]
        part = turn[:, kept] / squares[kept] @ (turn[:, kept].T @ (gram[:, -1] / size)) / size
        return x + rest - (np.stack(self._moves, axis=1) + changes) @ part


class _Trial(NamedTuple):
    """A motion (own rows) under a force (k,) N, the forces out of balance there, N, and how far that is `off`, m."""

    off: float
    motion: np.ndarray
    defect: np.ndarray
    force: np.ndarray


class NonlinearTire(FullTire):
    """The nonlinear tire between forces and displacements of the patch, about its static state.

    FullTire's interface plus `settle`: after each contact solve it tells whether the motion is in
    equilibrium, or for which free displacement to solve the contact again. `operators` are those of
    the static state at `inflation` (Pa); `turning`: rotation matrices and rolling of that state,
    None: standing. `turns`: iterations so far, `factors`: matrices factorised. All methods are collective.

        M u'' + (D + 2 Omega G) u' + F(u) = W^T f + f_static,   D = gamma1 M + gamma2 K,

    F being the internal forces of the hyperelastic wall and its cords, the follower pressure and, for a
    rotating wheel, the steady-rolling forces (fem.static.virtual_work) at the total displacement, K
    their tangent at the static state. The integration method is that of `fem.transient` (Wood,
    Bossak and Zienkiewicz); the two differ in F only.

    Each step is solved by Newton's method with the factor of the matrix of a step

        A = (1 - a) M / (beta h^2) + (gamma / (beta h)) (D + 2 Omega G) + K_Omega + dF/du (u_k) - K,

    that of the linear step, and secants of it (`Secants`) kept from step to step: the nonlinear response has few shapes. Where
    `PATIENT` iterations do not gain `GAIN`, the factor is taken anew at the present motion, and again until the iterations leave less than
    `LEFT`: secants alone go astray where cords slacken. A trial that is `_ASTRAY` is given up for the nearest one. The contact is solved in
    each iteration. Its own matrix stays that of the linear step, S_0 = W A_0^-1 W^T: with another factor, for forces f' near f it is given the displacement
    w(f) - S_0 f + (S - S_0) (f' - f), with f' of its last solution, and solved again until f' stays. That
    needs steps in which inertia counts: contact and tire are to respond less than twice as much as in S_0.
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
        rolling = turning[1] if turning else AT_REST
        self._force = RestoringForce(operators, inflation, rolling)
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
        self._small = _FLOOR * operators.body.ring.thickness
        self._elastic = np.zeros(len(self._mass))
        self._loads = on_own_rows(operators, loads)
        # What is nonlinear of the motion in which a loop begins.
        self._begun = np.zeros(len(self._mass))
        self._met = np.zeros(self.same_step.shape[1])
        self._linear: PETSc.Mat | None = None
        self._factored: np.ndarray | None = None  # the motion at which the matrix was taken
        self._secants = Secants(self.comm)
        self.turns, self.factors = 0, 1

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray:
        """FullTire.start_steady: the linear tire's motion, which is taken to be in balance, so that what is nonlinear counts
        from there (greens.large_motion.LargeTire.start_steady)."""
        moved = super().start_steady(force, sudden)
        self._elastic = self._loads @ force
        self._begun = self._restoring(self.displacement) - self._elastic
        return moved

    def _restoring(self, motion: np.ndarray) -> np.ndarray:
        """Forces (own rows) N of a motion at rest in the non-rotating frame since the static state."""
        found = self._force.change(motion)
        return found + self._modal.carried(motion) if self._modal else found

    def predict(self) -> np.ndarray:
        """First estimate of the displacement (r,) m at the end of the step without new force."""
        self._tried, self._meetings, self._off = 0, 0, np.inf
        self._nearest: _Trial | None = None
        self._mark, self._waited, self._anew = np.inf, 0, False
        self._secants.begin()
        self._free = self._predicted()
        return self._seen()

    def _predicted(self) -> np.ndarray:
        """Displacement (own rows) at the end of the step without force, if the present factor were exact."""
        here = self.displacement
        return here - self._solved(self._dynamic(here) + self._elastic)

    def settle(
        self, force: np.ndarray, yields: Callable[[np.ndarray], np.ndarray] | None = None
    ) -> np.ndarray | None:
        """None if the motion under a force (k,) N is in equilibrium; then call `advance`.

        Otherwise a better displacement (r,) m without new force, for which to solve the contact
        again. Raises ConvergenceError after MOST_TURNS iterations.
        """
        felt = float(abs(self._beyond(force - self._met)).max(initial=0.0))
        self._met = force.copy()
        new = self._free + self._pushed(force)
        size = self._largest(new)
        enough = TOLERANCE * size + self._small
        if felt > max(_PART * min(self._off, size), enough) and self._meetings < _MOST_MET:
            self._meetings += 1
            return self._seen()
        self._tried, self._meetings = self._tried + 1, 0
        elastic = self._restoring(new) - self._begun
        defect = self._dynamic(new) + elastic - self._loads @ force
        change = self._solved(defect)
        off = self._largest(change)
        self.turns += 1
        if max(off, felt) <= enough:
            self._elastic, self._new = elastic, new
            return None
        if self._tried > MOST_TURNS or not np.isfinite(off):
            raise self._stuck(off, size)
        trial = _Trial(off, new, defect, force.copy())
        if self._nearest is None or off < self._nearest.off:
            self._nearest = trial
        if self._goes_on(off):
            self._free, self._off = self._secants.next(self._free, -change), off
        else:
            self._anew_at(trial if off <= _ASTRAY * self._nearest.off else self._nearest, size)
        return self._seen()

    def _goes_on(self, off: float) -> bool:
        """Whether iterations with the present factor gain enough."""
        if self._anew:
            return off <= LEFT * self._off
        self._waited += 1
        if off <= GAIN * self._mark:
            self._mark, self._waited = off, 0
        return self._waited < PATIENT

    def _anew_at(self, trial: _Trial, size: float) -> None:
        """Go on from a trial with the matrix there."""
        try:
            self._factor_at(trial.motion)
        except NearlySingular:
            raise self._stuck(trial.off, size) from None
        self._secants, self._anew = Secants(self.comm), True
        change = self._solved(trial.defect)
        self._free = trial.motion - change - self._pushed(trial.force)
        self._off = self._largest(change)

    def advance(self, force: np.ndarray) -> None:
        """The motion under the force (k,) N for which `settle` returned None is that of the end of the step."""
        self._move_to(self._new)

    def _pushed(self, force: np.ndarray) -> np.ndarray:
        """Displacement (own rows) under a force (k,) N, by the present factor."""
        return self._solved(self._loads @ force) if force.any() else np.zeros(len(self._mass))

    def _beyond(self, force: np.ndarray) -> np.ndarray:
        """(S - S_0) f, (r,) m."""
        if self._factored is None or not force.any():
            return np.zeros(len(self.same_step))
        return summed(self.comm, self._outputs @ self._pushed(force)) - self.same_step @ force

    def _largest(self, values: np.ndarray) -> float:
        """Largest magnitude among the rows of all processes."""
        return self.comm.allreduce(float(abs(values).max(initial=0.0)), op=MPI.MAX)

    def _stuck(self, off: float, size: float) -> ConvergenceError:
        return ConvergenceError(
            f"full finite elements: a step of {self._step:g} s leaves {off:.1e} m of "
            f"{size:.1e} m out of balance after {self._tried} iterations; the motion is too large for "
            "the step or the tire buckles: take a smaller step or a smaller motion."
        )

    def _factor_at(self, motion: np.ndarray) -> None:
        """Factorise the matrix of a step at a motion (own rows)."""
        tangent, different = self._force.tangent, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN
        if self._linear is None:
            rest = np.zeros_like(motion)
            at_rest, self._linear = tangent(rest, rest), self._system.copy()
            self._linear.axpy(-1.0, at_rest, different)
            at_rest.destroy()
        now, known = tangent(motion, motion), symmetric(self._system)
        now.axpy(1.0, self._linear, different)
        now.setOption(PETSc.Mat.Option.SYMMETRIC, known)
        self._solver.destroy()
        self._system.destroy()
        self._factorise(now)
        self._factored = motion.copy()
        self.factors += 1

    def _seen(self) -> np.ndarray:
        """Displacement (r,) m without new force for which the contact is solved with S_0."""
        return summed(self.comm, self._outputs @ self._free) + self._beyond(self._met)

    def _dynamic(self, new: np.ndarray) -> np.ndarray:
        """Inertia and damping forces, N, if the step ends at displacement `new` (own rows)."""
        h, a, beta, gamma = self._step, self._a, self._beta, self._gamma
        moved = new - self.displacement - h * self.velocity
        acceleration = moved / (beta * h**2) - (0.5 / beta - 1) * self.acceleration
        rate = self.velocity + h * ((1 - gamma) * self.acceleration + gamma * acceleration)
        balanced = (1 - a) * acceleration + a * self.acceleration
        return self._mass * balanced + self._product(rate)

    def snapshot(self) -> dict[str, np.ndarray]:
        """FullTire.snapshot, with the motion of the factor if it was taken anew, and the last forces."""
        spread, everywhere = self._operators.spread, self._operators.body.everywhere
        kept = super().snapshot() | {"pushed": self._met, "begun": everywhere(spread(self._begun))}
        if (secants := self._secants.state()).size:
            kept["secants"] = np.stack([everywhere(spread(one)) for one in secants.T])
        if self._factored is not None:
            kept["factored"] = everywhere(spread(self._factored))
        return kept

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, before `predict`; written by any number of processes."""
        super().restore(state)
        self._met = state["pushed"]
        self._begun = self._operators.restrict(state["begun"][self._operators.body.ids])
        self._elastic = self._restoring(self.displacement) - self._begun
        self._secants = Secants(self.comm)
        if "secants" in state:
            ids = self._operators.body.ids
            own = [self._operators.restrict(one[ids]) for one in state["secants"]]
            self._secants.set_state(np.stack(own, axis=1))
        if "factored" in state:
            self._factor_at(self._operators.restrict(state["factored"][self._operators.body.ids]))

    def energy(self) -> float:
        """Kinetic energy and energy stored since the static state, J; standing wheel only."""
        kinetic = self.comm.allreduce(self._mass @ self.velocity**2) / 2
        return kinetic + self._force.energy(self.displacement)
