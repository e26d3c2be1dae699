"""Static states at and beyond the limits: each converges, or stops with reason and last state.

Part of `validate stability`: combinations of a scene's options on one coarse tire, all stages.

Every value of axle, road shape, tread, bristles, pattern and road occurs, and pairs that could
amplify each other: a moving wheel on creeping rubber, patterns with friction, drums with jumps,
slip with camber.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.contact.loop import Drive, roll
from tireroad.contact.roads.kinds.shapes import Cleat, Flat, StepRoad
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import ProjectedCG, SpreadCompliance
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import (
    half_space_compliance,
    half_space_influence,
    winkler_compliance,
)
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import MatrixShear, half_space_shear
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response, couple
from tireroad.modal.basis import Projection, project
from tireroad.modal.campbell import critical_speed, growth, onset
from tireroad.modal.rotating import checks, matrices, rotating, standing
from tireroad.modal.solver import undamped
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.standing import sites
from tireroad.modal.states import StateModes
from tireroad.runs.files.store import opened
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.cases import RollingStrip, oval_patch, thesis_torus

BALANCED = 1e-9  # residual of an equilibrium, relative to the force scale

COUNT = 120
DAMPING = (0.0, 500.0, 5e3, 1e5)  # gamma1, 1/s
SPEEDS = (0.0, 0.3, 0.999, 1.3)  # of the critical speed
SQUARES = np.array([50.0, 400.0, 2.6e4]) ** 2  # 1/s2
SHAPE = np.random.default_rng(3).normal(size=(3, 3))  # kg^-1/2
STEPS = (1e-7, 1e-5, 1e-3, 1e-2)  # s
FREE_STEPS = 200_000
MODAL_DAMPING = {
    "gamma1 = 0": 0.0,
    "light damping": 5.0,
    "critical damping": 800.0,
    "critical damping but for 1e-14": 800.0 * (1 + 1e-14),
    "gamma1 = 1e5 1/s": 1e5,
}
PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
HALF_SPACE = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
SHEAR = MatrixShear(
    PATCH.points[:, :2],
    PATCH.half_sizes,
    lambda x, y, a, b: half_space_shear(x, y, a, b, 5e6, 0.45),
)
CRITICAL = 60.0  # m/s: wave speed of the strip
SHORTEST = 0.06  # s: the road's waves reach full height after 15 ms
_BASE = """
name = "combined"
[tire]
segments = 16
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 800.0
error_estimate = false
camber = {camber}
{static}
[modal]
count = 40
[damping]
mass = 200.0
[rotation]
speed = 40.0
{rotation}
[axle]
kind = "{axle}"
[contact]
points = {{ dx = 0.008, dy = 0.008 }}
reach = 0.025
tread = "{tread}"
youngs_modulus = 1e7
{contact}
{pattern}
[road]
{road}
[time]
duration = 0.08
[accuracy]
estimate = false
[output]
spectra = false
"""
_GROOVES = """
[pattern]
pitches = 50
[[pattern.groove]]
width = 0.008
depth = 0.006
[[pattern.groove]]
direction = "circumferential"
width = 0.006
depth = 0.006
"""
_BRUSH = "brush_stiffness_per_area = 1e8\nfriction = 0.8\n"
_CREEPS = "relaxation = [0.3, 0.2]\nrelaxation_time = [1e-3, 1e-2]\n"
_ROUGH = 'kind = "two-slope"\nstone_size = 0.02\nroad_class = "C"\n'
_BAR = 'kind = "cleat"\nposition = 0.2\nheight = 0.01\nlength = 0.02\n'
_HOLE = 'kind = "step"\nposition = 0.3\nheight = -0.02\nramp = 0.0\n'
_DRUM = "drum_radius = 0.85\n"
_INSIDE = 'drum_radius = 1.0\ndrum = "inside"\n'
ABOUT = "finite elements, modes, Green's functions and the contact loop under stress"


@dataclass(frozen=True)
class Attempt:
    """A static state of a small torus: Pa, N, m, rad/s.

    `mesh`: segments, elements along the arc, order; `size`: relative element size at the road.
    """

    name: str
    youngs_modulus: float = 48e6
    poisson_ratio: float = 0.45
    inflation: float = 2e5
    load: float | None = None
    deflection: float | None = None
    speed: float = 0.0
    mesh: tuple[int, int, int] = (12, 6, 2)
    size: float = 0.5


def attempts() -> Iterator[Attempt]:
    """The list of cases."""
    small = (8, 6, 2)
    yield Attempt("deflection of 150 mm", 4.8e6, inflation=2e4, deflection=0.15, mesh=small)
    yield Attempt("inflation of 5 MPa, E = 1 MPa", 1e6, inflation=5e6, mesh=small)
    for modulus in (4.8e5, 4.8e6, 4.8e7, 4.8e8, 4.8e9):
        name = f"E = {modulus:g} Pa, pressure and load in proportion"
        share = modulus / 48e6
        yield Attempt(name, modulus, inflation=2e5 * share, load=300.0 * share, mesh=small)
    for ratio in (-0.5, 0.0, 0.49, 0.499, 0.4995):
        name = f"Poisson's ratio {ratio:g}, 300 N"
        yield Attempt(name, poisson_ratio=ratio, load=300.0, mesh=small)
    yield Attempt("one contact node, 0.1 N", load=0.1)
    yield Attempt("a load of 10 MN", 4.8e6, inflation=2e4, load=1e7, mesh=(8, 4, 2))
    yield Attempt("900 rad/s, E = 2 MPa", 2e6, speed=900.0)


@dataclass(frozen=True)
class EndedRun:
    """The final state, the solver's message if it is not the one asked for, and the check.

    The equations are solved again from the state: `residual`, and Newton `steps`, 0 if in
    equilibrium.
    """

    state: StaticState
    message: str
    residual: float
    steps: int

    @property
    def balanced(self) -> bool:
        """Whether the final state, possibly the last good one, is in equilibrium."""
        return self.steps == 0 and self.residual <= BALANCED


def result(asked: Attempt) -> EndedRun:
    """Load the tire, and check the equilibrium of the final state."""
    segments, arc, order = asked.mesh
    section = thesis_torus(
        segments=segments, elements_arc=arc, order=order, footprint_size=asked.size
    )
    rubber = compound(
        "neo-hookean",
        1200.0,
        youngs_modulus=asked.youngs_modulus,
        poisson_ratio=asked.poisson_ratio,
    )
    equilibrium = Equilibrium(
        Body(MPI.COMM_SELF, section, rubber), Rolling(speed=asked.speed, damping=500.0)
    )
    loader = LoadStepper(equilibrium, lambda progress: None)
    message = ""
    try:
        loader.inflate(asked.inflation)
        if asked.load:
            loader.carry(asked.load)
        if asked.deflection:
            loader.deflect(asked.deflection)
    except ConvergenceError as error:
        message = str(error)
    state = static_state(equilibrium, loader.lowest())
    again = equilibrium.solve(equilibrium.road_height)
    return EndedRun(state, message, again.residual, again.iterations)


def static_rows() -> list[list]:
    """(package, case, result, how it was caught) for every attempt."""
    return [["fem", asked.name, *outcome(result(asked))] for asked in attempts()]


def outcome(ended: EndedRun) -> tuple[str, str]:
    """The result, and how it was caught, for the table."""
    state = ended.state
    moved = np.abs(state.displacement).max()
    if not np.isfinite(moved):
        return "NaN", "not caught"
    touching = np.count_nonzero(state.force)
    held = f"{1e3 * moved:.3g} mm moved, {touching} nodes carry {state.load:.4g} N"
    if ended.message and moved == 0:
        return "stopped at once: nothing converged", ended.message
    if not ended.balanced:
        return f"out of balance by {ended.residual:.1e}: {held}", "not caught"
    if ended.message:
        return f"stopped; last good state kept: {held}", ended.message
    return f"converged: {held}", "needs no catching"


def modal_rows() -> list[list]:
    """(package, case, result, how it was caught)."""
    section = thesis_torus(segments=8, elements_arc=4)
    body = Body(
        MPI.COMM_SELF,
        section,
        compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45),
    )
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(2e5)
    rows = [_double(Operators(body, 2e5)), _negative(body)]
    loader.deflect(0.003)
    operators = Operators(body, 2e5)
    modes = _modes(operators)
    projection = project(modes, operators.rotation(), operators.carried, MPI.COMM_SELF)
    rows += [_damped(projection, gamma) for gamma in DAMPING]
    rows.append(_past_critical(projection))
    return [["modal", *row] for row in rows]


def _modes(operators: Operators) -> Modes:
    return undamped.solve(operators.stiffness, operators.mass, COUNT, sites=sites(operators))


def _double(operators: Operators) -> list:
    """An axisymmetric tire: every wave has a twin."""
    modes = _modes(operators)
    gaps = np.diff(modes.frequency) / modes.frequency[:-1]
    pairs = np.count_nonzero(gaps < 1e-8)
    what = (
        f"{COUNT} modes, {pairs} double pairs; as many as the inertia count says; orthonormal to "
        f"{modes.orthonormality:.0e}"
    )
    return ["double eigenvalues of a round tire", what, "inertia count, orthonormality checked"]


def _negative(body: Body) -> list:
    """External pressure: the stiffness becomes indefinite."""
    case = "negative stiffness: 5 MPa from outside"
    try:
        _modes(Operators(body, -5e6))
    except ConvergenceError as error:
        return [case, "refused", str(error)]
    return [case, "modes of a buckled tire", "not caught"]


def _damped(projection: Projection, gamma: float) -> list:
    """Speeds up to beyond the critical one, both kinds of inertia; `checks` raises any failure."""
    case = f"gamma1 = {gamma:g} 1/s, speeds to 1.3 of critical"
    worst, states = 0.0, 0
    try:
        for inertia in ("full", "doppler"):
            critical = critical_speed(projection, inertia)
            for part in SPEEDS:
                pencil = matrices(projection, part * critical, (gamma, 0.0), inertia)
                modes = rotating(*pencil)
                worst = max(worst, *checks(modes, *pencil).values())
                states = max(states, len(modes.block))
    except ConvergenceError as error:
        return [case, "refused", str(error)]
    what = f"identities hold to {worst:.0e}; at most {states} states without vectors"
    return [case, what, "sum identities, biorthogonality and residuals checked in every run"]


def _past_critical(projection: Projection) -> list:
    damping = (50.0, 0.0)
    high = 2 * critical_speed(projection, "full")
    rate = growth(projection, high, damping, "full")
    first = onset(projection, damping, "full", high) if rate else np.inf
    what = f"grows at {rate:.3g} 1/s at {high:.0f} rad/s, from {first:.0f} rad/s on"
    return ["twice the critical speed", what, "a warning with the speed at which growth begins"]


def greens_rows() -> list[list]:
    """(package, case, result, how it was caught)."""
    rows = [_greens_damped(name, value) for name, value in MODAL_DAMPING.items()]
    rows += [_defective(split) for split in (0.0, 1e-13, 1e-10, 1e-6)]
    rows += [_long(), _limits()]
    return [["greens", *row] for row in rows]


def _responses(damping: float) -> list[Response]:
    """Responses by the closed form and by the quadratic eigenproblem."""
    projection = Projection(squares=SQUARES, momentum=np.ones((3, 3)))
    both = standing(projection, (damping, 0.0)), rotating(damping * np.eye(3), np.diag(SQUARES))
    return [couple(modes, SHAPE, SHAPE, np.ones((3, 3))) for modes in both]


def _greens_damped(name: str, damping: float) -> list:
    """Eight random forces at steps from 1e-7 to 1e-2 s, all schemes."""
    both = _responses(damping)
    force = np.random.default_rng(5).normal(size=(8, 3))
    worst = 0.0
    for step in STEPS:
        for scheme in ("linear", "damped", "constant"):
            exact = _exact(damping, force, step, scheme)
            for response in both:
                far = np.abs(_followed(response, force, step, scheme) - exact).max()
                worst = max(worst, far / np.abs(exact).max())
    block = max(len(response.block) for response in both)
    caught = f"{block} states without vectors as a block" if block else "needs no catching"
    return [f"{name}, steps 1e-7 to 1e-2 s", f"{worst:.0e} off the matrix exponential", caught]


def _followed(response: Response, force: np.ndarray, step: float, scheme: str) -> np.ndarray:
    tire = Recursion(response=response, step=step, scheme=scheme, comm=MPI.COMM_SELF)
    tire.start(0 * force[0])
    out = np.zeros_like(force)
    for k, new in enumerate(force):
        out[k] = tire.predict() + tire.same_step @ new
        tire.advance(new)
    return out


def _exact(damping: float, force: np.ndarray, step: float, scheme: str) -> np.ndarray:
    """Displacements (n, 3) after each step, the force's course in the step as extra states."""
    wide = np.zeros((12, 12))
    wide[:3, 3:6], wide[3:6, :3], wide[3:6, 3:6] = (
        np.eye(3),
        -np.diag(SQUARES),
        -damping * np.eye(3),
    )
    wide[3:6, 6:9], wide[6:9, 9:] = SHAPE.T, np.eye(3)
    # Scaled by the fastest rate, so that the exponential does not lose digits.
    scale = np.repeat([1.0, 2.6e4, 1.0, 1 / step], 3)
    moved = linalg.expm(wide * step * scale / scale[:, None])
    moved = moved * scale[:, None] / scale
    state, old, before, out = np.zeros(6), np.zeros(3), np.zeros(3), np.zeros_like(force)
    for k, new in enumerate(force):
        held = (9 * new + 6 * old + before) / 16 if scheme == "damped" else new
        pieces = (old, (new - old) / step) if scheme == "linear" else (held, 0 * new)
        state = moved[:6] @ np.concatenate([state, *pieces])
        out[k], before, old = SHAPE @ state[:3], old, new
    return out


