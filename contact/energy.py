"""Energy between road and tire: what came in, what is still there, and so what was lost."""

from __future__ import annotations

import numpy as np

from contact.rolling import Instant


class Work:
    """Work (J) of the changes of the contact forces on the tire, summed over the steps.

    Trapezoid: sum (f + f_before).(u - u_before)/2, second order in the step. `total` is what a
    checkpoint keeps with the last force and displacement.
    """

    def __init__(self) -> None:
        self.total = 0.0
        self._force = self._moved = np.zeros(1)

    def add(self, instant: Instant) -> None:
        """Count a step."""
        mean = 0.5 * (instant.change + self._force)
        self.total += float(mean @ (instant.moved - self._moved))
        self._force, self._moved = instant.change, instant.moved

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        return {
            "work": np.array(self.total),
            "work_force": self._force,
            "work_moved": self._moved,
        }

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.total = float(kept["work"])
        self._force, self._moved = kept["work_force"], kept["work_moved"]


def stored(coordinates: np.ndarray, rates: np.ndarray, stiffness: np.ndarray) -> float:
    """Energy (J) of modal coordinates (m,) and rates (m,): kinetic, and of `stiffness` (m, m) 1/s2.

    In the frame that does not rotate: with the tire turning, its symmetric part keeps what the
    inertia of the transport takes off.
    """
    return float(0.5 * rates @ rates + 0.5 * coordinates @ stiffness @ coordinates)
