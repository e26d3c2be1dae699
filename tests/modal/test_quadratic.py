"""The full quadratic problem against the projected one on the complete basis, where both are exact."""

import numpy as np
import pytest
from chains import distributed, own_rows
from mpi4py import MPI
from rings import random_tire, wave_ring
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.rolling import missing, truncation
from tireroad.modal.rotating import matrices, rotating
from tireroad.modal.solver.fields import multiply
from tireroad.modal.solver.quadratic import solve

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


@pytest.mark.mpi
def test_states_next_to_defective_are_refused():
    """The lowest mode critically damped: one vector for two states. Damped by a tenth more, two of them."""
    squares = np.linspace(300.0, 900.0, 40) ** 2
    for damping, allowed in ((2 * 300.0, False), (2.2 * 300.0, True)):
        drag = sparse.identity(40, format="csr") * damping
        low, high = own_rows(40)
        matrices_ = distributed(drag), distributed(sparse.diags(squares, format="csr"))
        ones = np.ones(high - low)
        if allowed:
            assert solve(ones, *matrices_, 5).condition < 100.0
        else:
            with pytest.raises(ConvergenceError, match="next to defective.*critical damping"):
                solve(ones, *matrices_, 5)


def test_states_that_are_missing_are_counted():
    """Against the projected count; a state that the truncated basis shifts across a limit is none."""
    full, projected = np.array([10.0, 20.0, 30.0]), np.array([10.1, 20.1, 25.0, 30.1, 40.0])
    assert missing(full, projected, 5.0, 35.0) == 1
    assert missing(np.append(full, 25.0), projected, 5.0, 35.0) == 0
    assert missing(full[:2], projected, 5.0, 30.3) == 1
    assert missing(full[:2], projected, 5.0, 25.2) == 0
