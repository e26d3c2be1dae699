"""Choice of the integration scheme on soft and stiff treads, against finer time steps."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.spectra import BAND, distance
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.validation.full_elements import FullHistory, digits, follow
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Tires
from tireroad.tests.validation.rolling import ROADS, SCENE

ABOUT = (
    "the scheme chosen on treads of 10 and 340 MPa, against a finer step, and what the others give"
)

MESH = {"segments": 24, "elements_arc": 8, "modes": 100}
TREADS = (1e7, 3.4e8)  # Pa
RESIDUALS = ("none", "static", "attachment")
STEPS = (4e-4, 2e-4, 1e-4, 5e-5)  # s
FINEST = 6.25e-6  # s
SCHEMES = ("linear", "damped", "constant")
ROAD = "cobblestones, joints of 0.5 mm"


def run() -> list[Table]:
    """One table of all treads, residuals and steps."""
    return tables(MESH, RESIDUALS, STEPS, FINEST)


def tables(mesh: dict[str, int], residuals, steps, finest: float) -> list[Table]:
    """`finest`: time step (s) of the reference, whose forces are linear over the step."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        tires = None
        for tread in TREADS:
            scene = SCENE.format(road=ROADS[ROAD], friction=0.0, **mesh)
            scene = scene.replace("youngs_modulus = 1e7", f"youngs_modulus = {tread:g}")
            tires = tires or Tires(scene, Path(folder))
            tires.change(scene)
            for residual in residuals:
                response = tires.response(mesh["modes"], residual)
                exact = _follow(tires, response, finest, "linear")
                rows += [_row(tires, response, exact, tread, residual, step) for step in steps]
    columns = [("tread", "MPa"), ("residual", ""), ("step", "s"), ("steps an oscillation", "-"),
               ("chosen", ""), ("its error", "%"), ("linear", "%"), ("damped", "%"), ("constant", "%")]  # fmt: skip
    notes = [
        f"Rolling over {ROAD}, points at the nodes, {mesh['modes']} modes. Errors: contact force, relative L2 "
        f"of what varies up to {BAND:g} Hz, against forces linear over steps of {finest:g} s. Steps an "
        "oscillation: of the fastest one that the points touching at rest can make. A tread of 340 MPa on "
        "tires without residual, or whose attachment modes move, bounces on its own at several kHz: damped and "
        "constant forces take that away, and are compared with a run that has it.",
    ]
    return [Table("Forces linear, damped or constant over the step", columns, rows, notes)]


def _follow(tires: Tires, response: Response, step: float, scheme: str) -> FullHistory | None:
    """The history; None if the motion grew without bound."""
    tire = Recursion(
        response=response.resolved(step), step=step, scheme=scheme, comm=tires.job.comm
    )
    try:
        return follow(tires.trial, tire, step, 0.0)
    except ConvergenceError:
        return None


def _row(tires: Tires, response: Response, exact: FullHistory, tread, residual, step) -> list:
    trial = tires.trial
    count = oscillation(trial.spec, trial.setup.patch, response.resolved(step), step)
    off = {
        scheme: _off(trial.duration, exact, _follow(tires, response, step, scheme))
        for scheme in SCHEMES
    }
    chosen = choose(count).scheme
    shown = digits(count) if math.isfinite(count) else "none"
    return [tread / 1e6, residual, step, shown, chosen, off[chosen], *off.values()]


def _off(duration: float, exact: FullHistory, history: FullHistory | None) -> float | str:
    if history is None:
        return "unbounded"
    one, other = exact.values["contact force"], history.values["contact force"]
    return digits(100 * distance(one, other, duration).mean)
