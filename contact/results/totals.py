"""Running figures of the contact loop, block of steps by block of steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tireroad.contact.results.chatter import Alternation, Chatter
from tireroad.contact.results.energy import Work
from tireroad.contact.patch import Patch

RUNAWAY = 100.0  # times the patch's reach: half a metre at least


@dataclass
class Figures:
    """What a checkpoint keeps as single numbers: N, the complementarity residual, m; `excursion`, how far a point of
    contact moved beyond the static state, as the wheel sees it."""

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
    """Figures and work of the steps so far, whose points at the edge are watched (`reach` in m), and, where
    more than the share `limit` of them that alternate is to end the loop, how they do."""

    patch: Patch
    reach: float
    limit: float = np.inf
    figures: Figures = field(default_factory=Figures)
    work: Work = field(default_factory=Work)
    alternation: Alternation = field(default_factory=Alternation)

    def add(self, steps: dict[str, np.ndarray]) -> None:
        """Count a block as `ContactFile.flush` hands it over. ConvergenceError at a touching edge, Chatter where
        the motion grows without bound, or more points than `limit` open and close from step to step.
        """
        self.alternation.add(steps["normal_force"])
        self.alternation.check(self.limit)
        self._check_bounded(steps)
        self.patch.check_edge(steps["normal_force"], steps["time"], self.reach)
        self.work.add(steps["change"], steps["moved"])
        old, load = self.figures, steps["total_force"][:, 2]
        self.figures = Figures(
            steps=old.steps + len(load),
            # One step after the other: the same bits however the steps are blocked.
            sum=float(np.cumsum([old.sum, *load])[-1]),
            residual=max(old.residual, float(steps["residual"].max())),
            penetration=max(old.penetration, float(steps["penetration"].max())),
            least=min(old.least, float(load.min())),
            most=max(old.most, float(load.max())),
            most_active=max(old.most_active, int(steps["active"].max())),
            excursion=max(old.excursion, float(np.abs(self._beside_wheel(steps)).max())),
        )

    def finish(self) -> None:
        """After the last step: Chatter as in `add`."""
        self.alternation.finish()
        self.alternation.check(self.limit)

    def _beside_wheel(self, steps: dict[str, np.ndarray]) -> np.ndarray:
        """Displacements (n, c) m of the points less the wheel's height, of those that touch at rest."""
        touching = self.patch.force > 0
        return steps["displacement"][:, touching] - steps.get("wheel_height", np.zeros(1))[:, None]

    def _check_bounded(self, steps: dict[str, np.ndarray]) -> None:
        """Chatter where a point moved by much more than the road could move it."""
        far = np.abs(steps["displacement"]).max(axis=1)
        when = np.flatnonzero(~(far <= RUNAWAY * self.reach))
        if len(when):
            raise Chatter(
                f"contact: at t = {steps['time'][when[0]]:.6g} s a contact point of the tire has moved by "
                f"{far[when[0]]:.3g} m, {RUNAWAY:g} times the gap within which points take part: the motion grows "
                'without bound. Take a smaller time.step, or time.scheme = "constant" or "auto"'
            )

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        return {n: np.array(v) for n, v in vars(self.figures).items()} | (
            self.work.state() | self.alternation.state()
        )

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.figures = Figures(**{name: kept[name].item() for name in vars(self.figures)})
        self.work.set_state(kept)
        self.alternation.set_state(kept)
