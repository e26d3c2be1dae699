"""Modes of a small tire at the limits: double roots, beyond critical speed, damping, buckling."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import Loader
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.modal.basis import Projection, project
from tireroad.modal.campbell import critical_speed, growth, onset
from tireroad.modal.rotating import checks, matrices, rotating
from tireroad.modal.solver import undamped
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.standing import sites
from tireroad.runs.measure.torus import thesis_torus

COUNT = 120
DAMPING = (0.0, 500.0, 5e3, 1e5)  # gamma1, 1/s
SPEEDS = (0.0, 0.3, 0.999, 1.3)  # of the critical speed


def rows() -> list[list]:
    """(package, case, result, how it was caught)."""
    section = thesis_torus(segments=8, elements_arc=4)
    body = Body(
        MPI.COMM_SELF,
        section,
        compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45),
    )
    loader = Loader(Equilibrium(body), lambda progress: None)
    loader.inflate(2e5)
    found = [_double(Operators(body, 2e5)), _negative(body)]
    loader.deflect(0.003)
    operators = Operators(body, 2e5)
    modes = _modes(operators)
    projection = project(modes, operators.rotation(), operators.carried, MPI.COMM_SELF)
    found += [_damped(projection, gamma) for gamma in DAMPING]
    found.append(_past_critical(projection))
    return [["modal", *row] for row in found]


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
