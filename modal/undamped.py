"""The first eigenproblem: K Phi = M Phi Lambda, Phi^T M Phi = I, with none of the lowest missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from slepc4py import SLEPc

from fem.errors import ConvergenceError

RESIDUAL_TOLERANCE = 1e-8  # relative, per eigenpair
ORTHONORMALITY_TOLERANCE = 1e-9
_EXTRA = 6  # pairs beyond the wanted ones, to find a gap in which to count


@dataclass(frozen=True)
class Modes:
    """The lowest m modes. `squares` omega^2 (m,) 1/s2 ascending; `vectors` this process's rows (n, m)
    of the mass-normalised shapes, kg^-1/2; `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||;
    `inertia_count` eigenvalues below `counted_below` (1/s2) by Sylvester's law, equal to the number found.
    """

    squares: np.ndarray
    vectors: np.ndarray
    residual: np.ndarray
    orthonormality: float
    inertia_count: int
    counted_below: float
    iterations: int

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (m,), Hz."""
        return np.sqrt(self.squares) / (2 * np.pi)


def solve(stiffness: PETSc.Mat, mass: np.ndarray, count: int) -> Modes:
    """The `count` lowest modes of a stiffness (n, n) in N/m and a diagonal mass (own rows) in kg.

    The diagonal mass turns the pencil into the standard problem M^-1/2 K M^-1/2: no mass product
    in the Krylov space. Shift-and-invert at zero; then one factorisation above the last mode counts
    them all. Raises ConvergenceError when a mode is missing, not converged, or unstable. Collective.
    """
    comm = stiffness.comm.tompi4py()
    size = stiffness.getSize()[0]
    count = min(count, size)
    scaled = _scaled(stiffness, mass)
    eps = _krylov(scaled, min(count + _EXTRA, size))
    found = eps.getConverged()
    if found < count:
        raise ConvergenceError(
            f"modes: {found} of {count} modes converged in {eps.getIterationNumber()} restarts. "
            "Ask for fewer modes, or give PETSc options such as -modal_eps_max_it 500."
        )
    values, vectors = _pairs(eps, found, len(mass))
    _polish(eps, scaled, values, vectors)
    iterations = eps.getIterationNumber()
    eps.destroy()
    _check_stable(values)
    below, wanted = _gap_above(values[: count + _EXTRA], count)
    inertia = _count_below(scaled, below)
    if inertia != wanted:
        raise ConvergenceError(
            f"modes: {wanted} modes found below {np.sqrt(below) / (2 * np.pi):.3f} Hz, but the inertia "
            f"of K - sigma M counts {inertia}: {inertia - wanted} are missing. "
            "Give -modal_eps_ncv a larger value."
        )
    residual = _residuals(scaled, values[:count], vectors[:, :count])
    scaled.destroy()
    worst = float(residual.max())
    if worst > RESIDUAL_TOLERANCE:
        raise ConvergenceError(
            f"modes: worst relative residual {worst:.1e}, allowed {RESIDUAL_TOLERANCE:.0e}. "
            "Give -modal_eps_tol a smaller value."
        )
    shapes = vectors[:, :count] / np.sqrt(mass)[:, None]
    defect = _orthonormality(comm, vectors[:, :count])
    return Modes(values[:count], shapes, residual, defect, inertia, below, iterations)


def _scaled(stiffness: PETSc.Mat, mass: np.ndarray) -> PETSc.Mat:
    scaled = stiffness.copy()
    roots = scaled.createVecLeft()
    roots.array[:] = 1 / np.sqrt(mass)
    scaled.diagonalScale(roots, roots)
    scaled.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    roots.destroy()
    return scaled


def _krylov(scaled: PETSc.Mat, wanted: int) -> SLEPc.EPS:
    eps = SLEPc.EPS().create(scaled.comm)
    eps.setOptionsPrefix("modal_")
    eps.setOperators(scaled)
    eps.setProblemType(SLEPc.EPS.ProblemType.HEP)
    eps.setDimensions(wanted)
    eps.setTolerances(1e-11, 200)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(0.0)
    transform = eps.getST()
    transform.setType(SLEPc.ST.Type.SINVERT)
    _direct(transform.getKSP())
    eps.setFromOptions()
    eps.solve()
    return eps


def _direct(ksp: PETSc.KSP) -> None:
    """A MUMPS L D L^T factorisation and nothing else."""
    ksp.setType(PETSc.KSP.Type.PREONLY)
    pc = ksp.getPC()
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType("mumps")


def _pairs(eps: SLEPc.EPS, found: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues ascending, and this process's rows of their vectors."""
    vector, _ = eps.getOperators()[0].createVecs()
    values = np.empty(found)
    vectors = np.empty((rows, found), order="F")
    for k in range(found):
        values[k] = eps.getEigenpair(k, vector).real
        vectors[:, k] = vector.array_r
    vector.destroy()
    order = np.argsort(values, kind="stable")
    return values[order], vectors[:, order]


def _polish(eps: SLEPc.EPS, scaled: PETSc.Mat, values: np.ndarray, vectors: np.ndarray) -> None:
    """One step of inverse iteration where the residual is not yet small, in place. Collective.

    A Krylov basis carries noise in the stiffest directions, which K multiplies by up to 1e7 times
    the lowest eigenvalue: the lowest modes are good in the inverse norm and not in the residual's.
    """
    transform = eps.getST()
    before, after = scaled.createVecs()
    for k in np.flatnonzero(_residuals(scaled, values, vectors) > RESIDUAL_TOLERANCE / 10):
        before.array[:] = vectors[:, k]
        transform.apply(before, after)
        after.normalize()
        vectors[:, k] = after.array_r
    before.destroy()
    after.destroy()


def _check_stable(values: np.ndarray) -> None:
    if values[0] <= 0:
        growth = np.sqrt(-values[0]) / (2 * np.pi)
        raise ConvergenceError(
            f"modes: the tangent stiffness has {int((values <= 0).sum())} negative eigenvalue(s) "
            f"(growth rate {growth:.3g} Hz): the state is unstable once the road is replaced by its "
            "forces, the tire buckles. Lower the load, raise the inflation or stiffen the wall."
        )


def _gap_above(values: np.ndarray, count: int) -> tuple[float, int]:
    """A value in the widest relative gap at or above the wanted modes, and how many lie below it."""
    if len(values) == count:
        return values[-1] * (1 + 1e-6), count
    gaps = np.diff(values[count - 1 :]) / values[count - 1 : -1]
    k = count + int(np.argmax(gaps))
    return (values[k - 1] + values[k]) / 2, k


def _count_below(scaled: PETSc.Mat, shift: float) -> int:
    """Eigenvalues below the shift: negative pivots of the factorised shifted matrix. Collective."""
    shifted = scaled.copy()
    shifted.shift(-shift)
    shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    pc = PETSc.PC().create(scaled.comm)
    pc.setOperators(shifted)
    pc.setType(PETSc.PC.Type.CHOLESKY)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    # Null pivots found, and the root front on one process: only then are MUMPS's pivots all counted.
    pc.getFactorMatrix().setMumpsIcntl(24, 1)
    pc.getFactorMatrix().setMumpsIcntl(13, 1)
    pc.setUp()
    negative = pc.getFactorMatrix().getInertia()[0]
    pc.destroy()
    shifted.destroy()
    return negative


def _residuals(scaled: PETSc.Mat, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    defect = multiply(scaled, vectors) - vectors * values
    squares = scaled.comm.tompi4py().allreduce((defect**2).sum(axis=0))
    return np.sqrt(squares) / values


def _orthonormality(comm: MPI.Comm, vectors: np.ndarray) -> float:
    defect = float(np.abs(gram(comm, vectors, vectors) - np.eye(vectors.shape[1])).max())
    if defect > ORTHONORMALITY_TOLERANCE:
        raise ConvergenceError(
            f"modes: orthonormality is lost ({defect:.1e}, allowed {ORTHONORMALITY_TOLERANCE:.0e}). "
            "Give -modal_eps_tol a smaller value."
        )
    return defect


def multiply(matrix: PETSc.Mat, vectors: np.ndarray) -> np.ndarray:
    """This process's rows of matrix @ vectors, vectors given by rows (n, m). Collective."""
    rows, columns = vectors.shape
    sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, columns))
    dense = PETSc.Mat().createDense(sizes, array=np.asfortranarray(vectors), comm=matrix.comm)
    product = matrix.matMult(dense)
    out = product.getDenseArray().copy()
    product.destroy()
    dense.destroy()
    return out


def gram(comm: MPI.Comm, left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left^T right over all processes, rows distributed alike. Collective."""
    return comm.allreduce(left.T @ right)
