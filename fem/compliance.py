"""Exact static flexibility in the rotating frame: one factorisation, all loads as right-hand sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from fem.errors import ConvergenceError
from fem.operators import Operators, Rotation

_CHUNK = 64  # right-hand sides a solve: enough for BLAS 3 in MUMPS, little memory
RESIDUAL_TOLERANCE = 1e-8


def rotating_stiffness(
    operators: Operators,
    rotation: Rotation | None,
    speed: float,
    damping: tuple[float, float],
    inertia: str = "full",
) -> PETSc.Mat:
    """K_Omega = K + Omega^2 S + gamma1 Omega B + gamma2 Omega K M^-1 B; doppler: S_B for S. Collective."""
    stiffness = operators.stiffness.copy()
    if speed == 0:
        return stiffness
    different = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
    convective = rotation.convective if inertia == "full" else rotation.body_convective
    stiffness.axpy(speed**2, convective, different)
    stiffness.axpy(speed * damping[0], rotation.body, different)
    if damping[1]:
        scaled = rotation.body.copy()
        inverse_mass = scaled.createVecLeft()
        inverse_mass.array[:] = 1 / operators.mass
        scaled.diagonalScale(inverse_mass, None)
        product = operators.stiffness.matMult(scaled)
        stiffness.axpy(speed * damping[1], product, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, damping[0] == 0 and damping[1] == 0)
    return stiffness


def rotating_damping(
    operators: Operators,
    rotation: Rotation | None,
    speed: float,
    damping: tuple[float, float],
    inertia: str = "full",
) -> PETSc.Mat:
    """D + 2 Omega G, D = gamma1 M + gamma2 K; doppler: B for G. Collective."""
    matrix = operators.stiffness.copy()
    matrix.scale(damping[1])
    if speed:
        gyroscopic = rotation.gyroscopic if inertia == "full" else rotation.body
        matrix.axpy(2 * speed, gyroscopic, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    add_diagonal(matrix, damping[0] * operators.mass)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, speed == 0)
    return matrix


def add_diagonal(matrix: PETSc.Mat, values: np.ndarray) -> None:
    """Add this process's values to the diagonal. Collective."""
    diagonal = matrix.createVecLeft()
    diagonal.array[:] = values
    matrix.setDiagonal(diagonal, PETSc.InsertMode.ADD)
    diagonal.destroy()


@dataclass(frozen=True)
class StaticShapes:
    """Shapes under constant unit loads and what the full matrices say of them.

    `columns` this process's rows (n, p) of x = K_Omega^-1 b; with y = K_Omega^-T b, all (p, p) and on
    every process: `compliance` b^T x m/N, `damping` y^T (D + 2 Omega G) x m s/N, `inertia` y^T M x
    m s2/N; `momentum` (3, p) int rho x, kg m/N.
    """

    columns: np.ndarray
    compliance: np.ndarray
    damping: np.ndarray
    inertia: np.ndarray
    momentum: np.ndarray


def static_shapes(
    operators: Operators, stiffness: PETSc.Mat, damping: PETSc.Mat, probes: sparse.csr_matrix
) -> StaticShapes:
    """Static shapes of the probes (p, 3 s), each a load and a reading. Collective.

    An unsymmetric stiffness is factorised a second time, transposed.
    """
    comm = operators.body.comm
    loads = on_own_rows(operators, probes)
    x = solve_all(stiffness, loads)
    if _symmetric(stiffness):
        y = x
    else:
        transposed = stiffness.transpose(PETSc.Mat())
        y = solve_all(transposed, loads)
        transposed.destroy()
    weighted = operators.mass[:, None] * x
    return StaticShapes(
        x,
        comm.allreduce(loads.T @ x),
        comm.allreduce(y.T @ _multiply(damping, x)),
        comm.allreduce(y.T @ weighted),
        comm.allreduce(np.stack([weighted[d::3].sum(axis=0) for d in range(3)])),
    )


