"""Direct solves by MUMPS: one factorisation, blocks of right-hand sides, every block checked."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import NearlySingular

_CHUNK = 64  # right-hand sides per solve: enough for BLAS 3 in MUMPS, little memory
RESIDUAL_TOLERANCE = 1e-8
_SUMS = 4  # random sums that check a block; checking every column took as long as the solves


def solve_all(matrix: PETSc.Mat, loads: sparse.spmatrix) -> np.ndarray:
    """Own rows (n, p) of matrix^-1 loads by one factorisation. Collective."""
    pc = factorise(matrix)
    solution = solve_columns(pc, matrix, loads)
    pc.destroy()
    return solution


def solve_columns(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> np.ndarray:
    """Own rows (n, k) of matrix^-1 columns by the given factorisation; checked. Collective."""
    out = np.empty(columns.shape)
    for part, solved in solve_parts(pc, matrix, columns):
        out[:, part] = solved
    return out


def solve_parts(
    pc: PETSc.PC, matrix: PETSc.Mat, columns: np.ndarray | sparse.spmatrix
) -> Iterator[tuple[slice, np.ndarray]]:
    """As `solve_columns`, in blocks, each with its slice, to save memory. Collective."""
    factor = pc.getFactorMatrix()
    if not isinstance(columns, np.ndarray):
        columns = columns.tocsc()
    for start in range(0, columns.shape[1], _CHUNK):
        part = slice(start, min(start + _CHUNK, columns.shape[1]))
        loads = columns[:, part]
        dense = loads if isinstance(loads, np.ndarray) else loads.toarray()
        yield part, _solve(factor, matrix, dense)
    factor.destroy()  # release this reference, which petsc4py would keep forever


def symmetric(matrix: PETSc.Mat) -> bool:
    """Whether the matrix is marked symmetric."""
    known, symmetric = matrix.isSymmetricKnown()
    return bool(known and symmetric)


def factorise(stiffness: PETSc.Mat) -> PETSc.PC:
    """Factorisation by MUMPS: L D L^T if the matrix is marked symmetric, else L U. Collective."""
    pc = PETSc.PC().create(stiffness.comm)
    pc.setOperators(stiffness)
    pc.setType(PETSc.PC.Type.CHOLESKY if symmetric(stiffness) else PETSc.PC.Type.LU)
    pc.setFactorSolverType("mumps")
    pc.setFactorSetUpSolverType()
    factor = pc.getFactorMatrix()
    factor.setMumpsIcntl(14, 100)  # workspace for pivoting beyond MUMPS's estimate
    factor.destroy()
    pc.setUp()
    return pc


def _solve(factor: PETSc.Mat, stiffness: PETSc.Mat, loads: np.ndarray) -> np.ndarray:
    """Own rows of stiffness^-1 loads. Collective.

    Raises NearlySingular for a relative residual above RESIDUAL_TOLERANCE."""
    right = _dense(loads, stiffness.comm)
    solution = right.duplicate()
    factor.matSolve(right, solution)
    out = solution.getDenseArray().copy()
    right.destroy()
    solution.destroy()
    # Sums of the solutions with random signs: the expected square of their residual is that of all
    # columns together.
    signs = np.random.default_rng(0).choice((-1.0, 1.0), (loads.shape[1], _SUMS))
    given = loads @ signs
    comm, defect = stiffness.comm.tompi4py(), multiply(stiffness, out @ signs) - given
    worst, scale = comm.allreduce(np.array([(defect**2).sum(), (given**2).sum()]))
    if not worst <= (RESIDUAL_TOLERANCE**2) * max(scale, np.finfo(float).tiny):
        raise NearlySingular(
            f"greens: a static or harmonic solution has a relative residual of {np.sqrt(worst / scale):.1e}: the "
            "matrix is singular or nearly so. Use elements of more equal size, and loads under which "
            "the tire is stable."
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
