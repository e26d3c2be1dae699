"""A tire inflated and pressed on the road in one call: its static state, its load-deflection curve."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from tireroad.fem.errors import InputError
from tireroad.fem.model import TireModel
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.friction_press import Friction, with_friction
from tireroad.fem.static.load_steps import LoadStepper, Progress
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.virtual_work import AT_REST, Rolling


def press(
    tire: TireModel,
    *,
    inflation: float,
    load: float | None = None,
    deflection: float | None = None,
    road_height: float | None = None,
    rolling: Rolling = AT_REST,
    road: RoadShape = FLAT,
    friction: Friction | None = None,
    report: Callable[[Progress], None] = lambda progress: None,
) -> StaticState:
    """Static state of the tire inflated to `inflation` (Pa) and pressed on a `road`.

    At most one of `load` N on the road, `deflection` m from first touch and `road_height` m, the
    road's z; none: no road. `rolling`: inertia and damping of steady rolling; `friction`: optional;
    `report` is called after every load step. Raises InputError for values out of range,
    ConvergenceError if no state is found. Collective.
    """
    if not (math.isfinite(inflation) and inflation >= 0.0):
        raise InputError(f"inflation = {inflation:g} Pa must be 0 or more, and finite")
    tire.body.u.x.array[:] = 0.0  # not that of an earlier press: the force scale is of this shape
    loader = LoadStepper(Equilibrium(tire.body, rolling, road), report)
    loader.inflate(inflation)
    loader = place(loader, load, deflection, road_height, friction)
    return static_state(loader.equilibrium, loader.touch)


@dataclass(frozen=True)
class InitialState:
    """A state on the road to start from, of the same body under almost the same loads.

    `inflated` and `pressed`: `u` of the body; `force` (nodes,) N of the road on own nodes, at
    `height` (m); None without a road.
    """

    inflated: np.ndarray
    pressed: np.ndarray
    force: np.ndarray
    height: float | None

    @classmethod
    def of(cls, loader: LoadStepper, pressed: LoadStepper) -> InitialState:
        """The present state of the body that `loader` inflated and `place` pressed."""
        equilibrium = pressed.equilibrium
        field = loader.body.u.x.array.copy()
        return cls(loader.inflated, field, equilibrium.contact_force(), equilibrium.road_height)

    def reaches(self, loader: LoadStepper, load: float | None, rise: float | None) -> bool:
        """Solve for the `load` (N) or the road's `rise` (m) from here; on failure False and the
        old state. Collective."""
        assert self.height is not None, "there is no road"
        equilibrium, field = loader.equilibrium, loader.body.u.x.array
        before = field.copy(), equilibrium.road.snapshot()
        field[:] = self.pressed
        equilibrium.road.take(self.force, self.height)
        step = equilibrium.solve(self.height if rise is None else loader.touch + rise, load)
        loader.newton_steps += step.iterations
        if step.converged:
            loader.tell("deflection", loader.deflection, "m", step)
        else:
            field[:] = before[0]
            equilibrium.road.restore(before[1])
        return step.converged


def place(
    loader: LoadStepper,
    load: float | None,
    deflection: float | None,
    road_height: float | None,
    friction: Friction | None = None,
    initial: InitialState | None = None,
) -> LoadStepper:
    """Press the inflated tire on the road as in `press`; load and deflection along its normal.

    Starts from the state `near`, if there is one and Newton's method converges from it. Returns the
    loader of the state found, which is another one with friction. Collective.
    """
    placed = {"load": load, "deflection": deflection, "road_height": road_height}
    named = [name for name, value in placed.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"{' and '.join(named)} each set the height of the road: give one of them")
    for name, value in placed.items():
        if value is not None and not math.isfinite(value):
            raise InputError(f"{name} = {value:g} must be finite")
    if not named:
        return loader
    upright, rise = loader.equilibrium.shape.upright, None
    if deflection is not None:
        rise = deflection / upright
    elif road_height is not None:
        rise = road_height - loader.touch
    carried = None if load is None else load * upright
    if initial is None or not initial.reaches(loader, carried, rise):
        _raise_road(loader, carried, rise)
    if friction is None or not loader.load():
        return loader
    return with_friction(loader, loader.inflated, load, friction)


def _raise_road(loader: LoadStepper, load: float | None, rise: float | None) -> None:
    """Raise the road from first touch until it carries `load` (N), or by `rise` (m). Collective."""
    if load is not None:
        loader.carry(load)
    elif rise is not None:
        loader.deflect(rise)


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
