"""Static states at and beyond the limits: each converges, or stops with reason and last state."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import Loader
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.runs.measure.torus import thesis_torus

BALANCED = 1e-9  # residual of an equilibrium, relative to the force scale


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
class Ended:
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


def result(asked: Attempt) -> Ended:
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
    loader = Loader(equilibrium, lambda progress: None)
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
    return Ended(state, message, again.residual, again.iterations)


def rows() -> list[list]:
    """(package, case, result, how it was caught) for every attempt."""
    return [["fem", asked.name, *outcome(result(asked))] for asked in attempts()]


def outcome(ended: Ended) -> tuple[str, str]:
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