def _defective(split: float) -> list:
    """Two coupled modes at an exactly or nearly defective double root."""
    stiffness = np.array([[1e4, 50.0], [split * 50.0, 1e4]])
    drag, shape = 4.0 * np.eye(2), np.array([[1.0, 0.3], [0.2, 1.0]])
    modes: StateModes = rotating(drag, stiffness)
    companion = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -drag]])
    times = np.array([1e-3, 0.05, 0.4])
    exact = [shape @ linalg.expm(companion * t)[:2, 2:] @ shape.T for t in times]
    far = np.abs(couple(modes, shape, shape, np.ones((3, 2))).impulse(times) - exact).max()
    what = f"{far / np.abs(exact).max():.0e} off the matrix exponential"
    block = len(modes.block)
    caught = f"{block} states as a block" if block else f"basis condition {modes.condition:.0e}"
    return [f"near-defective: coupling back of {split:g}", what, caught]


def _long() -> list:
    """Many undamped steps: each mode must keep its amplitude."""
    tire = Recursion(response=_responses(0.0)[0], step=3e-4, scheme="linear", comm=MPI.COMM_SELF)
    tire.start(np.zeros(3))
    tire.predict()
    tire.advance(np.ones(3))
    tire.predict()
    tire.advance(np.zeros(3))
    before = np.abs(tire.state)
    nothing = np.zeros(3)
    for _ in range(FREE_STEPS):
        tire.predict()
        tire.advance(nothing)
    drift = float(np.abs(np.abs(tire.state) / before - 1).max())
    return [
        f"gamma1 = 0, {FREE_STEPS} free steps",
        f"amplitudes drift by {drift:.0e}",
        "needs no catching",
    ]


