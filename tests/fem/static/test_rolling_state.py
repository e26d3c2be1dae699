"""The static state of a rolling tire, with either inertia, against the pencil of the small motions."""

import numpy as np
import pytest

from tireroad.fem.matrices.compliance import on_own_rows, rotating_stiffness, solve_all
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state
from tireroad.fem.static.virtual_work import Rolling

SPEED, DAMPING, INFLATION = 60.0, 300.0, 2e5


@pytest.mark.slow
@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_a_little_more_load_moves_it_as_the_rotating_stiffness_says(make_body, inertia) -> None:
    """du = K_Omega^-1 df between two states a thousandth of the deflection apart; with the other
    inertia's K_Omega it is off twenty times as far: the state and its small motions are of one model."""
    body = make_body(segments=16)
    equilibrium = Equilibrium(
        body, Rolling(speed=SPEED, damping=DAMPING, stiffness_damping=0.0, inertia=inertia)
    )
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(INFLATION)
    loader.deflect(0.006)
    before = static_state(equilibrium, loader.touch)
    operators = Operators(body, INFLATION)
    rotation = operators.rotation()
    loader.deflect(0.006 * 1.001)
    after = static_state(equilibrium, loader.touch)
    changed = np.flatnonzero((before.force > 0) | (after.force > 0))
    loads = on_own_rows(operators, nodes(changed, len(before.points), 2))
    force = (after.force - before.force)[changed]
    off = {}
    for pencil in ("full", "doppler"):
        stiffness = rotating_stiffness(operators, rotation, SPEED, (DAMPING, 0.0), pencil)
        moved = operators.trace(solve_all(stiffness, loads) @ force[:, None]).reshape(-1, 3)
        found = after.moved - before.moved
        off[pencil] = np.linalg.norm(moved - found) / np.linalg.norm(found)
    other = "doppler" if inertia == "full" else "full"
    assert off[inertia] < 2e-3
    assert off[other] > 20 * off[inertia]


@pytest.mark.slow
def test_without_centrifugal_forces_a_round_tire_does_not_grow(make_body) -> None:
    """The body rate of an axisymmetric shape vanishes: the doppler state of the inflated tire is the
    one at rest, to what the elements round of a circle; with the full inertia its crown moves out."""
    crown = {}
    for name, rolling in {
        "rest": Rolling(),
        "doppler": Rolling(speed=150.0, damping=500.0, stiffness_damping=0.0, inertia="doppler"),
        "full": Rolling(speed=150.0, damping=500.0),
    }.items():
        equilibrium = Equilibrium(make_body(segments=24), rolling)
        loader = LoadStepper(equilibrium, lambda progress: None)
        loader.inflate(INFLATION)
        crown[name] = -loader.touch
    grown = crown["full"] - crown["rest"]
    assert grown > 1e-3
    assert abs(crown["doppler"] - crown["rest"]) < 1e-3 * grown
