"""Static state of a tire in one call: inflate it and press it on the road."""

from __future__ import annotations

import math
from collections.abc import Callable

from tireroad.fem.errors import InputError
from tireroad.fem.model import TireModel
from tireroad.fem.static.curved.shape import FLAT, RoadShape
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction.press import Friction, with_friction
from tireroad.fem.static.path.loading import Loader, Progress
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
    loader = Loader(Equilibrium(tire.body, rolling, road), report)
    loader.inflate(inflation)
    loader = place(loader, load, deflection, road_height, friction)
    return static_state(loader.equilibrium, loader.touch)


def place(
    loader: Loader,
    load: float | None,
    deflection: float | None,
    road_height: float | None,
    friction: Friction | None = None,
) -> Loader:
    """Press the inflated tire on the road as in `press`; load and deflection along its normal.

    Returns the loader of the state found, which is another one with friction. Collective.
    """
    given = {"load": load, "deflection": deflection, "road_height": road_height}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"{' and '.join(named)} each set the height of the road: give one of them")
    for name, value in given.items():
        if value is not None and not math.isfinite(value):
            raise InputError(f"{name} = {value:g} must be finite")
    inflated = loader.body.u.x.array.copy()
    if load is not None:
        loader.carry(load * loader.equilibrium.shape.upright)
    elif deflection is not None:
        loader.deflect(deflection / loader.equilibrium.shape.upright)
    elif road_height is not None:
        loader.deflect(road_height - loader.touch)
    if friction is None or not named or not loader.load():
        return loader
    return with_friction(loader, inflated, load, friction)
