"""What companion runs may cost: the steps that they repeat, and the points that may touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.contact.grid_patch import MOST, finer_touching
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.companions.given import Given

SHARE = 0.33  # of the run's own cost: budget of all companion runs together
_FEWEST, _PERIODS = 64, 2  # least steps after the run-in, and periods of `up_to`, to repeat
# Cost of five companion runs in time loops per repeated step, by the spacing of that of the points.
_LOOPS = {2.0: 3.5, 0.5: 6.0}
_COARSE = 0.14  # cost on elements of twice the size, as a share of the run's cost before the loop
# Cost of a step per touching point, from `MOST` of them on: conjugate gradients (radial tire on
# cobblestones, 1,840 points: 84 ms).
_TOUCHING = 5e-5


def least_steps(step: float, up_to: float) -> int:
    """Fewest steps of `step` s after the run-in, for histories compared up to `up_to` Hz."""
    return max(_FEWEST, int(np.ceil(_PERIODS / (up_to * step))))


@dataclass(frozen=True)
class Budget:
    """Cost of a run in operations (scene.extent.estimate): `before` its loop, and per step of it.

    `steps`: of its loop.
    """

    before: float
    loop: float
    steps: int

    @classmethod
    def of(cls, scene: Scene, steps: int) -> Budget:
        """Of a scene that takes so many steps."""
        work = estimate(scene).work
        loop = work["contact loop"]
        return cls(sum(work.values()) - loop, loop / steps, steps)

    @property
    def _whole(self) -> float:
        return SHARE * (self.before + self.loop * self.steps)

    def most_touching(self, least: int) -> float:
        """Touching points that the companion of the points may have, repeating `least` steps.

        As many as take half the budget of all companions, with twice the time step.
        """
        return max(MOST, self._whole / (_TOUCHING * least))

    def window(self, least: int, given: Given) -> int:
        """Last step of companion runs: `least`, more as far as the budget goes; even."""
        spacing = given.points_ratio
        each = _LOOPS[spacing] * self.loop
        if spacing < 1 and (finer := finer_touching(given.settled.patch)) > MOST:
            each += _TOUCHING * finer / 2
        count = round((self._whole - _COARSE * self.before) / each)
        count = int(np.clip(count, min(least, self.steps), self.steps))
        return count - count % 2
