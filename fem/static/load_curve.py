"""Load over deflection: the road raised in steps, the footprint read at each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.loading import Loader
from tireroad.fem.static.state import static_state


@dataclass(frozen=True)
class CurvePoint:
    """The tire at one `deflection` (m): `load` N, `stiffness` N/m the tangent there, with the same points
    touching (at the edge of the contact the force is zero, so others change nothing of first order);
    `footprint`, `points` in contact, effective `rolling_radius` m.
    """

    deflection: float
    load: float
    stiffness: float
    footprint: Footprint
    points: int
    rolling_radius: float

    @property
    def pressure(self) -> float:
        """Mean contact pressure, Pa."""
        return self.load / self.footprint.area if self.footprint.area else 0.0


def load_curve(loader: Loader, deflections: Sequence[float]) -> list[CurvePoint]:
    """The states at ascending deflections (m) of an inflated tire. Collective.

    Each step starts from a line through the two states before it; ConvergenceError where one does not
    converge by halved steps either.
    """
    return [_point(loader, deflection) for deflection in loader.visit(deflections)]


def _point(loader: Loader, deflection: float) -> CurvePoint:
    state = static_state(loader.equilibrium, loader.touch)
    return CurvePoint(
        deflection,
        state.load,
        loader.equilibrium.road_stiffness(),
        state.footprint(),
        int((state.force > 0).sum()),
        state.rolling_radius(),
    )
