"""Load-deflection curve: the road is raised in steps, with the footprint at each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.state import static_state


@dataclass(frozen=True)
class CurvePoint:
    """The tire at one `deflection` (m).

    `load` N; `tangent` N/m, stiffness with the present nodes in contact: between two nodes coming
    into contact it lags behind the slope of the curve, less so on finer meshes; `footprint`;
    `points` in contact; effective `rolling_radius` m.
    """

    deflection: float
    load: float
    tangent: float
    footprint: Footprint
    points: int
    rolling_radius: float

    @property
    def pressure(self) -> float:
        """Mean contact pressure, Pa."""
        return self.footprint.pressure(self.load)


def load_curve(loader: LoadStepper, deflections: Sequence[float]) -> list[CurvePoint]:
    """States at ascending deflections (m) of an inflated tire. Collective.

    Each step starts from a linear extrapolation of the two previous states. Raises ConvergenceError
    if a step does not converge even after halving.
    """
    upright = loader.equilibrium.shape.upright
    raised = loader.visit([deflection / upright for deflection in deflections])
    return [_point(loader, deflection * upright) for deflection in raised]


def slopes(deflection: np.ndarray, load: np.ndarray, at: np.ndarray) -> np.ndarray:
    """dF/d(deflection), N/m, at deflections `at` (k,) m, of a smooth curve from 0 through the
    points (n,)."""
    x, y = np.concatenate([[0.0], deflection]), np.concatenate([[0.0], load])
    if len(x) < 4:
        return np.interp(at, x, np.gradient(y, x))
    return CubicSpline(x, y)(at, 1)


def _point(loader: LoadStepper, deflection: float) -> CurvePoint:
    state = static_state(loader.equilibrium, loader.touch)
    return CurvePoint(
        deflection,
        state.load,
        loader.equilibrium.road_stiffness() / loader.equilibrium.shape.upright**2,
        state.footprint(),
        int((state.force > 0).sum()),
        state.rolling_radius(),
    )