def solve_all(matrix: PETSc.Mat, loads: sparse.csc_matrix) -> np.ndarray:
    """Own rows of matrix^-1 loads (n, p), by one factorisation. Collective."""
    pc = factorise(matrix)
    solution = solve_columns(pc, matrix, loads.toarray())
    pc.destroy()
    return solution


def compliance(
    operators: Operators, stiffness: PETSc.Mat, outputs: sparse.csr_matrix, loads: sparse.csr_matrix
) -> np.ndarray:
    """Displacement at the outputs per unit load, (r, k) m/N, on every process. Collective.

    `outputs` (r, 3 s) and `loads` (k, 3 s) weigh the nodes of the outer face, three dofs a node.
    Raises ConvergenceError when a solve leaves a relative residual above 1e-8.
    """
    rows = on_own_rows(operators, outputs).T.tocsr()
    solution = solve_all(stiffness, on_own_rows(operators, loads))
    return operators.body.comm.allreduce(rows @ solution)


def solve_columns(pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray) -> np.ndarray:
    """Own rows of matrix^-1 columns, (n, k), by the matrix's factorisation; checked. Collective."""
    factor = pc.getFactorMatrix()
    chunks = range(0, columns.shape[1], _CHUNK)
    return np.hstack([_solve(factor, matrix, columns[:, k : k + _CHUNK]) for k in chunks])


def on_own_rows(operators: Operators, probes: sparse.csr_matrix) -> sparse.csr_matrix:
    """The probes as columns over this process's free dofs, (n, k)."""
    body = operators.body
    face = body.surface
    own = sparse.csr_matrix(
        (np.ones(len(face.local)), (face.local, face.place)), shape=(body.nodes, len(face.ids))
    )
    nodal = sparse.kron(own, sparse.identity(3), format="csr") @ probes.T.tocsr()
    return nodal[operators.free]


def _symmetric(matrix: PETSc.Mat) -> bool:
    known, symmetric = matrix.isSymmetricKnown()
    return bool(known and symmetric)


def factorise(stiffness: PETSc.Mat) -> PETSc.PC:
    """A direct factorisation by MUMPS: L D L^T where the matrix is marked symmetric. Collective."""
    pc = PETSc.PC().create(stiffness.comm)
    pc.setOperators(stiffness)
    pc.setType(PETSc.PC.Type.CHOLESKY if _symmetric(stiffness) else PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    pc.getFactorMatrix().setMumpsIcntl(14, 100)  # room for pivots that MUMPS did not foresee
    pc.setUp()
    return pc


def _solve(factor: PETSc.Mat, stiffness: PETSc.Mat, loads: np.ndarray) -> np.ndarray:
    """Own rows of stiffness^-1 loads, checked. Collective."""
    right = _dense(loads, stiffness.comm)
    solution = right.duplicate()
    factor.matSolve(right, solution)
    out = solution.getDenseArray().copy()
    right.destroy()
    solution.destroy()
    comm, defect = stiffness.comm.tompi4py(), _multiply(stiffness, out) - loads
    worst, scale = comm.allreduce(np.array([(defect**2).sum(), (loads**2).sum()]))
    if not worst <= (RESIDUAL_TOLERANCE**2) * max(scale, np.finfo(float).tiny):
        raise ConvergenceError(
            f"greens: static flexibility has a relative residual of {np.sqrt(worst / scale):.1e}: the "
            "stiffness of the rotating tire is singular or nearly so (critical speed). Lower the speed."
        )
    return out


def _multiply(matrix: PETSc.Mat, columns: np.ndarray) -> np.ndarray:
    """Own rows of matrix @ columns. Collective."""
    given = _dense(columns, matrix.comm)
    product = matrix.matMult(given)
    out = product.getDenseArray().copy()
    product.destroy()
    given.destroy()
    return out


def _dense(columns: np.ndarray, comm: PETSc.Comm) -> PETSc.Mat:
    rows, count = columns.shape
    sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, count))
    return PETSc.Mat().createDense(sizes, array=np.asfortranarray(columns), comm=comm)
