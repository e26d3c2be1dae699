"""Receptance of the full matrices, frequency by frequency: the reference for all modal ones.

(K_Omega - w^2 M + i w E) u = b with u = a + i c in real arithmetic:

    [[A, -w E], [w E, A]] [a; c] = [b; 0],   A = K_Omega - w^2 M
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.cavity.column import Column
from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import add_diagonal, on_own_rows
from tireroad.fem.matrices.direct import solve_all
from tireroad.fem.matrices.operators import Operators


def receptance(
    operators: Operators,
    stiffness: PETSc.Mat,
    damping: PETSc.Mat,
    outputs: sparse.csr_matrix,
    loads: sparse.csr_matrix,
    frequency: np.ndarray,
    beside: np.ndarray | None = None,
    air: Column | None = None,
) -> np.ndarray:
    """H (f, r, k) complex, m/N, at the frequencies in Hz, on every process. Collective.

    `stiffness` K_Omega and `damping` E as in fem.matrices.compliance; `beside`: rows (m, n) on own
    unknowns, m further readings, e.g. operators.carried for the tire's first moment int rho u, kg
    m/N; `air`: coupling to the cavity. Each frequency takes one unsymmetric factorisation of twice
    the unknowns. Raises ConvergenceError if a solve leaves a residual above 1e-8.
    """
    comm = operators.body.comm
    rows = on_own_rows(operators, outputs).T.tocsr()
    if beside is not None:
        rows = sparse.vstack([rows, sparse.csr_matrix(beside)], format="csr")
    columns = on_own_rows(operators, loads)
    shape = rows.shape[0], columns.shape[1]
    if air is not None:
        rows = sparse.vstack([rows, air.pushed.T], format="csr")
        columns = sparse.hstack([columns, air.pushed], format="csc")
    n = columns.shape[0]
    both = sparse.vstack([columns, sparse.csc_matrix(columns.shape)], format="csc")
    H = np.empty((len(frequency), *shape), complex)
    for k, omega in enumerate(2 * np.pi * frequency):
        dynamic = _dynamic_stiffness(stiffness, damping, operators.mass, omega)
        solution = solve_all(dynamic, both)
        dynamic.destroy()
        answers = summed(comm, rows @ (solution[:n] + 1j * solution[n:]))
        H[k] = answers if air is None else air.mended(answers, 1j * omega)
    return H


def _dynamic_stiffness(
    stiffness: PETSc.Mat, damping: PETSc.Mat, mass: np.ndarray, omega: float
) -> PETSc.Mat:
    """The real matrix of twice the size; each process holds its rows of both halves. Collective."""
    diagonal, coupling = stiffness.copy(), damping.copy()
    add_diagonal(diagonal, -(omega**2) * mass)
    coupling.scale(omega)
    opposite = coupling.copy()
    opposite.scale(-1)
    nest = PETSc.Mat().createNest([[diagonal, opposite], [coupling, diagonal]], comm=stiffness.comm)
    out = nest.convert("aij", PETSc.Mat())
    for matrix in (nest, diagonal, coupling, opposite):
        matrix.destroy()
    return out
