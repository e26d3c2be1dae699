"""Friction added to a frictionless static state: along the load path, or in steady rolling.

Stick and slip under a standing tire depend on the load path: the inflated tire is pressed on the
road again in equal steps. Under a steadily rolling tire they do not: Newton's method starts from
the frictionless state, and the travel per radian at which a free-rolling wheel has no horizontal
force is found by the secant method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import root_scalar

from tireroad.fem.errors import ConvergenceError, LoadingStopped
from tireroad.fem.static.friction.balance import RubbingEquilibrium
from tireroad.fem.static.friction.sliding import Passing, Standing
from tireroad.fem.static.path.loading import Loader
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.path.stepping import Show
from tireroad.fem.static.state import static_state

_NEAR, _CLOSE = 1e-4, 1e-8  # of the travel: first offset tried, and tolerance of the secant method
_MOST = 40  # secant iterations
_ADVICE = (
    "Take a smaller static.friction or slip, smaller elements at the footprint (tire.footprint_size), or more "
    "static.friction_steps"
)


@dataclass(frozen=True, kw_only=True)
class Friction:
    """`coefficient` mu; `steps` in which a standing tire is pressed on the road. For a rolling
    tire: `slip` (s_x, s_y), > 0 driving and drifting towards +y, and `radius` (m), its travel per
    radian without slip; None: that at which no horizontal drag acts.
    """

    coefficient: float
    steps: int = 10
    radius: float | None = None
    slip: tuple[float, float] = (0.0, 0.0)


def with_friction(
    loader: Loader, inflated: np.ndarray, load: float | None, friction: Friction
) -> Loader:
    """The `loader`'s state on the road, with friction. Collective.

    `inflated`: `u` of the body before it met the road; `load` (N) of the road along its normal
    under the axle, None: its height is kept.
    """
    equilibrium = loader.equilibrium
    if load is not None:
        load *= equilibrium.shape.upright
    if equilibrium.rolling.speed:
        return _rolling(loader, load, friction)
    return _pressed(loader, inflated, load, friction)


def _on(
    loader: Loader, sliding: Standing | Passing, friction: Friction
) -> tuple[Loader, RubbingEquilibrium]:
    old = loader.equilibrium
    equilibrium = RubbingEquilibrium(loader.body, old.rolling, friction.coefficient, sliding)
    equilibrium.pressure.value = float(old.pressure.value)
    other = Loader(equilibrium, loader.report)
    other.begin_at(loader)
    return other, equilibrium


def _pressed(
    loader: Loader, inflated: np.ndarray, load: float | None, friction: Friction
) -> Loader:
    """Standing: each step slips relative to the last one; the last one carries the load."""
    deflection, body = loader.deflection, loader.body
    body.u.x.array[:] = inflated
    sliding = Standing(body, loader.equilibrium.shape)
    rubbing, _ = _on(loader, sliding, friction)
    size, done = deflection / friction.steps, 0.0

    def attempt(reached: float) -> Step:
        return rubbing.equilibrium.solve(rubbing.touch + reached)

    for number in range(1, friction.steps + 1):
        sliding.commit()
        further = deflection * number / friction.steps
        rubbing.march(attempt, further, size, Show("deflection with friction", 1.0, "m"), done)
        done = further
    if load is not None:
        _checked(rubbing, rubbing.equilibrium.solve(rubbing.touch + deflection, load))
    return rubbing


def _rolling(loader: Loader, load: float | None, friction: Friction) -> Loader:
    radius = friction.radius
    if radius is None:
        radius = static_state(loader.equilibrium, loader.touch).rolling_radius()
    sliding = Passing(loader.body, radius, shape=loader.equilibrium.shape)
    height, force = loader.equilibrium.road_height, loader.equilibrium.contact_force()
    rubbing, problem = _on(loader, sliding, friction)
    road = problem.road
    assert height is not None, "there is no road"
    road.take(force, height)

    def attempt(friction_so_far: float) -> Step:
        road.friction = friction_so_far
        return problem.solve(problem.road_height or height, load)

    def drag(trial: float) -> float:
        sliding.radius = trial
        _checked(rubbing, problem.solve(problem.road_height, load))
        return rubbing.body.comm.allreduce(road.forward())

    _march(rubbing, attempt, friction.coefficient, Show("static.friction", 1.0, ""))
    if friction.radius is None:
        sliding.radius = _free(drag, radius, rubbing.load())
    if any(friction.slip):

        def slide(part: float) -> Step:
            sliding.slip = part * friction.slip[0], part * friction.slip[1]
            return problem.solve(problem.road_height, load)

        size = float(np.hypot(*friction.slip))
        _march(rubbing, slide, 1.0, Show("slip with friction", size, ""))
    return rubbing


def _march(rubbing: Loader, attempt: Callable[[float], Step], end: float, show: Show) -> None:
    """From zero to `end` at once, or in as many steps as needed. Collective."""
    try:
        rubbing.march(attempt, end, end, show)
    except LoadingStopped as error:
        raise ConvergenceError(f"{error}. {_ADVICE}") from None


def _free(drag: Callable[[float], float], radius: float, load: float) -> float:
    """Travel per radian (m) at which `drag` (N) vanishes."""
    near = radius * (1 - _NEAR)
    found = root_scalar(
        drag, method="secant", x0=radius, x1=near, xtol=_CLOSE * radius, maxiter=_MOST
    )
    left = drag(found.root)
    if not (found.converged and abs(left) < 1e-4 * load):
        raise ConvergenceError(
            f"static: no free rolling with friction: at a travel of {found.root:.6g} m per radian {left:.3g} N of drag remain. "
            "Give rotation.rolling_radius (m), or a smaller static.friction"
        )
    return float(found.root)


def _checked(rubbing: Loader, step: Step) -> None:
    rubbing.newton_steps += step.iterations
    if not step.converged:
        raise ConvergenceError(
            f"static: no equilibrium with friction was found ({step.reason}). {_ADVICE}"
        )
    rubbing.tell("deflection with friction", rubbing.deflection, "m", step)
