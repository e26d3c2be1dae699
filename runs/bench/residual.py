"""What the modes left out cost, with each residual, and what the residual itself costs."""

from __future__ import annotations

import time

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.matrices import probe
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.loading import Loader
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import Material
from tireroad.fem.tire.mesh import Torus
from tireroad.greens.coupling import Basis, Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.state_selection import keep
from tireroad.greens.truncation import Cutoff, estimate
from tireroad.modal import undamped
from tireroad.modal.basis import project
from tireroad.modal.undamped import Modes
from tireroad.runs.measure.tabulate import Table
from tireroad.runs.stages.modes import sites

ABOUT = "receptance of few modes with each residual against the full matrices; set-up times"

COUNTS = (10, 30, 100, 300)
OPTIONS = ("none", "dirac", "static", "second-order", "attachment")
DAMPING = (500.0, 0.0)
SPEED = 50.0
BAND = 5  # frequencies up to half the highest kept mode
INFLATION = 2e5
# What the set-up times are asked for.
MODES, FORCES = 1000, 300
# Vertical forces and displacements around the lowest point, as a contact patch has them, in rad.
PATCH = [(ring, arc) for ring in (-0.1, 0.0, 0.1) for arc in (-0.15, 0.0, 0.15)]


def run() -> list[Table]:
    """Error tables standing and rolling, the receptance itself, the choice of modes, and times."""
    comm = MPI.COMM_WORLD
    operators = _tire(comm, 20, 7)
    modes = undamped.solve(operators.stiffness, operators.mass, max(COUNTS))
    lattice = operators.body.lattice
    spots = [
        probe.directed(probe.spot(lattice, *spot), np.array([0.0, 0.0, 1.0])) for spot in PATCH
    ]
    probes = sparse.csr_matrix(np.stack(spots))
    rotation = operators.rotation()
    standing_wheel = Wheel(operators, None, 0.0, DAMPING, "full")
    rolling_wheel = Wheel(operators, rotation, SPEED, DAMPING, "full")
    return [
        _errors(standing_wheel, modes, probes),
        _errors(rolling_wheel, modes, probes),
        _figure(standing_wheel, modes, probes),
        _choice(standing_wheel, modes, probes),
        _times(comm),
    ]


