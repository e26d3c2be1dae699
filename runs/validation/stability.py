"""Every package where it could blow up: each case comes to its end, or is refused with the reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI

from contact.brush import Brush, BrushLaw
from contact.complementarity import ActiveSet
from contact.compliance import SpreadCompliance
from contact.flat import Flat
from contact.friction import Friction
from contact.grid_patch import OnPoints
from contact.kernel import GridPlaces, KernelTread
from contact.obstacle import Obstacle
from contact.projected_cg import ProjectedCG
from contact.rolling import Drive, roll
from contact.synthetic import Strip, oval_patch
from contact.tread import half_space_compliance, half_space_influence, winkler_compliance
from fem.errors import ConvergenceError, InputError
from greens.recursion import Recursion
from runs.tabulate import Table
from runs.validation import stress_fem, stress_greens, stress_modal

ABOUT = "finite elements, modes, Green's functions and the contact loop under stress"
PATCH = oval_patch((9, 7), (0.015, 0.02), 500.0)
HALF_SPACE = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
CRITICAL = 60.0  # m/s: the wave speed of the strip


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


def wavy(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """5 mm of waves, 0.25 m long, grown over 0.3 m."""
    return 5e-3 * np.clip(x / 0.3, 0.0, 1.0) ** 3 * np.sin(25 * x + 10 * y)


def run() -> list[Table]:
    """All packages in one table, and the figures of the contact loop in another."""
    rows = [_row(case) for case in cases()]
    rows += [_one_mode(), _many_points()]
    columns = [("case", ""), ("steps", "-"), ("ended", ""), ("largest load", "N"),
               ("last over first tenth", "-"), ("worst residual", "-"), ("left the road", "-")]  # fmt: skip
    notes = [
        "A made-up tire of 8 kg on a periodic strip, 500 N. Last over first tenth: the variation of the "
        "load; waves that grew would show. No case may end in NaN.",
    ]
    return [_gathered(rows), Table("Stability of the contact loop", columns, rows, notes)]


def _gathered(contact: list[list]) -> Table:
    """Case, what happened, how it was caught: fem, modal, greens, contact."""
    rows = [*stress_fem.rows(), *stress_modal.rows(), *stress_greens.rows()]
    for name, steps, ended, most, growth, residual, left in contact:
        if ended == "whole":
            what = f"{steps} steps, load to {most:.4g} N, variation grew {growth:.2g} times"
            what += ", left the road" if left else ""
            caught = f"complementarity in every step, worst {residual:.0e}"
        else:
            what, _, caught = ended.partition(": ")
        rows.append(["contact", name, what, caught or "not caught"])
    columns = [("package", ""), ("case", ""), ("what happened", ""), ("how it was caught", "")]
    return Table("Numerical stability", columns, rows, ["No case may end in NaN or uncaught."])


def cases() -> Iterator[Case]:
    """The stress list."""
    waves = Drive(wavy, lambda t: 0.0, 20.0)
    undamped = Strip(damping=0.0)
    yield Case("10^6 steps undamped, standing, thrown up once", undamped, drive=Drive(
        Flat().height, lambda t: 5e-3 if t < 1e-3 else 0.0, 0.0), steps=1_000_000,
        step=3e-4, scheme="constant")  # fmt: skip
    for step in (1e-6, 1e-5, 1e-4, 1e-3):
        for scheme in ("linear", "constant"):
            yield Case(f"step {step:g} s, {scheme}", drive=waves, step=step, scheme=scheme)
    for speed in (0.0, 40.0, 80.0, 160.0):
        yield Case(f"speed {speed / CRITICAL:.2g} of critical", Strip(speed=speed),
                   drive=replace(waves, speed=speed))  # fmt: skip
    for power in range(4, 13, 2):
        tread = winkler_compliance(PATCH.area, 10.0**power)
        yield Case(f"tread of 1e{power} N/m3", tread=tread, drive=waves)
    for damping in (0.0, 10.0, 1e3, 1e5):
        yield Case(f"damping {damping:g} 1/s", Strip(speed=20.0, damping=damping), drive=waves)
    spike = Obstacle(0.3, 0.010, 0.002, 0.001, 0.0)
    yield Case("spike of 10 mm, 2 mm long", drive=Drive(spike.height, lambda t: 0.0, 20.0))
    step = Obstacle(0.3, 0.010, np.inf, 0.0, 0.0)
    yield Case("step of 10 mm", drive=Drive(step.height, lambda t: 0.0, 20.0))
    yield Case("road falls away for 20 ms and comes back", drive=Drive(
        Flat().height, lambda t: -0.1 if 0.01 < t < 0.03 else 0.0, 20.0))  # fmt: skip
    for friction in (0.0, 0.5, 1.0, 2.0):
        yield Case(f"friction {friction:g}", drive=waves, steps=300, friction=friction)


def _row(case: Case) -> list:
    count = len(PATCH.points)
    try:
        loop = _loop(case, count)
        return [case.name, *_followed(loop, case.steps)]
    except (InputError, ConvergenceError) as error:
        return [case.name, case.steps, f"refused: {error}", "", "", "", ""]


def _loop(case: Case, count: int):
    strip, friction = case.strip, None
    if case.friction is None:
        response = strip.response(PATCH.points, 6, 3, residual=5)
    else:
        response = strip.horizontal_response(PATCH.points, 6, 3, 1e2)
    tire = Recursion(response.resolved(case.step), case.step, case.scheme, MPI.COMM_SELF)
    solver = ActiveSet(tire.same_step[:count, :count] + case.tread)
    if case.friction is not None:
        law = BrushLaw(1e5, case.friction, (0.05, 0.02))
        brush = Brush(law, PATCH.points[:, 0], PATCH.line, case.drive.speed, case.step)
        brush.begin(PATCH.force > 0)
        friction = Friction(brush, tire.same_step, None)
    return roll(tire, solver, PATCH, case.drive, case.step, case.steps, friction)


def _followed(instants, steps: int) -> list:
    """(steps, ended, largest load, growth, residual, whether it left the road)."""
    load, residual, left = np.empty(steps), 0.0, False
    for k, instant in enumerate(instants):
        load[k] = instant.force.sum()
        residual = max(residual, instant.residual)
        left |= instant.active == 0
    tenth = max(steps // 10, 1)
    first = load[tenth : 2 * tenth].std()
    growth = load[-tenth:].std() / first if first > 0 else 0.0
    ended = "whole" if np.isfinite(load).all() else "NaN"
    return [steps, ended, float(load.max()), float(growth), residual, left]


def _one_mode() -> list:
    """One mode, one point."""
    patch = oval_patch((3, 3), (0.05, 0.06), 500.0)
    middle = np.array([4])
    small = replace(patch, **{
        name: getattr(patch, name)[middle]
        for name in ("index", "points", "half_sizes", "force", "gap", "edge", "line")
    })  # fmt: skip
    tire = Recursion(Strip().response(small.points, 0, 1), 1e-4, "linear", MPI.COMM_SELF)
    solver = ActiveSet(tire.same_step + winkler_compliance(small.area, 1e8))
    drive = Drive(Flat().height, lambda t: 5e-3 * np.sin(300 * t), 0.0)
    return ["one mode, one point", *_followed(roll(tire, solver, small, drive, 1e-4, 2000), 2000)]


def _many_points() -> list:
    """20,000 points carried by the 63 nodes, from rest onto waves."""
    from scipy import sparse

    fine = oval_patch((200, 100), (0.6e-3, 1.2e-3), 500.0)
    away = ((fine.points[:, None, :2] - PATCH.points[None, :, :2]) ** 2).sum(axis=-1)
    weights = np.exp(-away / 2e-4)
    weights = sparse.csr_matrix(np.where(weights > 1e-3, weights, 0.0))
    weights = sparse.diags(1 / weights.sum(axis=1).A1) @ weights
    places = GridPlaces((200, 100), (0.6e-3, 1.2e-3), np.arange(20_000))
    kernel = KernelTread(places, lambda *where: half_space_influence(*where, 5e6, 0.45))
    response = Strip(speed=20.0).response(PATCH.points, 6, 3, residual=5)
    tire = Recursion(response, 1e-4, "linear", MPI.COMM_SELF)
    solver = ProjectedCG(SpreadCompliance(tire.same_step, weights.tocsr(), kernel))
    drive = Drive(lambda x, y: 0.1 * wavy(x, y), lambda t: 0.0, 20.0)
    instants = roll(OnPoints(tire, weights.tocsr()), solver, fine, drive, 1e-4, 100)
    return ["20,000 points", *_followed(instants, 100)]
