"""Which elements: run time against error over order, mesh and grading; locking; the diagonal mass."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.runs.measure.tabulate import Table
from tireroad.runs.process import observe

ABOUT = "element order, mesh, grading, near-incompressibility and mass on the clamped torus"
INFLATION, DEFLECTION = 2e5, 0.005  # Pa, m
COUNT = 20  # modes
RATIOS = (0.45, 0.49, 0.499, 0.4995)
# order, segments, elements_arc, elements_thickness, grading, footprint_size
REFERENCE = (3, 36, 18, 1, "bead", 0.15)
MESHES = (
    (2, 20, 8, 1, "bead", 0.25),
    (2, 30, 12, 1, "bead", 0.25),
    (2, 40, 16, 1, "bead", 0.25),
    (2, 50, 16, 1, "bead", 0.25),
    (2, 60, 24, 1, "bead", 0.25),
    (2, 50, 16, 1, "bead", 0.5),
    (2, 50, 16, 1, "bead", 1.0),
    (2, 100, 16, 1, "bead", 1.0),
    (2, 30, 12, 1, "uniform", 0.25),
    (2, 50, 16, 1, "uniform", 0.25),
    (2, 30, 12, 2, "bead", 0.25),
    (3, 12, 6, 1, "bead", 0.25),
    (3, 16, 8, 1, "bead", 0.25),
    (3, 20, 10, 1, "bead", 0.25),
    (3, 30, 12, 1, "bead", 0.25),
)
QUANTITIES = ("1st frequency", "20th frequency", "load", "footprint length")
DECIDING = (
    3  # of them: the footprint is known to a part of an element; it is told and decides nothing
)


@dataclass(frozen=True)
class Answer:
    """What one mesh gives: `values` as in QUANTITIES (Hz, Hz, N, m), of `unknowns` in `seconds`.

    `estimate` of the load's error, % (None: no coarser mesh); `consistent` frequencies, Hz.
    """

    unknowns: int
    seconds: float
    values: np.ndarray
    estimate: float | None
    consistent: np.ndarray | None = None


def run() -> list[Table]:
    """Meshes against the reference, treatments of the dilatation, both masses. Collective."""
    for order in (2, 3):  # compile outside the clock
        _answer(_section(order, 12, 4, 1, "bead", 0.5))
    observe.say("reference ...")
    reference = _answer(_section(*REFERENCE))
    answers = {}
    for mesh in MESHES:
        answers[mesh] = _answer(_section(*mesh), consistent=mesh[4:] == ("bead", 0.25))
        errors = ", ".join(f"{e:.2g}" for e in _errors(answers[mesh], reference))
        observe.say(f"  {mesh}: {answers[mesh].seconds:.1f} s, errors {errors} %")
    return [_meshes(answers, reference), _locking(), _masses(answers, reference)]


def _section(order, segments, arc, thickness, grading, size):
    from tireroad.fem.tire.mesh import Torus

    return Torus(0.32, 0.1, 0.012, np.radians(120), segments, arc, thickness, order, grading, size)


def _body(section, ratio: float = 0.45):
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.material import compound

    return Body(
        MPI.COMM_WORLD,
        section,
        compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=ratio),
    )


def _answer(section, consistent: bool = False) -> Answer:
    """Inflation, the lowest modes there, then the road. Collective."""
    from tireroad.fem.matrices.operators import Operators
    from tireroad.fem.static.equilibrium import Equilibrium
    from tireroad.fem.static.load_error import load_error
    from tireroad.fem.static.loading import Loader
    from tireroad.fem.static.state import static_state
    from tireroad.fem.static.virtual_work import AT_REST

    began = time.perf_counter()
    body = _body(section)
    equilibrium = Equilibrium(body)
    loader = Loader(equilibrium, lambda progress: None)
    loader.inflate(INFLATION)
    operators = Operators(body, INFLATION)
    modes = _frequencies(operators)
    loader.deflect(DEFLECTION)
    state = static_state(equilibrium, loader.touch)
    seconds = MPI.COMM_WORLD.allreduce(time.perf_counter() - began, op=MPI.MAX)
    values = np.array([modes[0], modes[-1], state.load, state.footprint().length])
    found = load_error(loader, AT_REST)
    estimate = None if isinstance(found, str) else 100 * found.relative
    other = _consistent(operators) if consistent else None
    return Answer(3 * body.lattice.size, seconds, values, estimate, other)


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


def _errors(answer: Answer, reference: Answer) -> np.ndarray:
    return 100 * np.abs(answer.values / reference.values - 1)


def _meshes(answers: dict, reference: Answer) -> Table:
    rows = []
    for (order, segments, arc, thick, grading, size), answer in answers.items():
        error = [float(e) for e in _errors(answer, reference)]
        told = [f"order {order}, {grading}", f"{segments} x {arc} x {thick}", size]
        told += [answer.unknowns, answer.seconds, *error, answer.estimate]
        rows.append([*told, max(error[:DECIDING]), False])
    for row in rows:
        row[-1] = not any(r[4] < row[4] and r[-2] < row[-2] for r in rows)
    best = ", ".join(f"{r[0]} {r[1]} ({r[4]:.1f} s, {r[-2]:.2g} %)" for r in rows if r[-1])
    exact = ", ".join(f"{value:.5g}" for value in reference.values)
    return Table(
        "Meshes of the clamped torus, E = 48 MPa, 0.2 MPa, pressed 5 mm on the road",
        [
            ("family", ""),
            ("segments x arc x thickness", ""),
            ("footprint_size", "-"),
            ("unknowns", "-"),
            ("time", "s"),
            *((f"error of {name}", "%") for name in QUANTITIES),
            ("estimated error of load", "%"),
            ("worst", "%"),
            ("Pareto-best", ""),
        ],
        rows,
        [
            f"Time: static state and {COUNT} modes of the inflated tire, one after the other; forms "
            "compiled before. Worst: of both frequencies and the load.",
            f"Reference: order {REFERENCE[0]}, {REFERENCE[1]} x {REFERENCE[2]}, "
            f"{reference.unknowns} unknowns, {reference.seconds:.1f} s: {exact} (Hz, Hz, N, m); its load is "
            f"estimated to be within {reference.estimate:.2g} %.",
            f"Pareto-best: {best}.",
        ],
        {"x": "time", "y": ["worst"], "log": "xy", "by": "family"},
    )


def _locking() -> Table:
    """First frequency without loads, the dilatation by full and by reduced integration."""
    meshes = [(2, 20, 8), (2, 40, 16), (3, 16, 8)]
    rows = []
    for ratio in RATIOS:
        row: list = [ratio]
        for order, segments, arc in meshes:
            section = _section(order, segments, arc, 1, "bead", 1.0)
            row += [_first(section, ratio, full) for full in (True, False)]
        rows.append(row)
        observe.say(f"  Poisson's ratio {ratio}")
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


def _masses(answers: dict, reference: Answer) -> Table:
    rows = []
    for (order, segments, arc, thick, *_), answer in answers.items():
        if answer.consistent is None:
            continue
        exact = reference.values[:2]
        apart = 100 * (answer.values[:2] / answer.consistent - 1)
        errors = 100 * np.abs(np.array([answer.values[:2], answer.consistent]) / exact - 1)
        figures = (float(value) for value in [*apart, *errors.T.ravel()])
        rows.append([f"order {order}, {segments} x {arc} x {thick}", answer.unknowns, *figures])
    return Table(
        "Diagonal (Gauss-Lobatto) against consistent mass",
        [
            ("mesh", ""),
            ("unknowns", "-"),
            ("1st: difference", "%"),
            ("20th: difference", "%"),
            ("1st: error diagonal", "%"),
            ("1st: error consistent", "%"),
            ("20th: error diagonal", "%"),
            ("20th: error consistent", "%"),
        ],
        rows,
        ["Errors against the reference above, whose mass is diagonal too."],
    )