def _limits() -> list:
    """A state that turns 1e-12 to 1e4 radians per step, against its closed form."""
    worst = 0.0
    for turn in (1e-12, 1e-8, 1e-4, 1e4):
        unit = np.ones((1, 1))
        modes = standing(Projection(squares=np.ones(1), momentum=np.ones((3, 1))), (0.0, 0.0))
        tire = Recursion(
            response=couple(modes, unit, unit, np.ones((3, 1))),
            step=turn,
            scheme="linear",
            comm=MPI.COMM_SELF,
        )
        # (x - sin x)/x for a force that grows linearly over the step; x^2/6 for small x.
        exact = turn**2 / 6 * (1 - turn**2 / 20) if turn < 1 else 1 - np.sin(turn) / turn
        worst = max(worst, abs(tire.same_step[0, 0] / exact - 1))
    return ["s dt from 1e-12 to 1e4", f"{worst:.0e} off the closed form", "series below 0.3"]


@dataclass(frozen=True)
class Case:
    """One run: a strip, its tread, a step in s, a scheme, a friction or None."""

    name: str
    strip: RollingStrip = RollingStrip(speed=20.0)
    tread: np.ndarray = field(default_factory=lambda: HALF_SPACE)
    drive: Drive = Drive(Flat().height, lambda t: 0.0, 20.0)
    step: float = 1e-4
    steps: int = 2000
    scheme: str = "linear"
    friction: float | None = None
    shear: bool = False


