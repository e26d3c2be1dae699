"""modal.solver = "slepc": SLEPc's Krylov-Schur finds the same modes in the same slices."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain

import tireroad as tr
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.model import SmallMotions
from tireroad.modal.solver.slicing import Interval, eigenpairs, krylov_schur
from tireroad.modal.standing import solved


@pytest.fixture(scope="module")
def motions() -> SmallMotions:
    tire = tr.torus(youngs_modulus=48e6, segments=16, elements_arc=6, order=2)
    return SmallMotions(tire, tr.press(tire, inflation=2e5, load=400.0))


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("wanted", [{"count": 30}, {"up_to": 180.0}])
def test_the_same_modes(motions: SmallMotions, wanted: dict) -> None:
    one, other = (solved(motions.operators, **wanted, solver=name) for name in ("lanczos", "slepc"))
    assert one.count == other.count > 10
    np.testing.assert_allclose(other.frequency, one.frequency, rtol=1e-9)
    assert other.residual.max() < 1e-8 and other.orthonormality < 1e-10
    assert other.inertia_count >= other.count


@pytest.mark.slow
def test_a_wrong_count_is_told() -> None:
    matrix, values = chain(300)
    low, high = (values[3] + values[4]) / 2, (values[20] + values[21]) / 2
    found, vectors = eigenpairs(matrix, Interval(low, high, 17), search=krylov_schur)
    np.testing.assert_allclose(found, values[4:21], rtol=1e-9)
    assert np.abs(matrix @ vectors - vectors * found).max() < 1e-9 * values.max()
    with pytest.raises(ConvergenceError, match="inertia of K - sigma M counts 18"):
        eigenpairs(matrix, Interval(low, high, 18), search=krylov_schur)
