"""The compiled step against plain NumPy: normal and with friction, on nodes and grids, on slopes, by every scheme."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.loop import ContactProblem, Drive, Loop
from tireroad.contact.solver import grid_newton
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import ProjectedCG, SpreadCompliance
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import KernelShear, MatrixShear, half_space_shear
from tireroad.greens.recursion import Recursion
from tireroad.tests.reference.step import Bristles, PlainLoop
from tireroad.tests.validation.cases import RollingStrip, oval_patch

STEP, SPEED, STEPS = 1e-4, 20.0, 80
NODES = oval_patch((7, 5), (0.02, 0.025), 500.0)
COUNTS, SPACING = (13, 9), (0.01, 0.0125)
POINTS = oval_patch(COUNTS, SPACING, 500.0)


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    grown = np.clip(x / 0.2, 0.0, 1.0) ** 3
    return 4e-4 * grown * (np.sin(40 * x + 15 * y) + 0.5 * np.sin(130 * x - 60 * y))


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    apart = 1e-6
    along = (height(x + apart, y) - height(x - apart, y)) / (2 * apart)
    across = (height(x, y + apart) - height(x, y - apart)) / (2 * apart)
    return np.stack([along, across], axis=-1)


def carried() -> sparse.csr_matrix:
    """Bilinear weights of the nodes' grid at the points."""
    both = [
        np.maximum(1 - np.abs(np.arange(c)[:, None] / 2 - np.arange(n)), 0.0)
        for c, n in zip(COUNTS, (7, 5), strict=True)
    ]
    return sparse.csr_matrix(np.kron(*both))


def pressed(x, y, a, b) -> np.ndarray:
    return half_space_influence(x, y, a, b, 5e6, 0.3)


def tread_of(patch, nu: float, shears: bool):
    """Compliance in z, x, y, (3c, 3c), and the tread's shear as matrix and as kernels."""
    x, y = (patch.points[:, None, k] - patch.points[None, :, k] for k in (0, 1))
    sizes = patch.half_sizes[None, :, 0], patch.half_sizes[None, :, 1]
    zz = half_space_influence(x, y, *sizes, 5e6, nu)
    c = len(zz)
    whole = np.zeros((3 * c, 3 * c))
    whole[:c, :c] = 0.5 * (zz + zz.T)
    if shears:
        xx, xy, yy, zx, zy = half_space_shear(x, y, *sizes, 5e6, nu)
        whole[:c, c:] = np.hstack([0.5 * (zx - zx.T), 0.5 * (zy - zy.T)])
        whole[c:, :c] = whole[:c, c:].T
        whole[c:, c:] = np.block([[xx, xy], [xy, yy]])
    return whole


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
@pytest.mark.parametrize("points", ["nodes", "grid", "grid, no matrix"])
@pytest.mark.parametrize("leans", [False, True])
@pytest.mark.parametrize("friction", [None, 0.0, 0.4, 2.0])
def test_forces_are_those_of_plain_numpy(
    scheme: str, points: str, leans: bool, friction: float | None, monkeypatch
) -> None:
    on_grid, at_once = points != "nodes", points == "grid, no matrix" and friction is not None
    monkeypatch.setattr(grid_newton, "GAP_TOLERANCE", 1e-13)
    weights = carried() if on_grid else None
    patch = replace(POINTS, weights=weights) if on_grid else NODES
    c, p = len(patch.points), len(NODES.points)
    response = RollingStrip(speed=SPEED).horizontal_response(NODES.points, 3, 2, 1e2)
    away = ((NODES.points[:, None] - NODES.points[None]) ** 2).sum(axis=-1)
    local = np.kron(
        [[1.0, 0.1, 0.0], [0.1, 0.5, 0.0], [0.0, 0.0, 0.5]], 1e-6 * np.exp(-away / 4e-4)
    )
    response = replace(response, residual=local, pulse=p if leans else 0)
    if friction is None and not leans:
        response = response.between(slice(0, p), slice(0, p))
    tread = tread_of(patch, 0.3, friction is not None)
    tire = Recursion(response=response, step=STEP, scheme=scheme, comm=MPI.COMM_SELF)
    dense = np.eye(p) if weights is None else weights.toarray()
    whole = dense @ tire.same_step[:p, :p] @ dense.T + tread[:c, :c]
    places = GridPlaces(COUNTS, SPACING, np.arange(c))
    product = SpreadCompliance(tire.same_step[:p, :p], carried(), KernelTread(places, pressed))
    solver = ProjectedCG(product) if at_once else ActiveSet(whole)
    coupling = plain = None
    if friction is not None:
        law = BrushLaw(2e5, friction, (0.01, 0.004))
        brush = Brush(law, patch.points[:, 0], patch.line, SPEED, STEP)
        brush.begin(patch.force > 0)
        given = lambda x, y, a, b: half_space_shear(x, y, a, b, 5e6, 0.3)  # noqa: E731
        if on_grid:
            shear = KernelShear(places, given)
        else:
            shear = MatrixShear(patch.points[:, :2], patch.half_sizes, given)
        coupling = BrushFriction(brush, tire.same_step, weights, shear, tolerance=1e-12)
        slip = np.broadcast_to(brush.slip[:, None], (2, c))
        plain = Bristles(brush, slip, np.full(c, 2e5))
        plain.begin(patch.force > 0)
    rows = slice(0, c) if friction is None and not leans else slice(None)
    loop = PlainLoop(
        response, STEP, scheme, dense, tread[rows, rows], patch.force, patch.gap, plain, friction
    )
    drive = Drive(height, lambda t: 0.0, SPEED, slope if leans else None)
    largest, slips = 0.0, 0
    problem = ContactProblem(patch, tire.same_step, solver, coupling, tolerance=1e-13)
    for block in Loop(tire, problem).roll(drive, STEP, STEPS, at_once=1):
        instant = next(block.instants())
        x, y = patch.points[:, 0] + SPEED * instant.time, patch.points[:, 1]

        def at(place, x=x, y=y):
            here = (x + place[0], y + place[1]) if leans else (x, y)
            return height(*here), slope(*here) if leans else None

        force, t, lean = loop.step(at)
        added = loop._added(lean, force, t).reshape(3, c) if leans else np.zeros((3, c))
        largest = max(largest, np.abs(force).max())
        slips += np.count_nonzero(
            np.hypot(*t)[force > 0] >= 0.999 * (friction or 0.0) * force[force > 0]
        )
        limit = (1e-8 if at_once else 1e-10) * largest * (1 if friction is None else 10)
        assert np.abs(instant.force - force - added[0]).max() < limit
        assert np.abs(instant.horizontal.T - t - added[1:]).max() < limit
    assert largest > 10.0
    assert slips > 100 or friction == 2.0