@dataclass(frozen=True)
class RolledCase:
    """Result of a case: steps; largest load (N); `growth`: variation of the load in the last tenth
    over that in the middle; worst residual of a step; whether it `left` the road; reason if
    `refused`, or another remark (`said`)."""

    name: str
    steps: int
    load: float
    growth: float
    residual: float
    left: bool
    refused: str = ""
    said: str = ""

    @property
    def row(self) -> list:
        """Package, case, result, how it was caught."""
        if self.refused:
            return ["contact", self.name, "refused", self.refused.removeprefix("contact: ")]
        if not np.isfinite(self.load):
            return ["contact", self.name, "NaN", "not caught"]
        what = f"{self.steps} steps, load to {self.load:.4g} N"
        what += self.said or f", its variation {self.growth:.2g} times that of before"
        what += ", left the road" if self.left else ""
        worst = f"complementarity in every step, worst {self.residual:.0e}"
        return ["contact", self.name, what, worst]


def wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """5 mm of waves, 0.25 m long, eased in over 0.3 m."""
    return 5e-3 * np.clip(x / 0.3, 0.0, 1.0) ** 3 * np.sin(25 * x + 10 * y)


def outcomes() -> list[RolledCase]:
    """Results of all cases."""
    return [thrown_up(), *(rolled(case) for case in cases()), one_mode(), many_points()]


