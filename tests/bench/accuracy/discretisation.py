"""Choice of elements: run time against error over order, mesh, grading; locking; diagonal mass."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.parts import converged_load
from tireroad.tests.bench.parts.harmonics import Rubber, lowest
from tireroad.tests.validation.cases import thesis_torus

ABOUT = "element order, mesh, grading, near-incompressibility and mass on the clamped torus"
YOUNGS_MODULUS, INFLATION = 48e6, 2e5  # Pa
COUNT = 28  # modes
RATIOS = (0.45, 0.49, 0.499, 0.4995)
NAMES = "order", "segments", "elements_arc", "elements_thickness", "grading", "footprint_size"
DEFAULT = (3, 28, 16, 1, "bead", 0.2)
MESHES = (
    (2, 20, 8, 1, "bead", 0.25),
    (2, 30, 12, 1, "bead", 0.25),
    (2, 40, 16, 1, "bead", 0.25),
    (2, 50, 16, 1, "bead", 0.25),
    (2, 100, 16, 1, "bead", 1.0),
    (2, 30, 12, 1, "uniform", 0.25),
    (2, 50, 16, 1, "uniform", 0.25),
    (2, 30, 12, 2, "bead", 0.25),
    (3, 16, 8, 1, "bead", 0.25),
    (3, 20, 10, 1, "bead", 0.25),
    (3, 24, 12, 1, "bead", 0.25),
    DEFAULT,
)
LOADED = (
    (2, 16, 8, 1, "bead", 0.25),
    (2, 20, 8, 1, "bead", 0.25),
    (2, 24, 10, 1, "bead", 0.25),
    (2, 50, 16, 1, "bead", 0.25),
    (3, 16, 6, 1, "bead", 0.25),
    (3, 20, 10, 1, "bead", 0.25),
    (3, 24, 12, 1, "bead", 0.25),
    DEFAULT,
)


@dataclass(frozen=True)
class Answer:
    """The lowest frequencies `values` (COUNT,) Hz of a mesh with `unknowns`, in `seconds` of one
    core; `consistent`: the first and the last with the consistent mass, Hz."""

    unknowns: int
    seconds: float
    values: np.ndarray
    consistent: np.ndarray | None = None


def run() -> list[Table]:
    """Frequencies and loads by mesh, integration of the dilatation, and both masses. Collective."""
    for order in (2, 3):  # compile outside the timing
        _answer(_section(order, 12, 4, 1, "bead", 0.5))
    exact = _fourier()
    answers = {}
    for mesh in MESHES:
        answers[mesh] = _answer(_section(*mesh), consistent=mesh[4:] == ("bead", 0.25))
        worst = _errors(answers[mesh], exact).max()
        console.say(f"  {mesh}: {answers[mesh].seconds:.1f} s, worst frequency {worst:.2g} %")
    loads = converged_load.table(
        {_named(mesh): _section(*mesh) for mesh in LOADED}, _named(DEFAULT), _inflated
    )
    return [_meshes(answers, exact), loads, _locking(), _masses(answers, exact)]


def _fourier() -> np.ndarray:
    """The lowest frequencies (Hz) without loads, by Fourier series around, on a fine section."""
    section = _section(3, 8, 28, 2, "bead", 1.0).section()
    return lowest(section, {"wall": Rubber(YOUNGS_MODULUS, 0.45, 1200.0)}, COUNT)


def _inflated(section):
    """A loader with the tire inflated. Collective."""
    from tireroad.fem.static.equilibrium import Equilibrium
    from tireroad.fem.static.load_steps import LoadStepper

    loader = LoadStepper(Equilibrium(_body(section)), lambda progress: None)
    loader.inflate(INFLATION)
    return loader


def _named(mesh) -> str:
    return f"order {mesh[0]}, {mesh[1]} x {mesh[2]}, {mesh[5]:g}"


def _section(*mesh):
    return thesis_torus(**dict(zip(NAMES, mesh, strict=True)))


def _body(section, ratio: float = 0.45):
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.material import compound

    return Body(
        MPI.COMM_WORLD,
        section,
        compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=ratio),
    )


def _answer(section, consistent: bool = False) -> Answer:
    """The lowest modes without loads. Collective."""
    from tireroad.fem.matrices.operators import Operators

    body = _body(section)
    began = time.process_time()
    operators = Operators(body, 0.0)
    values = _frequencies(operators)
    seconds = MPI.COMM_WORLD.allreduce(time.process_time() - began, op=MPI.MAX)
    other = _consistent(operators) if consistent else None
    return Answer(3 * body.lattice.size, seconds, values, other)


def _frequencies(operators, count: int = COUNT) -> np.ndarray:
    from tireroad.modal.solver import undamped
    from tireroad.modal.standing import sites

    where = sites(operators)
    return undamped.solve(operators.stiffness, operators.mass, count, sites=where).frequency


def _consistent(operators) -> np.ndarray:
    """First and last of the lowest frequencies (Hz) with the consistent mass. Collective."""
    from slepc4py import SLEPc

    mass = operators.consistent_mass()
    eps = SLEPc.EPS().create(operators.body.comm)
    eps.setOperators(operators.stiffness, mass)
    eps.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    eps.setDimensions(COUNT)
    eps.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    eps.setTarget(0.0)
    spectral = eps.getST()
    spectral.setType(SLEPc.ST.Type.SINVERT)
    spectral.getKSP().getPC().setFactorSolverType("mumps")
    eps.solve()
    squares = np.sort([eps.getEigenvalue(i).real for i in range(COUNT)])
    eps.destroy()
    mass.destroy()
    return np.sqrt(squares[[0, -1]]) / (2 * np.pi)


def _errors(answer: Answer, exact: np.ndarray) -> np.ndarray:
    return 100 * np.abs(answer.values / exact - 1)


def _meshes(answers: dict, exact: np.ndarray) -> Table:
    rows = []
    for (order, segments, arc, thick, grading, size), answer in answers.items():
        error = _errors(answer, exact)
        row = [f"order {order}, {grading}", f"{segments} x {arc} x {thick}", size]
        row += [answer.unknowns, answer.seconds]
        rows.append([*row, float(error[0]), float(error[-1]), float(error.max()), False])
    for row in rows:
        row[-1] = not any(r[4] < row[4] and r[-2] < row[-2] for r in rows)
    best = ", ".join(f"{r[0]} {r[1]} ({r[4]:.1f} s, {r[-2]:.2g} %)" for r in rows if r[-1])
    return Table(
        f"Frequencies of the clamped torus without loads, E = {YOUNGS_MODULUS / 1e6:g} MPa",
        [
            ("family", ""),
            ("segments x arc x thickness", ""),
            ("footprint_size", "-"),
            ("unknowns", "-"),
            ("time", "s"),
            ("error of the 1st frequency", "%"),
            (f"of the {COUNT}th", "%"),
            ("worst", "%"),
            ("Pareto-best", ""),
        ],
        rows,
        [
            f"Time: processor seconds of matrices and {COUNT} modes; forms compiled before. Against Fourier series "
            f"around the axle, another method: {exact[0]:.5g} to {exact[-1]:.5g} Hz.",
            f"Pareto-best: {best}.",
        ],
        {"x": "time", "y": ["worst"], "log": "xy", "by": "family"},
    )


def _locking() -> Table:
    """First frequency without loads, with full and with reduced integration of the dilatation."""
    meshes = [(2, 20, 8), (2, 40, 16), (3, 16, 8)]
    rows = []
    for ratio in RATIOS:
        row: list = [ratio]
        for order, segments, arc in meshes:
            section = _section(order, segments, arc, 1, "bead", 1.0)
            row += [_first(section, ratio, full) for full in (True, False)]
        rows.append(row)
        console.say(f"  Poisson's ratio {ratio}")
    columns = [
        (f"order {order}, {segments} x {arc}, {kind}", "Hz")
        for order, segments, arc in meshes
        for kind in ("full", "reduced")
    ]
    return Table(
        "First frequency near incompressibility: dilatation integrated in full and reduced",
        [("Poisson's ratio", "-"), *columns],
        rows,
        ["No loads. Full integration locks: its frequency rises towards 0.5; reduced stays."],
    )


def _first(section, ratio: float, full: bool) -> float:
    from tireroad.fem.matrices.operators import Operators

    body = _body(section, ratio)
    if full:
        body.reduced_dx = body.dx
    return float(_frequencies(Operators(body, 0.0), 4)[0])


def _masses(answers: dict, reference: np.ndarray) -> Table:
    rows = []
    for (order, segments, arc, thick, *_), answer in answers.items():
        if answer.consistent is None:
            continue
        exact = reference[[0, -1]]
        apart = 100 * (answer.values[[0, -1]] / answer.consistent - 1)
        errors = 100 * np.abs(np.array([answer.values[[0, -1]], answer.consistent]) / exact - 1)
        figures = (float(value) for value in [*apart, *errors.T.ravel()])
        rows.append([f"order {order}, {segments} x {arc} x {thick}", answer.unknowns, *figures])
    return Table(
        "Diagonal (Gauss-Lobatto) against consistent mass",
        [
            ("mesh", ""),
            ("unknowns", "-"),
            ("1st: difference", "%"),
            ("28th: difference", "%"),
            ("1st: error diagonal", "%"),
            ("1st: error consistent", "%"),
            ("28th: error diagonal", "%"),
            ("28th: error consistent", "%"),
        ],
        rows,
        ["Errors against Fourier series around, whose mass is consistent."],
    )
