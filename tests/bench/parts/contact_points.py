"""Part of `bench contact`: thousands of points, and a static rough contact against tamaas."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import sparse

from tireroad.contact.roads.kinds.texture import TextureRoad
from tireroad.contact.solver.projected_cg import ProjectedCG, SpreadCompliance
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.compliance import half_space_influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts.floors import durations

ELASTIC = 5e6, 0.45


def median(function: Callable[[], object], repeats: int) -> float:
    """Median of several runs, s; the loops it is compared with are medians too."""
    return float(np.median(durations(function, repeats)))


def _grid_case(n: int):
    """A sphere-like gap on n x n points over 0.1 m, below a soft tire."""
    pitch = 0.1 / n
    x, y = (a.ravel() for a in np.meshgrid(*2 * [(np.arange(n) - (n - 1) / 2) * pitch]))
    places = GridPlaces((n, n), (pitch, pitch), np.arange(n * n))
    kernel = KernelTread(
        places, partial(half_space_influence, youngs_modulus=ELASTIC[0], poisson_ratio=ELASTIC[1])
    )
    return x, y, kernel


def large() -> Table:
    """Both solvers on a moving textured road; the last row is 100 x 100 points by projected CG."""
    rows = []
    for n in (32, 64, 100):
        x, y, kernel = _grid_case(n)
        line = np.linspace(-0.05, 0.05, 12)

        def hats(p, line=line):
            return np.maximum(1 - np.abs(p[:, None] - line) / (line[1] - line[0]), 0)

        weights = sparse.csr_matrix((hats(x)[:, :, None] * hats(y)[:, None, :]).reshape(n * n, -1))
        nodes = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
        away = ((nodes[:, None] - nodes) ** 2).sum(axis=-1)
        tire = 1e-6 * (np.exp(-away / 0.0018) + 0.01 * np.eye(len(nodes)))
        road = TextureRoad(seed=1).make()
        for solver in (
            make_solver("active-set", SpreadCompliance(tire, weights, kernel)),
            ProjectedCG(SpreadCompliance(tire, weights, kernel)),
        ):
            seconds, most = [], 0
            for k in range(12):
                q = (x**2 + y**2) / 0.6 - 2e-3 - road.height(x + 2e-3 * k, y)
                began = time.perf_counter()
                solver.solve(q)
                seconds.append(time.perf_counter() - began)
                most = max(most, int(solver.active.sum()))
            rows.append([f"{n} x {n}", type(solver).__name__, most, 1e3 * np.median(seconds[2:])])
    columns = [("points", ""), ("solver", ""), ("touching", "-"), ("time a step", "ms")]
    return Table(
        "Many points: a textured road that moves 2 mm a step", columns, rows,
        ["Each step to a complementarity residual of 1e-9. Target: 100 x 100 points under 60 ms."],
    )  # fmt: skip


def rough() -> Table:
    """128 x 128 points without a starting guess; the last row is tamaas, if installed."""
    n = 128
    x, y, kernel = _grid_case(n)
    road = TextureRoad(seed=2).make()
    q = -2e-4 - road.height(x, y)
    weights, tire = _none(n * n)
    compliance = SpreadCompliance(tire, weights, kernel)
    solver = ProjectedCG(compliance)
    seconds = median(lambda: ProjectedCG(compliance).solve(q), 3)
    force = solver.solve(q)
    rows = [["projected conjugate gradients", seconds * 1e3, solver.iterations, solver.residual,
             float(force.sum()), 0.0]]  # fmt: skip
    notes = []
    if importlib.util.find_spec("tamaas"):
        rows.append(_tamaas(-q.reshape(n, n), force))
    else:
        notes.append(
            "The package tamaas, to compare with, is not installed here (pip install --no-deps tamaas)."
        )
    columns = [("solver", ""), ("time", "ms"), ("iterations", "-"), ("residual", "-"),
               ("load", "N"), ("difference of forces", "-")]  # fmt: skip
    return Table("Static rough contact, 128 x 128 points, from nothing", columns, rows, notes)


def _tamaas(surface: np.ndarray, force: np.ndarray) -> list:
    """Polonsky and Keer's solver in tamaas (Frerot et al., JOSS 2020), same load, free space.

    Its tolerance, 1e-9 in its own measure, gives forces that agree with ours to about 1e-9.
    """
    import tamaas

    n, size = len(surface), 0.1
    model = tamaas.Model(tamaas.model_type.basic_2d, [size, size], [n, n])
    model.E, model.nu = ELASTIC
    tamaas.ModelFactory.registerNonPeriodic(model, "dcfft")
    solver = tamaas.PolonskyKeerRey(model, surface.copy(), 1e-9)
    solver.setIntegralOperator("dcfft")
    solver.max_iter = 5000
    solver.dump_freq = solver.max_iter

    def solve():
        model.traction[:] = 0.0
        return solver.solve(force.sum() / size**2)

    seconds = median(solve, 3)
    found = model.traction.ravel() * (size / n) ** 2
    difference = float(np.abs(found - force).max() / force.max())
    return ["tamaas", seconds * 1e3, "", solve(), float(found.sum()), difference]


def _none(count: int):
    """A rigid tire."""
    return sparse.csr_matrix((count, 1)), np.zeros((1, 1))
