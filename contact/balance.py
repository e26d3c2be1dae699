"""The energy balance of a run, an indicator of how well its steps resolve it."""

from __future__ import annotations

import numpy as np

from tireroad.contact.energy import stored
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes, pencil


def own_states(response: Response, rolling: RollingModes) -> bool:
    """Whether the response moves in the modes' own states: of residual dynamics and attachment modes the
    coordinates are not known here."""
    states = rolling.states
    return np.array_equal(response.eigenvalue, states.eigenvalue) and len(response.block) == len(
        states.block
    )


def energy_left(rolling: RollingModes, kept: dict[str, np.ndarray], slow: np.ndarray) -> float:
    """Energy (J) of the states of a tire's snapshot; `slow` (q,) marks the modes that it holds."""
    states, state = rolling.states, kept["state"]
    right = states.right[:, slow]
    coordinates = (right @ state).real + states.block_right @ kept["block_state"]
    rates = (right @ (states.eigenvalue[slow] * state + kept["push"])).real
    rates += states.block_right @ (states.block @ kept["block_state"])
    _, stiffness = pencil(rolling.basis.projection, rolling.turning)
    return stored(coordinates, rates, stiffness)
