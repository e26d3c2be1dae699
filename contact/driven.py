"""Prescribed forces on a tire in contact: one tire, one loop.

The tire's inputs are the contact forces, then the k prescribed ones. Its outputs are the
displacements of the contact, then that of each prescribed force along itself, then the readings.
"""

from __future__ import annotations

import numpy as np

from tireroad.contact.rolling import Tire, looking_ahead
from tireroad.greens.recursion import LoadedColumns, ahead_of_mean


class Driven:
    """The tire as the contact sees it, including its motion under prescribed forces.

    `history` (n + 1, k) N at the steps from t = 0 on; `directions` (k, 3) of unit length. After
    each `advance`: `reading` (r,) m; `work` (J) of the prescribed forces so far (trapezoidal rule);
    `lead`, the additional work of the mean forces that the `scheme` applies during the steps
    (greens.one_step.ahead_of_mean).
    """

    def __init__(
        self, tire: Tire, history: np.ndarray, directions: np.ndarray, scheme: str = "linear"
    ) -> None:
        self._tire, self._history, self._directions = tire, history, directions
        self._forced = history.shape[1] > 0
        self._count = tire.same_step.shape[1] - history.shape[1]
        self._same = tire.same_step
        self.same_step, self.comm = self._same[: self._count, : self._count], tire.comm
        self.ahead = looking_ahead(tire)
        self._beside = LoadedColumns(self._same[self._count :])
        # The force that `history` begins with was there before.
        self._ahead = ahead_of_mean(scheme, np.concatenate([history[:1], history]))
        self._step = 0
        self._along = np.zeros(history.shape[1])
        self.work = self.lead = 0.0
        tire.start(np.concatenate([np.zeros(self._count), history[0]]))

    def predict(self) -> np.ndarray:
        """Displacement (c,) m at the end of the step without new contact forces. Collective."""
        self._step += 1
        self._free = self._tire.predict()
        if not self._forced:
            return self._free[: self._count]
        pushed = self._same[: self._count, self._count :] @ self._history[self._step]
        return self._free[: self._count] + pushed

    def advance(self, force: np.ndarray) -> None:
        """Set the contact forces (c,) N at the end of the step."""
        if not self._forced:
            self._tire.advance(force)
            self.reading = self._free[self._count :] + self._beside @ force
            return
        before, now = self._history[self._step - 1], self._history[self._step]
        acting = np.concatenate([force, now])
        self._tire.advance(acting)
        moved = self._free[self._count :] + self._beside @ acting
        along, self.reading = np.split(moved, [len(now)])
        self.work += float(0.5 * (before + now) @ (along - self._along))
        self.lead += float(self._ahead[self._step - 1] @ (along - self._along))
        self._along = along

    def inertia_force(self) -> np.ndarray:
        """What axle and contact balance (3,), N: rate of momentum less prescribed forces."""
        rate = self._tire.inertia_force()
        return rate - self._history[self._step] @ self._directions if self._forced else rate

    def snapshot(self) -> dict[str, np.ndarray]:
        """The tire's snapshot and that of the prescribed forces. Collective if the tire's is."""
        own = {
            "driven_step": self._step,
            "driven_along": self._along,
            "driven_work": [self.work, self.lead],
        }
        return self._tire.snapshot() | {name: np.array(value) for name, value in own.items()}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot."""
        self._step, (self.work, self.lead) = int(kept["driven_step"]), kept["driven_work"].tolist()
        self._along = kept["driven_along"]
        self._tire.restore(kept)
