"""Running figures of the contact loop, block of steps by block of steps."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tireroad.contact.energy import Work
from tireroad.contact.patch import Patch


@dataclass
class Figures:
    """What a checkpoint keeps as single numbers: N, the complementarity residual, m."""

    steps: int = 0
    sum: float = 0.0
    residual: float = 0.0
    penetration: float = 0.0
    least: float = np.inf
    most: float = -np.inf
    most_active: int = 0


@dataclass
class Totals:
    """Figures and work of the steps so far, whose points at the edge are watched (`reach` in m)."""

    patch: Patch
    reach: float
    figures: Figures = field(default_factory=Figures)
    work: Work = field(default_factory=Work)

    def add(self, steps: dict[str, np.ndarray]) -> None:
        """Count a block as `ContactFile.flush` hands it over. ConvergenceError at a touching edge."""
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
        )

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        return {n: np.array(v) for n, v in vars(self.figures).items()} | self.work.state()

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.figures = Figures(**{name: kept[name].item() for name in vars(self.figures)})
        self.work.set_state(kept)
