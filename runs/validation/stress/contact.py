"""Part of `validate stability`: the contact loop at its limits, with a synthetic tire."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.grid_patch import OnPoints
from tireroad.contact.loop import Drive, roll
from tireroad.contact.roads.kinds.flat import Flat
from tireroad.contact.roads.kinds.obstacle import Cleat, Step
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.grid_compliance import SpreadCompliance
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.solver.stick_slip import Friction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import (
    half_space_compliance,
    half_space_influence,
    winkler_compliance,
)
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import MatrixShear, half_space_shear
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.greens.recursion import Recursion
from tireroad.runs.measure.synthetic import Strip, oval_patch
from tireroad.runs.measure.tabulate import Table

PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
HALF_SPACE = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
SHEAR = MatrixShear(
    PATCH.points[:, :2],
    PATCH.half_sizes,
    lambda x, y, a, b: half_space_shear(x, y, a, b, 5e6, 0.45),
)
CRITICAL = 60.0  # m/s: wave speed of the strip
SHORTEST = 0.06  # s: the road's waves reach full height after 15 ms


@dataclass(frozen=True)
class Case:
    """One run: a strip, its tread, a step in s, a scheme, a friction or None."""

    name: str
    strip: Strip = Strip(speed=20.0)
    tread: np.ndarray = field(default_factory=lambda: HALF_SPACE)
    drive: Drive = Drive(Flat().height, lambda t: 0.0, 20.0)
    step: float = 1e-4
    steps: int = 2000
    scheme: str = "linear"
    friction: float | None = None
    shear: bool = False


@dataclass(frozen=True)
class Ended:
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


def outcomes() -> list[Ended]:
    """Results of all cases."""
    return [thrown_up(), *(outcome(case) for case in cases()), one_mode(), many_points()]


def table(found: list[Ended]) -> Table:
    """Figures of all cases."""
    columns = [("case", ""), ("steps", "-"), ("largest load", "N"), ("variation of the load", "-"),
               ("worst residual", "-"), ("left the road", "-"), ("refused", "")]  # fmt: skip
    rows = [
        [e.name, e.steps, "", "", "", "", e.refused] if e.refused
        else [e.name, e.steps, e.load, e.growth, e.residual, e.left, ""]
        for e in found
    ]  # fmt: skip
    notes = [
        "A made-up tire of 8 kg on a periodic strip, 500 N. Variation of the load: in the last tenth of "
        "the run over the tenth in its middle; waves that grew would show. No case may end in NaN.",
    ]
    return Table("Stability of the contact loop", columns, rows, notes)


def thrown_up(steps: int = 1_000_000) -> Ended:
    """An undamped tire at rest, thrown up by a jump of the road: is its energy conserved?

    Energy: waves |z|^2/m, springs (residual and tread), potential of the load f_s . g.
    """
    strip, step = Strip(damping=0.0), 3e-4
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

    ended = _followed("undamped, standing, thrown up once", watched(), steps)
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
        yield Case(f"speed {speed / CRITICAL:.2g} of critical", Strip(speed=speed),
                   drive=replace(waves, speed=speed))  # fmt: skip
    for power in range(4, 13, 2):
        tread = winkler_compliance(PATCH.area, 10.0**power)
        yield Case(f"tread of 1e{power} N/m3", tread=tread, drive=waves)
    for damping in (0.0, 10.0, 1e3, 1e5):
        yield Case(f"damping {damping:g} 1/s", Strip(speed=20.0, damping=damping), drive=waves)
    spike = Cleat(height=0.010, length=0.002, ramp=0.001).make()
    yield Case("spike of 10 mm, 2 mm long", drive=Drive(spike.height, lambda t: 0.0, 20.0))
    edge = Step(height=0.010, ramp=0.0).make()
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


def outcome(case: Case) -> Ended:
    """Run a case."""
    try:
        return _followed(case.name, _loop(case, len(PATCH.points)), case.steps)
    except (InputError, ConvergenceError) as error:
        return Ended(case.name, case.steps, 0.0, 0.0, 0.0, False, str(error))


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
        friction = Friction(brush, tire.same_step, None, SHEAR if case.shear else None)
    return roll(tire, solver, PATCH, case.drive, case.step, case.steps, friction)


def _followed(name: str, instants, steps: int) -> Ended:
    load, residual, left = np.empty(steps), 0.0, False
    for k, instant in enumerate(instants):
        load[k] = instant.force.sum()
        residual = max(residual, instant.residual)
        left |= instant.active == 0
    tenth = max(steps // 10, 1)
    before = load[steps // 2 - tenth // 2 :][:tenth].std()
    growth = float(load[-tenth:].std() / before) if before > 0 else 0.0
    return Ended(name, steps, float(load.max()), growth, residual, left)


def one_mode() -> Ended:
    """One mode, one point."""
    patch = oval_patch((3, 3), (0.05, 0.06), 500.0)
    middle = np.array([4])
    small = replace(patch, **{
        name: getattr(patch, name)[middle]
        for name in ("index", "points", "half_sizes", "force", "gap", "edge", "line")
    })  # fmt: skip
    tire = Recursion(
        response=Strip().response(small.points, 0, 1),
        step=1e-4,
        scheme="linear",
        comm=MPI.COMM_SELF,
    )
    solver = ActiveSet(tire.same_step + winkler_compliance(small.area, 1e8))
    drive = Drive(Flat().height, lambda t: 5e-3 * np.sin(300 * t), 0.0)
    return _followed("one mode, one point", roll(tire, solver, small, drive, 1e-4, 2000), 2000)


def many_points(steps: int = 150) -> Ended:
    """20,000 points carried by the 63 nodes, from rest onto waves."""
    fine = oval_patch((200, 100), (0.6e-3, 1.2e-3), 500.0)
    away = ((fine.points[:, None, :2] - PATCH.points[None, :, :2]) ** 2).sum(axis=-1)
    weights = np.exp(-away / 2e-4)
    weights = sparse.csr_matrix(np.where(weights > 1e-3, weights, 0.0))
    weights = sparse.diags(1 / weights.sum(axis=1).A1) @ weights
    places = GridPlaces((200, 100), (0.6e-3, 1.2e-3), np.arange(20_000))
    kernel = KernelTread(places, lambda x, y, a, b: half_space_influence(x, y, a, b, 5e6, 0.45))
    response = Strip(speed=20.0).response(PATCH.points, 6, 3, residual=5)
    step = 2e-4
    tire = Recursion(
        response=response.resolved(step), step=step, scheme="linear", comm=MPI.COMM_SELF
    )
    solver = ProjectedCG(SpreadCompliance(tire.same_step, weights.tocsr(), kernel))
    drive = Drive(lambda x, y: 0.1 * wavy(x, y), lambda t: 0.0, 20.0)
    instants = roll(OnPoints(tire, weights.tocsr()), solver, fine, drive, step, steps)
    return _followed("20,000 points", instants, steps)
