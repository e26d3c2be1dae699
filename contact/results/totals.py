"""Running results of the contact loop, updated by blocks of steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tireroad.contact.patch import LEAST_REACH, Patch
from tireroad.contact.results.chatter import Alternation, Chatter
from tireroad.contact.results.energy import Work

# Times the patch's reach, or the smallest default reach: a scene may give one that is far smaller
# than what the tire moves.
RUNAWAY = 100.0


@dataclass
class Figures:
    """The scalars that a checkpoint keeps: N, the complementarity residual, m.

    `excursion`: the largest displacement of a contact point from the static state relative to the
    wheel.
    """

    steps: int = 0
    sum: float = 0.0
    residual: float = 0.0
    penetration: float = 0.0
    least: float = np.inf
    most: float = -np.inf
    most_active: int = 0
    excursion: float = 0.0


@dataclass
class Totals:
    """Results and work of the steps so far, with checks of the contact.

    Points at the edge of the `patch` must not touch (`reach` in m), and at most the share `limit`
    of the points may alternate. `work` is that of the loop's own scheme.
    """

    patch: Patch
    reach: float
    limit: float = np.inf
    figures: Figures = field(default_factory=Figures)
    work: Work = field(default_factory=Work)
    alternation: Alternation = field(default_factory=Alternation)

    def add(self, steps: dict[str, np.ndarray]) -> None:
        """Count a block as `ContactFile.flush` passes it.

        ConvergenceError if an edge point touches; Chatter if the motion grows without bound, or if
        more points than `limit` open and close from step to step.
        """
        self.alternation.add(steps["normal_force"])
        self.alternation.check(self.limit)
        self._check_bounded(steps)
        self.patch.check_edge(steps["normal_force"], steps["time"], self.reach)
        self.work.add(steps["change"], steps["moved"])
        old, load = self.figures, steps["total_force"][:, 2]
        self.figures = Figures(
            steps=old.steps + len(load),
            # Step by step: the same bits however steps are blocked.
            sum=float(np.cumsum([old.sum, *load])[-1]),
            residual=max(old.residual, float(steps["residual"].max())),
            penetration=max(old.penetration, float(steps["penetration"].max())),
            least=min(old.least, float(load.min())),
            most=max(old.most, float(load.max())),
            most_active=max(old.most_active, int(steps["active"].max())),
            excursion=max(old.excursion, float(np.abs(self._beside_wheel(steps)).max(initial=0.0))),
        )

    def finish(self) -> None:
        """After the last step; raises Chatter as in `add`."""
        self.alternation.finish()
        self.alternation.check(self.limit)

    def _beside_wheel(self, steps: dict[str, np.ndarray]) -> np.ndarray:
        """Displacements (n, c) m, less the wheel's height, of the points that touch at rest."""
        touching = self.patch.force > 0
        return steps["displacement"][:, touching] - steps.get("wheel_height", np.zeros(1))[:, None]

    def _check_bounded(self, steps: dict[str, np.ndarray]) -> None:
        """Raise Chatter if a point moved by much more than the road could move it."""
        far = np.abs(steps["displacement"]).max(axis=1)
        bound = RUNAWAY * max(self.reach, LEAST_REACH)
        when = np.flatnonzero(~(far <= bound))
        if len(when):
            raise Chatter(
                f"contact: at t = {steps['time'][when[0]]:.6g} s a contact point of the tire has moved by "
                f"{far[when[0]]:.3g} m, more than {bound:.3g} m: the motion grows without bound. Take a smaller "
                'time.step, or time.scheme = "constant" or "auto"'
            )

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {n: np.array(v) for n, v in vars(self.figures).items()} | (
            self.work.state() | self.alternation.state()
        )

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.figures = Figures(**{name: kept[name].item() for name in vars(self.figures)})
        self.work.set_state(kept)
        self.alternation.set_state(kept)
