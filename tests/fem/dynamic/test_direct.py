"""Direct solves: answers, and that a wrong one is noticed."""

import numpy as np
import pytest
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import factorise, solve_all, solve_columns, solve_parts


def chain(stiffness: float) -> tuple[PETSc.Mat, sparse.csr_matrix]:
    """A chain of 40 springs, the last of them as stiff as told."""
    diagonal = np.full(40, 2.0)
    diagonal[-1] = 1.0 + stiffness
    whole = sparse.diags([-np.ones(39), diagonal, -np.ones(39)], [-1, 0, 1], format="csr")
    matrix = PETSc.Mat().createAIJ(
        whole.shape, csr=(whole.indptr, whole.indices, whole.data), comm=PETSc.COMM_SELF
    )
    return matrix, whole


def test_many_right_hand_sides() -> None:
    """150 loads, three chunks, against a dense solution."""
    matrix, whole = chain(1.0)
    loads = np.random.default_rng(1).normal(size=(40, 150))
    exact = np.linalg.solve(whole.toarray(), loads)
    whole = solve_all(matrix, sparse.csc_matrix(loads))
    assert np.allclose(whole, exact, rtol=1e-10, atol=1e-12)
    parts = list(solve_parts(factorise(matrix), matrix, loads))
    assert [part.stop - part.start for part, _ in parts] == [64, 64, 22]
    assert np.array_equal(np.hstack([solved for _, solved in parts]), whole)


def test_one_wrong_answer_of_many_is_noticed() -> None:
    """The factor of a chain whose last spring is another: only loads that move that spring are answered wrongly."""
    factor = factorise(chain(1.0)[0])
    matrix = chain(1.001)[0]
    loads = np.zeros((40, 64))
    loads[0] = 1.0
    with pytest.raises(ConvergenceError, match="relative residual"):
        solve_columns(factor, matrix, loads)
    loads[0, 1:] = 0.0  # nothing but zeros beside one wrong answer
    with pytest.raises(ConvergenceError, match="relative residual"):
        solve_columns(factor, matrix, loads)
