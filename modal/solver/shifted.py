"""A shifted symmetric matrix, factorised by a team of processes: its inertia and inverse."""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.local_rows import from_local_rows
from tireroad.modal.solver.team import ALONE, Team


class Shifted:
    """A - sigma I = L D L^T by MUMPS, for a symmetric sparse A (n, n).

    Each process of the `team` has its own rows of A. `negative` is the number of eigenvalues of A
    below sigma (Sylvester's law of inertia). `singular` says that sigma is an eigenvalue to
    rounding, so that the inverse must not be used. Raises ConvergenceError if the factorisation
    fails. Collective in the team.
    """

    def __init__(self, matrix: sparse.csr_matrix, shift: float, team: Team = ALONE) -> None:
        self.rows, self.size = matrix.shape
        self.shift, self.team = shift, team
        sizes = ((self.rows, self.size), (self.rows, self.size))
        shifted = from_local_rows(matrix, sizes, team.comm)
        shifted.shift(-shift)
        shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._pc = PETSc.PC().create(team.comm)
        self._pc.setOperators(shifted)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType("mumps")
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        # Without null pivot detection MUMPS counts a zero pivot by the sign of its rounding.
        self._factor.setMumpsIcntl(24, 1)
        if not team.alone:  # last block on one process: MUMPS counts its inertia only there
            self._factor.setMumpsIcntl(13, 1)
        self._pc.setUp()
        self.negative, null, positive = self._factor.getInertia()
        self.singular = null > 0
        if self.negative + null + positive != self.size:
            raise ConvergenceError(
                f"modes: the factorisation at {shift:.6g} 1/s2 failed (its inertia counts "
                f"{self.negative + null + positive} of {self.size} pivots): out of memory, or a "
                "matrix with entries that are not numbers."
            )
        shifted.destroy()

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(A - sigma I)^-1 right, own rows (rows, p).

        A block of many columns costs a fifth of solving one by one.
        """
        sizes, comm = ((self.rows, self.size), (PETSc.DECIDE, right.shape[1])), self.team.comm
        block = PETSc.Mat().createDense(sizes, array=np.asfortranarray(right), comm=comm)
        empty = np.empty(right.shape, order="F")
        answer = PETSc.Mat().createDense(sizes, array=empty, comm=comm)
        self._factor.setMumpsIcntl(27, right.shape[1])
        self._factor.matSolve(block, answer)
        out = answer.getDenseArray().copy()
        block.destroy()
        answer.destroy()
        return out

    def destroy(self) -> None:
        """Free the factor, the eigensolver's largest memory, which petsc4py does not."""
        self._factor.destroy()
        self._pc.destroy()
