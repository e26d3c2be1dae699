"""The energy balance of a run, which indicates how well its steps resolve it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.contact.results.energy import Dissipation, stored
from tireroad.greens.response import Response
from tireroad.modal.damping import rates
from tireroad.modal.rolling import RollingModes, pencil


def own_states(response: Response, rolling: RollingModes) -> bool:
    """Whether the response consists of the modes' own states.

    With residual states, attachment modes or states of the full matrices, the modal coordinates are
    not known here.
    """
    if rolling.full:
        return False
    states = rolling.states
    return np.array_equal(response.eigenvalue, states.eigenvalue) and len(response.block) == len(
        states.block
    )


def springs(response: Response, force: np.ndarray) -> float:
    """Elastic energy (J) in the residual flexibility, with static states, at forces (k,) N.

    The first k outputs are the forces' own displacements; readings may follow them
    (contact.driven).
    """
    if response.pulse:
        return 0.0
    return float(0.5 * force @ response.residual[: len(force)] @ force)


class Motion:
    """Modal coordinates and rates from the states of a time loop, and their dissipation.

    For a tire that rolls on its own states only, without air, corner and nearly defective block.
    """

    def __init__(self, rolling: RollingModes, slow: np.ndarray, step: float) -> None:
        states, projection, turning = rolling.states, rolling.basis.projection, rolling.turning
        right = states.right[:, slow]
        self._real, self._imaginary = right.real.copy(), right.imag.copy()
        self._eigenvalue = states.eigenvalue[slow][:, None]
        damping = rates(turning.damping, projection)
        _, _, body = projection.rotating(turning.inertia)
        self.losses = Dissipation(damping, turning.speed * body, step)

    @staticmethod
    def known(rolling: RollingModes, response: Response) -> bool:
        """Whether the dissipation of these states can be computed."""
        projection = rolling.basis.projection
        plain = not rolling.full and projection.air is None and not projection.moves
        moving = rolling.turning.speed > 0 and not len(response.block)
        return plain and moving and own_states(response, rolling)

    def add(self, states: np.ndarray, pushes: np.ndarray) -> None:
        """Count n steps: all states and pushes (n, q) at their ends."""
        z = states.T
        self.losses.add(self._coordinates(z), self._coordinates(self._eigenvalue * z + pushes.T))

    def _coordinates(self, z: np.ndarray) -> np.ndarray:
        return self._real @ z.real - self._imaginary @ z.imag


def energy_left(rolling: RollingModes, kept: dict[str, np.ndarray], slow: np.ndarray) -> float:
    """Energy (J) of the states in a tire's snapshot; `slow` (q,) marks the modes it contains."""
    states, state = rolling.states, kept["state"]
    right = states.right[:, slow]
    coordinates = (right @ state).real + states.block_right @ kept["block_state"]
    rates = (right @ (states.eigenvalue[slow] * state + kept["push"])).real
    rates += states.block_right @ (states.block @ kept["block_state"])
    # Damping's contribution to the rolling stiffness stores nothing: it is work of the drive.
    _, stiffness = pencil(rolling.basis.projection, replace(rolling.turning, damping=(0.0, 0.0)))
    return stored(coordinates, rates, stiffness)
