"""Eigenpairs of an interval by block Lanczos, where Krylov spaces end early or see too little."""

import numpy as np
import pytest
from scipy import sparse

from tireroad.modal.solver.slicing import BLOCK, Interval, Shifted, eigenpairs, nearest

SIZE = 320


def matrix(values: np.ndarray) -> sparse.csr_matrix:
    """Of these eigenvalues, with random vectors."""
    turn = np.linalg.qr(np.random.default_rng(1).standard_normal((len(values),) * 2))[0]
    return sparse.csr_matrix((turn * values) @ turn.T)


SPECTRA = {
    "simple": np.linspace(1.0, 50.0, SIZE) ** 2,
    # One value as often as three blocks are wide: a space of one block sees eight of them.
    "repeated": np.sort(
        np.append(np.full(3 * BLOCK, 40.0), np.linspace(1.0, 50.0, SIZE - 3 * BLOCK) ** 2)
    ),
    # Of so few values that the space is invariant after some blocks.
    "few": np.repeat(np.arange(1.0, 17.0) ** 2, 20),
    # Far apart: what the shift is near to, and all else.
    "wide": np.append(np.linspace(1.0, 1.1, 40), np.geomspace(1e3, 1e9, SIZE - 40)),
}


@pytest.mark.parametrize("name", SPECTRA)
def test_all_eigenvalues_of_an_interval(name: str) -> None:
    values = SPECTRA[name]
    low, high = 0.5 * (values[0] + 0.0), 0.5 * (values[69] + values[70])
    if name in ("few", "wide"):
        low, high = (20.0, 50.0) if name == "few" else (0.9, 2.0)
    inside = values[(values > low) & (values < high)]
    assert 20 <= len(inside) < SIZE / 4
    found, vectors = eigenpairs(matrix(values), Interval(low, high, len(inside)))
    assert np.abs(found - inside).max() < 1e-11 * values[-1]
    assert np.abs(vectors.T @ vectors - np.eye(len(inside))).max() < 1e-10
    residual = np.linalg.norm(matrix(values) @ vectors - vectors * found, axis=0)
    assert residual.max() < 1e-11 * values[-1]


def test_what_is_known_is_left_out() -> None:
    values = SPECTRA["simple"]
    problem = matrix(values)
    exact, fields = np.linalg.eigh(problem.toarray())
    shifted = Shifted(problem, 0.0)
    found, vectors = nearest(shifted, 0.5, exact[30] + 1e-3, 20, fields[:, :11], 1e-12)
    shifted.destroy()
    assert np.sort(found) == pytest.approx(exact[11:31], rel=1e-9)
    assert np.abs(fields[:, :11].T @ vectors).max() < 1e-12


def test_no_more_than_there_are() -> None:
    """Nothing is made up where fewer are inside than are asked for: the whole space is searched."""
    values = SPECTRA["simple"]
    shifted = Shifted(matrix(values), 30.0)
    found, _ = nearest(shifted, values[3] + 1e-6, values[8] + 1e-6, 50, np.zeros((SIZE, 0)), 1e-12)
    shifted.destroy()
    assert np.sort(found) == pytest.approx(values[4:9], rel=1e-9)