def _tire(comm: MPI.Comm, segments: int, elements_arc: int) -> Operators:
    """An inflated torus of 48 MPa. Collective."""
    section = Torus(0.32, 0.10, 0.012, np.radians(120), segments, elements_arc, 1, 2)
    rubber = Material("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
    body = Body(comm, section, rubber)
    Loader(Equilibrium(body), lambda progress: None).inflate(INFLATION)
    return Operators(body, INFLATION)


def _basis(wheel: Wheel, modes: Modes, count: int) -> tuple[Basis, Modes]:
    """The first `count` modes. Collective."""
    few = modes.among(np.arange(count))
    operators = wheel.operators
    comm = operators.body.comm
    projection = project(few, wheel.rotation, operators.carried, comm)
    shape = operators.trace(few.vectors)
    return Basis(shape, projection, wheel.decouple(projection, comm)), few


def _respond(wheel: Wheel, modes: Modes, probes, count: int, option: str):
    basis, few = _basis(wheel, modes, count)
    if option == "none":
        return basis.couple(probes, probes)
    return wheel.respond(basis, few, probes, probes, option)


def _off(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest relative error over the frequencies, Frobenius norm over points."""
    error = np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
    return float(error.max())


def _errors(wheel: Wheel, modes: Modes, probes) -> Table:
    """Thesis figure 6.2 as numbers: every option for every number of modes. Collective."""
    rows = []
    for count in COUNTS:
        top = modes.frequency[count - 1]
        frequency = np.linspace(0, top / 2, BAND)
        exact = wheel.receptance(probes, probes, frequency)
        cutoff = Cutoff(2 * np.pi * top, DAMPING[0])
        for option in OPTIONS:
            response = _respond(wheel, modes, probes, count, option)
            error = _off(response.receptance(frequency), exact)
            guess = float(estimate(response, option, cutoff, frequency).max())
            states = len(response.eigenvalue) + len(response.block)
            rows.append([count, option, states, float(top / 2), error, guess])
    return Table(
        f"Receptance of {len(PATCH)} points of the patch at {wheel.speed:g} rad/s against the full "
        f"matrices ({wheel.operators.stiffness.getSize()[0]} unknowns)",
        [
            ("modes", "-"),
            ("residual", "-"),
            ("states", "-"),
            ("up to", "Hz"),
            ("largest error", "-"),
            ("estimated", "-"),
        ],
        rows,
        ["target: 100 modes with a residual within 0.02 up to half the highest kept frequency"],
        {"x": "modes", "y": ["largest error"], "log": "xy", "by": "residual"},
    )


def _figure(wheel: Wheel, modes: Modes, probes) -> Table:
    """Thesis figure 6.2: ten modes and the full matrices, driving point in the middle. Collective."""
    frequency = np.linspace(0, 2 * modes.frequency[9], 25)
    middle = len(PATCH) // 2
    curves = [wheel.receptance(probes, probes, frequency)]
    curves += [
        _respond(wheel, modes, probes, 10, option).receptance(frequency) for option in OPTIONS
    ]
    sizes = [np.abs(curve[:, middle, middle]) for curve in curves]
    columns = [("frequency", "Hz"), ("full matrices", "m/N"), *((o, "m/N") for o in OPTIONS)]
    return Table(
        "Size of the driving-point receptance: 10 modes against the full matrices",
        columns,
        [[float(value) for value in row] for row in zip(frequency, *sizes, strict=True)],
        [],
        {"x": "frequency", "y": [name for name, _ in columns[1:]], "log": "y", "by": None},
    )


def _choice(wheel: Wheel, modes: Modes, probes) -> Table:
    """States kept dynamic by participation or by frequency, the others static. Collective."""
    band = float(modes.frequency[99] / 2)
    whole = _respond(wheel, modes, probes, max(COUNTS), "static")
    frequency = np.linspace(0, band, 60)
    exact = whole.receptance(frequency)
    rows = []
    for count in (10, 20, 30, 50, 100):
        found = [
            _off(keep(whole, count, band, by).receptance(frequency), exact)
            for by in ("frequency", "participation")
        ]
        rows.append([count, *found, found[0] / found[1]])
    return Table(
        f"{max(COUNTS)} modes, all but some made static: error up to {band:.0f} Hz",
        [("dynamic states", "-"), ("the slowest", "-"), ("by participation", "-"), ("gain", "-")],
        rows,
        ["by participation: what a state loses in the band at the patch when it is made static"],
        {"x": "dynamic states", "y": ["the slowest", "by participation"], "log": "xy", "by": None},
    )


def _times(comm: MPI.Comm) -> Table:
    """Set-up of the residual and of the recursion at full size. Collective."""
    operators = _tire(comm, 80, 16)
    body = operators.body
    nearest = np.argsort(body.lattice.points(body.surface.ids)[:, 2], kind="stable")
    places = probe.nodes(nearest[:FORCES], len(nearest))
    modes = undamped.solve(operators.stiffness, operators.mass, MODES, sites=sites(operators))
    rows = []

    def clock(name: str, target, work):
        comm.Barrier()
        began = time.perf_counter()
        done = work()
        comm.Barrier()
        rows.append([name, time.perf_counter() - began, target])
        return done

    for rotation, speed in ((None, 0.0), (operators.rotation(), SPEED)):
        wheel = Wheel(operators, rotation, speed, DAMPING, "full")
        _ = wheel.rotating_stiffness, wheel.rotating_damping
        basis, _ = _basis(wheel, modes, MODES)
        for option in OPTIONS[2:]:
            response = clock(
                f"residual {option}, {speed:g} rad/s",
                30.0,
                lambda w=wheel, o=option, b=basis: w.respond(b, modes, places, places, o),
            )
    states = len(response.eigenvalue)
    clock(
        f"recursion, {states} states, {FORCES} forces",
        5.0,
        lambda: Recursion(response, 1e-4, "linear", comm),
    )
    return Table(
        f"Set-up with {MODES} modes at {operators.stiffness.getSize()[0]} unknowns and {FORCES} contact "
        f"dofs, {comm.size} process(es)",
        [("what", "-"), ("time", "s"), ("target", "s")],
        rows,
        [
            "second-order and attachment find the states of the grown problem too: when rolling that "
            "dense eigenproblem is most of their time"
        ],
    )
