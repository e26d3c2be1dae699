"""Exact static flexibility in the rotating frame: one factorisation, all loads as right-hand sides."""

from __future__ import annotations

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


def compliance(
    operators: Operators, stiffness: PETSc.Mat, outputs: sparse.csr_matrix, loads: sparse.csr_matrix
) -> np.ndarray:
    """Displacement at the outputs per unit load, (r, k) m/N, on every process. Collective.

    `outputs` (r, 3 s) and `loads` (k, 3 s) weigh the nodes of the outer face, three dofs a node.
    Raises ConvergenceError when a solve leaves a relative residual above 1e-8.
    """
    rows = on_own_rows(operators, outputs).T.tocsr()
    pc = factorise(stiffness)
    solution = solve_columns(pc, stiffness, on_own_rows(operators, loads).toarray())
    pc.destroy()
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


def factorise(stiffness: PETSc.Mat) -> PETSc.PC:
    """A direct factorisation by MUMPS: L D L^T where the matrix is marked symmetric. Collective."""
    known, symmetric = stiffness.isSymmetricKnown()
    pc = PETSc.PC().create(stiffness.comm)
    pc.setOperators(stiffness)
    pc.setType(PETSc.PC.Type.CHOLESKY if known and symmetric else PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setUp()
    return pc


def _solve(factor: PETSc.Mat, stiffness: PETSc.Mat, loads: np.ndarray) -> np.ndarray:
    """Own rows of stiffness^-1 loads, checked. Collective."""
    loads = np.asfortranarray(loads)
    rows, columns = loads.shape
    comm = stiffness.comm
    sizes = ((rows, PETSc.DETERMINE), (PETSc.DECIDE, columns))
    right = PETSc.Mat().createDense(sizes, array=loads, comm=comm)
    solution = right.duplicate()
    factor.matSolve(right, solution)
    product = stiffness.matMult(solution)
    defect = product.getDenseArray() - loads
    worst, scale = comm.tompi4py().allreduce(np.array([(defect**2).sum(), (loads**2).sum()]))
    if not worst <= (RESIDUAL_TOLERANCE**2) * max(scale, np.finfo(float).tiny):
        raise ConvergenceError(
            f"greens: static flexibility has a relative residual of {np.sqrt(worst / scale):.1e}: the "
            "stiffness of the rotating tire is singular or nearly so (critical speed). Lower the speed."
        )
    out = solution.getDenseArray().copy()
    for matrix in (right, solution, product):
        matrix.destroy()
    return out
