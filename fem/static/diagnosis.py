"""Why a rolling tire has no static state: too high a speed, or too high a load."""

from __future__ import annotations

from collections.abc import Callable

from tireroad.fem.errors import ConvergenceError, LoadingStopped
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import Loader
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body


def with_cause(
    error: ConvergenceError, loader: Loader, rolling: Rolling, press: Callable[[Loader], object]
) -> ConvergenceError:
    """The error, with the cause added if that is the speed of rotation. Collective.

    `press` inflates and loads a tire. It is repeated at rest on a separate body; if that converges,
    the speed is the cause. Takes no longer than the state at rest.
    """
    if rolling.speed == 0 or not isinstance(error, LoadingStopped):
        return error
    old = loader.body
    body = Body(old.comm, old.ring, old.materials, cords=old.plies.cords)
    try:
        press(Loader(Equilibrium(body, AT_REST), lambda progress: None))
    except ConvergenceError:
        return error
    return ConvergenceError(
        f"{error.fact}. At rest the same tire converges, so its speed is the cause: "
        f"rotation.speed = {rolling.speed:g} rad/s lies beyond the critical speed, up to which it has a "
        "steady rolling shape. Lower the speed, raise the inflation or stiffen the material; "
        "static.steady_rolling = false takes the shape at rest, whose rotating stage reports the critical "
        "speed."
    )
