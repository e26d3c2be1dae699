"""The full quadratic problem against the projected one on the complete basis, where both are exact."""

import numpy as np
import pytest
from chains import distributed, own_rows
from mpi4py import MPI
from rings import random_tire, wave_ring
from scipy import sparse

from tireroad.modal.fields import multiply
from tireroad.modal.quadratic import solve, truncation
from tireroad.modal.rotating import matrices, rotating

COMM = MPI.COMM_WORLD


def pencil(projection, speed, damping, inertia="full"):
    drag, stiffness = matrices(projection, speed, damping, inertia)
    low, high = own_rows(len(drag))
    dense = tuple(distributed(sparse.csr_matrix(matrix)) for matrix in (drag, stiffness))
    return np.ones(high - low), dense, rotating(drag, stiffness)


@pytest.mark.mpi
@pytest.mark.parametrize("gamma", [0.0, 300.0])
def test_full_against_dense(gamma):
    mass, (drag, stiffness), exact = pencil(random_tire(60), 30.0, (gamma, 0.0))
    full = solve(mass, drag, stiffness, 10)
    assert (full.eigenvalue.imag >= 0).all()
    assert 10 <= len(full.eigenvalue) <= 15
    assert truncation(full.eigenvalue, exact.eigenvalue).max() < 1e-8
    lowest = np.sort(np.abs(exact.eigenvalue))[: len(full.eigenvalue)]
    np.testing.assert_allclose(np.sort(np.abs(full.eigenvalue)), lowest, rtol=1e-8)


@pytest.mark.mpi
@pytest.mark.parametrize("repeats", [1, 2])
def test_left_vectors_are_biorthogonal(repeats):
    """Also inside clusters: the doppler ring has every eigenvalue `repeats` times."""
    ring = wave_ring({n: 200.0 + 90.0 * n**1.5 for n in range(1, 20)}, repeats)
    mass, (drag, stiffness), _ = pencil(ring, 20.0, (100.0, 0.0), "doppler")
    full = solve(mass, drag, stiffness, 8)
    s, u, w = full.eigenvalue, full.right, full.left
    moved = multiply(drag, u.real) + 1j * multiply(drag, u.imag)
    near = COMM.allreduce(w.T @ (mass[:, None] * u))
    pairing = s[:, None] * near + near * s + COMM.allreduce(w.T @ moved)
    np.testing.assert_allclose(pairing, np.eye(len(s)), atol=1e-9)


def test_truncation_falls_with_the_basis():
    """Fewer projected modes, larger error; and a state that the basis lacks is not passed over."""
    projection = random_tire(80)
    mass, (drag, stiffness), _ = pencil(projection, 60.0, (100.0, 0.0))
    full = solve(mass, drag, stiffness, 8)
    dense = matrices(projection, 60.0, (100.0, 0.0), "full")
    errors = [
        truncation(
            full.eigenvalue, rotating(*(matrix[:m, :m] for matrix in dense)).eigenvalue
        ).max()
        for m in (20, 40, 80)
    ]
    assert errors[0] > 2 * errors[1] > 0
    assert errors[2] < 1e-8
    assert truncation(full.eigenvalue, full.eigenvalue[:3]).max() == np.inf
