"""Direct solves by MUMPS: one factorisation, many right-hand sides together, each answer checked."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError

_CHUNK = 64  # right-hand sides a solve: enough for BLAS 3 in MUMPS, little memory
RESIDUAL_TOLERANCE = 1e-8
_SUMS = 4  # by which a chunk is checked: all of its products took as long as its solves


def solve_all(matrix: PETSc.Mat, loads: sparse.spmatrix) -> np.ndarray:
    """Own rows of matrix^-1 loads (n, p), by one factorisation. Collective."""
    pc = factorise(matrix)
    solution = solve_columns(pc, matrix, loads)
    pc.destroy()
    return solution


def solve_columns(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> np.ndarray:
    """Own rows of matrix^-1 columns, (n, k), by the matrix's factorisation; checked. Collective."""
    out = np.empty(columns.shape)
    for part, solved in solve_parts(pc, matrix, columns):
        out[:, part] = solved
    return out


def solve_parts(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> Iterator[tuple[slice, np.ndarray]]:
    """The same some columns a time, with where they stand: all of a fine mesh's need not fit in memory. Collective."""
    factor = pc.getFactorMatrix()
    if not isinstance(columns, np.ndarray):
        columns = columns.tocsc()
    for start in range(0, columns.shape[1], _CHUNK):
        part = slice(start, min(start + _CHUNK, columns.shape[1]))
        loads = columns[:, part]
        dense = loads if isinstance(loads, np.ndarray) else loads.toarray()
        yield part, _solve(factor, matrix, dense)
    factor.destroy()  # this hold on it, which petsc4py would keep for ever


def symmetric(matrix: PETSc.Mat) -> bool:
    """Whether the matrix is marked so."""
    known, symmetric = matrix.isSymmetricKnown()
    return bool(known and symmetric)


def factorise(stiffness: PETSc.Mat) -> PETSc.PC:
    """A direct factorisation by MUMPS: L D L^T where the matrix is marked symmetric. Collective."""
    pc = PETSc.PC().create(stiffness.comm)
    pc.setOperators(stiffness)
    pc.setType(PETSc.PC.Type.CHOLESKY if symmetric(stiffness) else PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 100)  # room for pivots that MUMPS did not foresee
    factor.destroy()
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
    # Sums of the answers with random signs: squared, their defect is on average that of all answers together.
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (loads.shape[1], _SUMS))
    given = loads @ signs
    comm, defect = stiffness.comm.tompi4py(), multiply(stiffness, out @ signs) - given
    worst, scale = comm.allreduce(np.array([(defect**2).sum(), (given**2).sum()]))
    if not worst <= (RESIDUAL_TOLERANCE**2) * max(scale, np.finfo(float).tiny):
        raise ConvergenceError(
            f"greens: static flexibility has a relative residual of {np.sqrt(worst / scale):.1e}: the "
            "stiffness of the rotating tire is singular or nearly so (critical speed). Lower the speed."
        )
    return out


def multiply(matrix: PETSc.Mat, columns: np.ndarray) -> np.ndarray:
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
