"""The second eigenproblem on the full finite-element matrices, without a modal basis.

    (s^2 M + s D + K_Omega) u = 0,   w^T (s^2 M + s D + K_Omega) = 0,   a = w^T (2 s M + D) u

D = gamma1 M + gamma2 K + 2 Omega G, K_Omega as in fem.matrices.compliance. SLEPc's PEP (two-level
orthogonal Arnoldi, shift-and-invert at zero) finds the states nearest to zero; it has no two-sided
solver, so left vectors are the matched, biorthogonalised right ones of the transposed problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import optimize
from slepc4py import SLEPc

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.solver.fields import gram, multiply

Array = np.ndarray
RESIDUAL_TOLERANCE, ITERATIONS = 1e-8, 200  # accepted; restarts
TOLERANCE, FINER = 1e-11, 1e-13  # of the solver; of its second attempt
_EXTRA = 10  # states beyond the wanted ones, to end in a gap and not inside a cluster
_SAME = 1e-6  # relative distance of the right and left eigenvalue of one state
# Two equal states have 7e5 to 1.3e6 by rounding, depending on the number of processes.
DEFECTIVE = 1e5


@dataclass(frozen=True)
class FullModes:
    """States by |s|, Im s >= 0: `eigenvalue` (q,) 1/s; `right`, `left`: own rows (n, q) of u,
    kg^-1/2, and of w / a; residuals relative to the norms of the terms; `condition` of the
    biorthogonalisation of vectors of unit momentum.
    """

    eigenvalue: Array
    right: Array
    left: Array
    residual: Array
    left_residual: Array
    condition: float

    def among(self, which: Array) -> FullModes:
        """The states at `which` (q,), a mask."""
        return FullModes(
            self.eigenvalue[which],
            self.right[:, which],
            self.left[:, which],
            self.residual[which],
            self.left_residual[which],
            self.condition,
        )


def window(
    mass: Array,
    drag: PETSc.Mat,
    stiffness: PETSc.Mat,
    span: tuple[float, float],
    rate: float,
    expected: int,
) -> FullModes:
    """All states with Im s in `span`, 1/s: oscillating ones and, if it begins at 0, real ones.

    In real arithmetic the shift stays at zero, so all below are found too: `expected` pairs, then
    more until one lies beyond |s|^2 = Im^2 + (rate / 2)^2, `rate` 1/s the fastest damping in the
    window. Raises ConvergenceError. Collective.
    """
    low, high = span
    limit = 1.01 * np.hypot(high, rate / 2)
    most = stiffness.getSize()[0]
    count = min(max(expected, 1) + _EXTRA, most)
    while True:
        solution = solve(mass, drag, stiffness, count)
        if np.abs(solution.eigenvalue).max() > limit or count == most:
            break
        count = min(2 * count, most)
    inside = (solution.eigenvalue.imag >= low) & (solution.eigenvalue.imag <= high)
    if not inside.any():
        raise ConvergenceError(
            f"rotating: no state from {low / (2 * np.pi):.4g} to {high / (2 * np.pi):.4g} Hz. Widen "
            "rotation.window."
        )
    return solution.among(inside)


def solve(mass: Array, drag: PETSc.Mat, stiffness: PETSc.Mat, count: int) -> FullModes:
    """The `count` pairs nearest to zero, or about as many real states more, for a diagonal mass
    (own rows) kg, D (n, n) kg/s and K (n, n) N/m. Raises ConvergenceError. Collective.
    """
    comm = stiffness.comm.tompi4py()
    s, u, residual = _states(mass, drag, stiffness, 2 * count)
    turned = drag.transpose(PETSc.Mat()), stiffness.transpose(PETSc.Mat())
    t, w, left_residual = _states(mass, *turned, 2 * count)
    for matrix in turned:
        matrix.destroy()
    rows, columns = optimize.linear_sum_assignment(np.abs(s[:, None] - t))
    same = np.abs(s[rows] - t[columns]) <= _SAME * np.abs(s[rows])
    if not same.all():
        raise ConvergenceError(
            f"rotating: {int((~same).sum())} of {len(s)} states have no left vector with the same "
            "eigenvalue: the states cut through a cluster. Change rotation.count a little."
        )
    w, left_residual = w[:, columns], left_residual[columns]
    turn = _pairing(comm, mass, drag, s, u, w)
    condition = _condition(comm, mass, s, u, w, turn)
    left = np.linalg.solve(turn, w.T).T
    upper = s.imag >= 0
    u, left = u[:, upper], left[:, upper]
    return FullModes(s[upper], u, left, residual[upper], left_residual[upper], condition)


def _condition(comm: MPI.Comm, mass: Array, s: Array, u: Array, w: Array, turn: Array) -> float:
    """Condition of the pairing of vectors of unit momentum, about that of the worst eigenvalue.
    ConvergenceError for nearly defective states, whose own vectors are unusable. Collective.
    """
    columns, rows = (
        np.sqrt(np.abs(s)) * comm.allreduce((mass[:, None] * np.abs(v) ** 2).sum(axis=0)) ** 0.5
        for v in (u, w)
    )
    scaled = turn / (rows[:, None] * columns)
    condition = float(np.linalg.cond(scaled))
    if not condition <= DEFECTIVE:
        worst = s[int(np.abs(np.linalg.svd(scaled)[2][-1]).argmax())]
        raise ConvergenceError(
            f"rotating: states next to defective (condition {condition:.1e}, near {worst:.4g} 1/s): two of them "
            'share one vector, as at critical damping. rotation.method = "projected" keeps such states '
            "together; or change the damping or the speed a little."
        )
    return condition


def _pairing(comm: MPI.Comm, mass: Array, drag: PETSc.Mat, s: Array, u: Array, w: Array) -> Array:
    """w_i^T [(s_i + s_j) M + D] u_j, diagonal but for clusters, to biorthogonalise w."""
    moved = _times(drag, u)
    near = gram(comm, w, mass[:, None] * u)
    return s[:, None] * near + near * s + gram(comm, w, moved)


def _states(
    mass: Array, drag: PETSc.Mat, stiffness: PETSc.Mat, count: int, tolerance: float = TOLERANCE
) -> tuple[Array, Array, Array]:
    """(s, vectors, residuals) of about `count` states nearest to zero, conjugates included."""
    weight = stiffness.createVecLeft()
    weight.array[:] = mass
    inertia = PETSc.Mat().createAIJ(stiffness.getSizes(), nnz=1, comm=stiffness.comm)
    inertia.setDiagonal(weight)
    inertia.assemble()
    pep = SLEPc.PEP().create(stiffness.comm)
    pep.setOptionsPrefix("rotating_")
    pep.setOperators([stiffness, drag, inertia])
    pep.setDimensions(min(count + _EXTRA, 2 * stiffness.getSize()[0]))
    pep.setTolerances(tolerance, ITERATIONS)
    pep.setWhichEigenpairs(SLEPc.PEP.Which.TARGET_MAGNITUDE)
    pep.setTarget(0.0)
    transform = pep.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    ksp = transform.getKSP()
    pc = ksp.getPC()
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc.setType(PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pep.setFromOptions()
    pep.solve()
    converged = pep.getConverged()
    if converged < count:
        raise ConvergenceError(
            f"rotating: {converged} of {count} states converged in {pep.getIterationNumber()} restarts. "
            "Lower rotation.count, or give PETSc options such as -rotating_pep_max_it 1000."
        )
    s, vectors = _read(pep, stiffness, converged)
    order = _up_to_a_gap(s, count)
    s, vectors = s[order], vectors[:, order]
    factor = pc.getFactorMatrix()
    vectors = _polished(factor, mass, drag, s, vectors)
    for thing in (factor, pep, inertia, weight):
        thing.destroy()
    residual = _residuals(mass, drag, stiffness, s, vectors)
    if not residual.max() <= RESIDUAL_TOLERANCE:
        if tolerance > FINER:
            return _states(mass, drag, stiffness, count, FINER)
        raise ConvergenceError(
            f"rotating: worst relative residual {residual.max():.1e}, allowed "
            f"{RESIDUAL_TOLERANCE:.0e}. Give -rotating_pep_tol a value below {FINER:g}."
        )
    return s, vectors, residual


def _read(pep: SLEPc.PEP, matrix: PETSc.Mat, count: int) -> tuple[Array, Array]:
    real, imaginary = matrix.createVecs()
    s = np.empty(count, complex)
    vectors = np.empty((real.getLocalSize(), count), complex)
    for k in range(count):
        s[k] = pep.getEigenpair(k, real, imaginary)
        vectors[:, k] = real.array_r + 1j * imaginary.array_r
    real.destroy()
    imaginary.destroy()
    return s, vectors


def _polished(factor: PETSc.Mat, mass: Array, drag: PETSc.Mat, s: Array, vectors: Array) -> Array:
    """u = -K^-1 (s^2 M + s D) u with the factorised K: removes errors of the Krylov basis in the
    stiffest directions, which are small in u but large in K u. Collective.
    """
    right = mass[:, None] * vectors * s**2 + _times(drag, vectors) * s
    rows, columns = right.shape
    sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, 2 * columns))
    stacked = np.asfortranarray(np.hstack([right.real, right.imag]))
    block = PETSc.Mat().createDense(sizes, array=stacked, comm=factor.comm)
    answer = block.duplicate()
    factor.matSolve(block, answer)
    real, imaginary = np.split(answer.getDenseArray(), 2, axis=1)
    better = real + 1j * imaginary
    block.destroy()
    answer.destroy()
    size = factor.comm.tompi4py().allreduce((np.abs(better) ** 2).sum(axis=0))
    return better / np.sqrt(size)


def _times(matrix: PETSc.Mat, vectors: Array) -> Array:
    return multiply(matrix, vectors.real) + 1j * multiply(matrix, vectors.imag)


def _up_to_a_gap(s: Array, count: int) -> Array:
    """Indices by |s| up to the widest gap after the wanted ones: conjugates stay together."""
    order = np.argsort(np.abs(s), kind="stable")
    size = np.abs(s[order])
    end = len(size)
    if end > count:
        gaps = np.diff(size[count - 1 :]) / size[count - 1 : -1]
        end = count + int(np.argmax(gaps))
    return order[:end]


def _residuals(
    mass: Array, drag: PETSc.Mat, stiffness: PETSc.Mat, s: Array, vectors: Array
) -> Array:
    """||(s^2 M + s D + K) u|| over the sum of its terms' norms, column by column. Collective."""
    comm = stiffness.comm.tompi4py()
    terms = [mass[:, None] * vectors * s**2, _times(drag, vectors) * s, _times(stiffness, vectors)]

    def norm(field: Array) -> Array:
        return np.sqrt(comm.allreduce((np.abs(field) ** 2).sum(axis=0)))

    return norm(sum(terms)) / sum(norm(term) for term in terms)