def table(cases: list[RolledCase]) -> Table:
    """Figures of all cases."""
    columns = [("case", ""), ("steps", "-"), ("largest load", "N"), ("variation of the load", "-"),
               ("worst residual", "-"), ("left the road", "-"), ("refused", "")]  # fmt: skip
    rows = [
        [e.name, e.steps, "", "", "", "", e.refused] if e.refused
        else [e.name, e.steps, e.load, e.growth, e.residual, e.left, ""]
        for e in cases
    ]  # fmt: skip
    notes = [
        "A made-up tire of 8 kg on a periodic strip, 500 N. Variation of the load: in the last tenth of "
        "the run over the tenth in its middle; waves that grew would show. No case may end in NaN.",
    ]
    return Table("Stability of the contact loop", columns, rows, notes)


def thrown_up(steps: int = 1_000_000) -> RolledCase:
    """An undamped tire at rest, thrown up by a jump of the road: is its energy conserved?

    Energy: waves |z|^2/m, springs (residual and tread), potential of the load f_s . g.
    """
    strip, step = RollingStrip(damping=0.0), 3e-4
    response = strip.response(PATCH.points, 6, 3, residual=5).resolved(step)
    tire = Recursion(response=response, step=step, scheme="constant", comm=MPI.COMM_SELF)
    drive = Drive(Flat().height, lambda t: 5e-3 if t < 1e-3 else 0.0, 0.0)
    instants = roll(tire, ActiveSet(tire.same_step + HALF_SPACE), PATCH, drive, step, steps)
    springs, energy = response.residual + HALF_SPACE, np.empty(steps)

    def watched():
        for k, instant in enumerate(instants):
            waves = float(np.vdot(tire.state, tire.state).real) / strip.mass
            pressed = 0.5 * float(instant.change @ springs @ instant.change)
            energy[k] = waves + pressed + float(PATCH.force @ instant.gap)
            yield instant

    ended = _contact_followed("undamped, standing, thrown up once", watched(), steps)
    alone = energy[4:]
    said = (
        f", energy rose in no step by more than {max(np.diff(alone).max() / alone[0], 0.0):.0e} of what "
        f"the blow gave; {100 * alone[-1] / alone[0]:.2g} % left"
    )
    return replace(ended, said=said)


