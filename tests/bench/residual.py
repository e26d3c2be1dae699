"""Truncation error with each residual, and the cost of the residual itself."""

from __future__ import annotations

import time

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.matrices import probe
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.wheel import Turning
from tireroad.greens.coupling import Basis, Wheel, wheel_of
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import keep
from tireroad.greens.responses import Cutoff, estimate
from tireroad.modal.basis import ModalBasis
from tireroad.modal.rolling import RollingModes, rolling_modes
from tireroad.modal.standing import standing_modes
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.cases import thesis_torus

ABOUT = "receptance of few modes with each residual against the full matrices; set-up times"

COUNTS = (10, 30, 100, 300)
OPTIONS = ("none", "dirac", "static", "attachment")
DAMPING = (500.0, 0.0)
SPEED = 50.0
BAND = 5  # frequencies up to half the highest kept mode
INFLATION = 2e5
# Sizes for the set-up times.
MODES, FORCES = 1000, 300
# Vertical forces and displacements around the lowest point, like those of a contact patch, in rad.
PATCH = [(ring, arc) for ring in (-0.1, 0.0, 0.1) for arc in (-0.15, 0.0, 0.15)]


def run() -> list[Table]:
    """Error tables at rest and rolling, the receptance itself, the choice of states, and times."""
    comm = MPI.COMM_WORLD
    motions = _tire(comm, 20, 7)
    modes = standing_modes(motions, count=max(COUNTS))
    lattice = motions.lattice
    spots = [
        probe.directed(probe.spot(lattice, *spot), np.array([0.0, 0.0, 1.0])) for spot in PATCH
    ]
    probes = sparse.csr_matrix(np.stack(spots))
    standing_wheel = wheel_of(motions, Turning(damping=DAMPING))
    rolling_wheel = wheel_of(motions, Turning(speed=SPEED, damping=DAMPING))
    return [
        _errors(standing_wheel, modes, probes),
        _errors(rolling_wheel, modes, probes),
        _figure(standing_wheel, modes, probes),
        _choice(standing_wheel, modes, probes),
        _times(comm),
    ]


def _tire(comm: MPI.Comm, segments: int, elements_arc: int) -> SmallMotions:
    """An inflated torus of 48 MPa. Collective."""
    section = thesis_torus(segments=segments, elements_arc=elements_arc).ring()
    rubber = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
    tire = TireModel(section, lambda: Body(comm, section, rubber))
    loader = LoadStepper(Equilibrium(tire.body), lambda progress: None)
    loader.inflate(INFLATION)
    return SmallMotions(tire, static_state(loader.equilibrium, loader.touch))


def _respond(wheel: Wheel, modes: ModalBasis, probes, count: int, option: str):
    """The response of the first `count` modes, with all states of the residual kept. Collective."""
    rolling = _rolling(wheel, modes.first(count))
    basis = Basis.of(rolling)
    if option == "none":
        return basis.couple(probes, probes)
    return wheel.respond(basis, rolling.basis.modes, probes, probes, option)


def _rolling(wheel: Wheel, modes: ModalBasis) -> RollingModes:
    return rolling_modes(modes, wheel.turning, wheel.operators.body.comm)


def _off(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest relative error over the frequencies, Frobenius norm over points."""
    error = np.linalg.norm(found - exact, axis=(1, 2)) / np.linalg.norm(exact, axis=(1, 2))
    return float(error.max())


def _errors(wheel: Wheel, modes: ModalBasis, probes) -> Table:
    """Figure 6.2 of the thesis in numbers: every residual for every number of modes. Collective."""
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


def _figure(wheel: Wheel, modes: ModalBasis, probes) -> Table:
    """Figure 6.2 of the thesis: ten modes and the full matrices, driving point. Collective."""
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


def _choice(wheel: Wheel, modes: ModalBasis, probes) -> Table:
    """States kept dynamic by participation or by frequency, the others static. Collective."""
    band = float(modes.frequency[99] / 2)
    whole = _respond(wheel, modes, probes, max(COUNTS), "static")
    frequency = np.linspace(0, band, 60)
    exact = whole.receptance(frequency)
    rows = []
    for count in (10, 20, 30, 50, 100):
        order = np.argsort(np.abs(whole.eigenvalue), kind="stable")[:count]
        slowest = whole.keeping(np.isin(np.arange(len(whole.eigenvalue)), order))
        found = [
            _off(one.receptance(frequency), exact) for one in (slowest, keep(whole, count, band))
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
    """Set-up times of the residual and of the recursion at full size. Collective."""
    motions = _tire(comm, 80, 16)
    body, operators = motions.body, motions.operators
    nearest = np.argsort(body.lattice.points(body.surface.ids)[:, 2], kind="stable")
    places = probe.nodes(nearest[:FORCES], len(nearest))
    modes = standing_modes(motions, count=MODES)
    rows = []

    def clock(name: str, target, work):
        comm.Barrier()
        began = time.perf_counter()
        done = work()
        comm.Barrier()
        rows.append([name, time.perf_counter() - began, target])
        return done

    for speed in (0.0, SPEED):
        wheel = wheel_of(motions, Turning(speed=speed, damping=DAMPING))
        _ = wheel.rotating_stiffness, wheel.rotating_damping
        basis = Basis.of(_rolling(wheel, modes))
        for option in OPTIONS[2:]:
            response = clock(
                f"residual {option}, {speed:g} rad/s",
                30.0,
                lambda w=wheel, o=option, b=basis: w.respond(b, modes.modes, places, places, o),
            )
    states = len(response.eigenvalue)
    clock(
        f"recursion, {states} states, {FORCES} forces",
        5.0,
        lambda: Recursion(response=response, step=1e-4, scheme="linear", comm=comm),
    )
    return Table(
        f"Set-up with {MODES} modes at {operators.stiffness.getSize()[0]} unknowns and {FORCES} contact "
        f"dofs, {comm.size} process(es)",
        [("what", "-"), ("time", "s"), ("target", "s")],
        rows,
        [
            "attachment finds the states of the grown problem too: when rolling that dense eigenproblem is "
            "most of its time"
        ],
    )
