"""The energy balance of a run, an indicator of how well its steps resolve it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.contact.results.energy import Dissipation, stored
from tireroad.greens.response import Response
from tireroad.modal.damping import rates
from tireroad.modal.rolling import RollingModes, pencil


def own_states(response: Response, rolling: RollingModes) -> bool:
    """Whether the response moves in the modes' own states: of residual dynamics, attachment modes and the
    states of the full matrices the coordinates in the modes are not known here."""
    if rolling.full:
        return False
    states = rolling.states
    return np.array_equal(response.eigenvalue, states.eigenvalue) and len(response.block) == len(
        states.block
    )


def springs(response: Response, force: np.ndarray) -> float:
    """Elastic energy (J) in the residual flexibility under forces (k,) N, that of states made static in it.

    The first k outputs are the forces' own displacements; readings may follow them (contact.driven).
    """
    if response.pulse:
        return 0.0
    return float(0.5 * force @ response.residual[: len(force)] @ force)


class Motion:
    """Coordinates and rates of the modes from the states of a time loop, and what they lose.

    Of a tire that rolls on its own states alone, without air, corner and near-defective block.
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
        """Whether the losses of these states can be told."""
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
    """Energy (J) of the states of a tire's snapshot; `slow` (q,) marks the modes that it holds."""
    states, state = rolling.states, kept["state"]
    right = states.right[:, slow]
    coordinates = (right @ state).real + states.block_right @ kept["block_state"]
    rates = (right @ (states.eigenvalue[slow] * state + kept["push"])).real
    rates += states.block_right @ (states.block @ kept["block_state"])
    # What damping adds to the rolling shape's stiffness stores nothing: it is the drive's work.
    _, stiffness = pencil(rolling.basis.projection, replace(rolling.turning, damping=(0.0, 0.0)))
    return stored(coordinates, rates, stiffness)