def cases() -> Iterator[Case]:
    """The list of cases."""
    waves = Drive(wavy, lambda t: 0.0, 20.0)
    for step in (1e-6, 1e-5, 1e-4, 1e-3):
        for scheme in ("linear", "damped", "constant"):
            yield Case(f"step {step:g} s, {scheme}", drive=waves, step=step, scheme=scheme,
                       steps=max(round(SHORTEST / step), 2000))  # fmt: skip
    for speed in (0.0, 40.0, 80.0, 160.0):
        yield Case(f"speed {speed / CRITICAL:.2g} of critical", RollingStrip(speed=speed),
                   drive=replace(waves, speed=speed))  # fmt: skip
    for power in range(4, 13, 2):
        tread = winkler_compliance(PATCH.area, 10.0**power)
        yield Case(f"tread of 1e{power} N/m3", tread=tread, drive=waves)
    for damping in (0.0, 10.0, 1e3, 1e5):
        yield Case(
            f"damping {damping:g} 1/s", RollingStrip(speed=20.0, damping=damping), drive=waves
        )
    spike = Cleat(height=0.010, length=0.002, ramp=0.001).make()
    yield Case("spike of 10 mm, 2 mm long", drive=Drive(spike.height, lambda t: 0.0, 20.0))
    edge = StepRoad(height=0.010, ramp=0.0).make()
    yield Case("step of 10 mm", drive=Drive(edge.height, lambda t: 0.0, 20.0))
    yield Case("road falls away for 20 ms and comes back", drive=Drive(
        Flat().height, lambda t: -0.1 if 0.01 < t < 0.03 else 0.0, 20.0))  # fmt: skip
    for friction in (0.0, 0.5, 1.0, 2.0):
        yield Case(f"friction {friction:g}", drive=waves, friction=friction)
        yield Case(
            f"friction {friction:g} on a half-space without bristles",
            drive=waves,
            friction=friction,
            shear=True,
        )


def rolled(case: Case) -> RolledCase:
    """Run a case."""
    try:
        return _contact_followed(case.name, _loop(case, len(PATCH.points)), case.steps)
    except (InputError, ConvergenceError) as error:
        return RolledCase(case.name, case.steps, 0.0, 0.0, 0.0, False, str(error))


def _loop(case: Case, count: int):
    strip, friction = case.strip, None
    if case.friction is None:
        response = strip.response(PATCH.points, 6, 3, residual=5)
    else:
        response = strip.horizontal_response(PATCH.points, 6, 3, 1e2)
    tire = Recursion(
        response=response.resolved(case.step),
        step=case.step,
        scheme=case.scheme,
        comm=MPI.COMM_SELF,
    )
    solver = ActiveSet(tire.same_step[:count, :count] + case.tread)
    if case.friction is not None:
        law = BrushLaw(np.inf if case.shear else 1e5, case.friction, (0.05, 0.02))
        brush = Brush(law, PATCH.points[:, 0], PATCH.line, case.drive.speed, case.step)
        brush.begin(PATCH.force > 0)
        friction = BrushFriction(brush, tire.same_step, None, SHEAR if case.shear else None)
    return roll(tire, solver, PATCH, case.drive, case.step, case.steps, friction)


