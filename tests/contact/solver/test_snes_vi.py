"""PETSc's two solvers for bounds, on a matrix and on a product, against the active set."""

import subprocess
import sys

import numpy as np
import pytest
from petsc4py import PETSc
from scipy import sparse
from started import environment

from tireroad.contact.model import DENSE_POINTS
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import ProjectedCG, SpreadCompliance
from tireroad.contact.solver.snes_vi import PREFIX, SnesVI
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread


@pytest.fixture(params=["vinewtonrsls", "vinewtonssls"])
def kind(request) -> str:
    options = PETSc.Options(PREFIX)
    options["snes_type"] = request.param
    yield request.param
    options.delValue("snes_type")


def case(n: int):
    """n x n points of a half-space on a soft tire of 9 nodes, and a sphere above them."""
    pitch = 0.04 / n
    side = (np.arange(n) - (n - 1) / 2) * pitch
    x, y = (a.ravel() for a in np.meshgrid(side, side, indexing="ij"))
    places = GridPlaces((n, n), (pitch, pitch), np.arange(n * n))
    tread = KernelTread(places, lambda *where: half_space_influence(*where, 5e6, 0.45))
    line = np.array([-0.02, 0.0, 0.02])
    hats = [np.maximum(1 - np.abs(v[:, None] - line) / 0.02, 0.0) for v in (x, y)]
    weights = sparse.csr_matrix((hats[0][:, :, None] * hats[1][:, None, :]).reshape(n * n, -1))
    tire = 1e-6 * (np.eye(9) + 0.5 + 0.02 * np.triu(np.ones((9, 9)), 1))
    return SpreadCompliance(tire, weights, tread), (x**2 + y**2) / 0.6


def test_both_kinds_on_a_matrix_and_on_a_product(kind: str) -> None:
    product, bowl = case(12)
    every = np.arange(144)
    matrix = np.ascontiguousarray(product.block(every, every))
    solvers = ActiveSet(matrix), SnesVI(matrix), SnesVI(product)
    for depth in (1e-5, 3e-4, 2e-4, 5e-3, -1e-4):
        wanted, *found = (solver.solve(bowl - depth) for solver in solvers)
        for force, solver in zip(found, solvers[1:], strict=True):
            assert np.abs(force - wanted).max() <= 1e-7 * wanted.max()
            assert np.abs(solver.gap - solvers[0].gap).max() < 1e-9 * np.abs(bowl - depth).max()
    assert solvers[1]._snes.getType() == solvers[2]._snes.getType() == kind


def test_thousands_of_points_without_a_matrix() -> None:
    product, bowl = case(40)
    assert len(bowl) > DENSE_POINTS
    found = make_solver("snes-vi", product)
    wanted = ProjectedCG(product).solve(bowl - 3e-4)
    force = found.solve(bowl - 3e-4)
    assert np.abs(force - wanted).max() < 1e-6 * wanted.max()
    assert found.factorisations == 0 and found.residual < 1e-9


@pytest.mark.slow
def test_solvers_left_at_exit_do_not_crash_the_interpreter() -> None:
    # pytest keeps what a test made until the interpreter ends, after PETSc has ended.
    other = f"{__file__}::test_thousands_of_points_without_a_matrix"
    command = [sys.executable, "-P", "-m", "pytest", "-q", "-p", "no:xdist", other]
    done = subprocess.run(command, env=environment(), capture_output=True, timeout=600)
    assert done.returncode == 0