def _contact_followed(name: str, instants, steps: int) -> RolledCase:
    load, residual, left = np.empty(steps), 0.0, False
    for k, instant in enumerate(instants):
        load[k] = instant.force.sum()
        residual = max(residual, instant.residual)
        left |= instant.active == 0
    tenth = max(steps // 10, 1)
    before = load[steps // 2 - tenth // 2 :][:tenth].std()
    growth = float(load[-tenth:].std() / before) if before > 0 else 0.0
    return RolledCase(name, steps, float(load.max()), growth, residual, left)


def one_mode() -> RolledCase:
    """One mode, one point."""
    patch = oval_patch((3, 3), (0.05, 0.06), 500.0)
    middle = np.array([4])
    small = replace(patch, **{
        name: getattr(patch, name)[middle]
        for name in ("index", "points", "half_sizes", "force", "gap", "edge", "line")
    })  # fmt: skip
    tire = Recursion(
        response=RollingStrip().response(small.points, 0, 1),
        step=1e-4,
        scheme="linear",
        comm=MPI.COMM_SELF,
    )
    solver = ActiveSet(tire.same_step + winkler_compliance(small.area, 1e8))
    drive = Drive(Flat().height, lambda t: 5e-3 * np.sin(300 * t), 0.0)
    return _contact_followed(
        "one mode, one point", roll(tire, solver, small, drive, 1e-4, 2000), 2000
    )


def many_points(steps: int = 150) -> RolledCase:
    """20,000 points carried by the 63 nodes, from rest onto waves."""
    fine = oval_patch((200, 100), (0.6e-3, 1.2e-3), 500.0)
    away = ((fine.points[:, None, :2] - PATCH.points[None, :, :2]) ** 2).sum(axis=-1)
    weights = np.exp(-away / 2e-4)
    weights = sparse.csr_matrix(np.where(weights > 1e-3, weights, 0.0))
    weights = sparse.diags(1 / weights.sum(axis=1).A1) @ weights
    places = GridPlaces((200, 100), (0.6e-3, 1.2e-3), np.arange(20_000))
    kernel = KernelTread(places, lambda x, y, a, b: half_space_influence(x, y, a, b, 5e6, 0.45))
    response = RollingStrip(speed=20.0).response(PATCH.points, 6, 3, residual=5)
    step = 2e-4
    tire = Recursion(
        response=response.resolved(step), step=step, scheme="linear", comm=MPI.COMM_SELF
    )
    solver = ProjectedCG(SpreadCompliance(tire.same_step, weights.tocsr(), kernel))
    drive = Drive(lambda x, y: 0.1 * wavy(x, y), lambda t: 0.0, 20.0)
    instants = roll(tire, solver, replace(fine, weights=weights.tocsr()), drive, step, steps)
    return _contact_followed("20,000 points", instants, steps)


@dataclass(frozen=True)
class Combination:
    """Values of the scene's keys."""

    axle: str = "corner"
    tread: str = "half-space"
    road: str = _ROUGH
    camber: float = 0.0
    rotation: str = ""
    contact: str = ""
    pattern: str = ""
    static: str = ""


COMBINATIONS = {
    "corner, pattern, layer, rough": Combination(tread="layer", pattern=_GROOVES),
    "corner, creeping tread with friction, over a bar": Combination(
        tread="viscoelastic", contact=_BRUSH + _CREEPS, road=_BAR
    ),
    "free wheel, camber, drum, pattern with friction": Combination(
        axle="free", camber=3.0, contact=_BRUSH, pattern=_GROOVES, road=_ROUGH + _DRUM
    ),
    "corner, camber, free rolling at a slip angle, creeping tread": Combination(
        tread="viscoelastic", camber=-3.0, rotation="free_rolling = true\nslip_angle = 2.0",
        contact=_BRUSH + _CREEPS,
    ),
    "held, inside a drum, over a bar": Combination(axle="fixed", road=_BAR + _INSIDE),
    "corner, springs, drum, into a hole": Combination(tread="winkler", road=_HOLE + _DRUM),
    "corner, friction in the static state, rolling freely, rough": Combination(
        static="friction = 0.8\n",
    ),
    "held, friction in the static state at a slip angle and driven, pattern, over a bar": Combination(
        axle="fixed", static="friction = 0.6\n", rotation="slip_angle = 2.0", pattern=_GROOVES, road=_BAR,
        contact="slip = [0.01, 0.0]\n",
    ),
    "free wheel, friction in the static state, braked by 20 %, creeping tread": Combination(
        axle="free", static="friction = 1.0\n", tread="viscoelastic", contact=_CREEPS + "slip = [-0.2, 0.0]\n",
    ),
    "corner, friction in the static state under camber on a drum, at a slip angle, rough": Combination(
        camber=3.0, static="friction = 0.8\n", rotation="slip_angle = 2.0", road=_ROUGH + _DRUM,
    ),
    "free wheel, friction in the static state inside a drum, braked by 5 %, over a bar": Combination(
        axle="free", static="friction = 0.8\n", contact="slip = [-0.05, 0.0]\n", road=_BAR + _INSIDE,
    ),
    "corner, friction on a half-space without bristles, rolling freely, rough": Combination(
        rotation="free_rolling = true", contact="friction = 0.8\n",
    ),
    "free wheel, friction on a layer without bristles, braked by 10 %, pattern, over a bar": Combination(
        axle="free", tread="layer", contact="friction = 1.2\nslip = [-0.1, 0.0]\n", pattern=_GROOVES, road=_BAR,
    ),
    "corner, camber, friction on creeping tread without bristles, at a slip angle, into a hole": Combination(
        camber=3.0, tread="viscoelastic", rotation="slip_angle = 2.0", contact="friction = 0.8\n" + _CREEPS, road=_HOLE,
    ),
    "held, friction on a half-space that pressure moves sideways, driven by 5 %, rough": Combination(
        axle="fixed", contact="friction = 0.8\npoisson_ratio = 0.2\nslip = [0.05, 0.0]\n",
    ),
    "corner, bristles that never slip, braked by 10 %": Combination(
        contact="brush_stiffness_per_area = 1e8\nslip = [-0.1, 0.0]\n"
    ),
}  # fmt: skip


def combined_rows(names: list[str] | None = None) -> list[list]:
    """Package, case, result and how it was caught, for each combination. Collective."""
    with TemporaryDirectory() as folder:
        return [
            ["all stages", name, *_ended(COMBINATIONS[name], Path(folder))]
            for name in names or COMBINATIONS
        ]


def _ended(combination: Combination, folder: Path) -> tuple[str, str]:
    """The result, and how it was caught."""
    from tireroad.runs.scene.load import load

    text = _BASE.format(**vars(combination))
    if combination.tread == "winkler":
        text = text.replace("youngs_modulus = 1e7\n", "")
    (folder / "scene.toml").write_text(text)
    try:
        scene = load(folder / "scene.toml", [])
        with console.quiet():
            run_scene(scene, folder, MPI.COMM_WORLD, until="contact", fresh=False, petsc_options=[])
    except (InputError, ConvergenceError) as error:
        return "refused", str(error)
    with opened(folder / "contact.h5") as file:
        load_, residual = file["total_force"][:, 2], float(np.max(file["residual"][:]))
        axle = file["axle_force"][:]
    if not (np.isfinite(load_).all() and np.isfinite(axle).all()):
        return "NaN", "not caught"
    return (
        f"{len(load_)} steps, load {load_.min():.4g} to {load_.max():.4g} N",
        f"complementarity in every step, worst {residual:.0e}",
    )


def run() -> list[Table]:
    """All packages in one table, and the figures of the contact loop in another."""
    contact = outcomes()
    rows = [*static_rows(), *modal_rows(), *greens_rows()]
    rows += [ended.row for ended in contact]
    rows += combined_rows()
    columns = [("package", ""), ("case", ""), ("what happened", ""), ("how it was caught", "")]
    whole = Table("Numerical stability", columns, rows, ["No case may end in NaN or uncaught."])
    return [whole, table(contact)]
