"""Force versus sliding distance of the road under a tire with friction, up to full sliding.

Under a standing tire the road moves along or across by d at constant load; each step starts from
the stick and slip of the last. A rolling wheel is given slip instead, s_x = s (driving) or s_y = -s
(drifting to the right), at constant travel per radian; each state is steady. The force is that of
the road on the tire in the direction of motion; its limit is mu times the normal force.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError, LoadingStopped
from tireroad.fem.static.friction.balance import RubbingEquilibrium
from tireroad.fem.static.friction.sliding import Passing, Standing
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.path.stepping import Show, march
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.tire.body import Body

_NUDGE = 1e-5  # of the last point of a curve: step of the tangent's difference quotient


@dataclass(frozen=True)
class Slid:
    """State at `moved` (m of the road, or slip of a rolling wheel).

    `force` N in that direction; `tangent` N/m (rolling: N), its derivative with the stick and slip
    sets kept; `moment` N m of the road's forces about the vertical through the axle's centre;
    `sticks`: share of the load on sticking nodes."""

    moved: float
    force: float
    tangent: float
    moment: float
    sticks: float


class Slide:
    """Sliding from a `state` with friction, to which the body is set; `axis` 0 along the road, 1
    across it. All methods are collective."""

    def __init__(self, body: Body, state: StaticState, friction: float, axis: int) -> None:
        if state.pull is None or state.road_height is None:
            raise InputError("slide: a static state with friction on a road is needed")
        self._axis, self._height = axis, state.road_height
        self._load = state.load * state.road.upright
        rolls = state.travel is not None
        sliding = (
            Passing(body, state.travel, shape=state.road)
            if state.travel is not None
            else Standing(body, state.road)
        )
        self._sliding, self.rolls = sliding, rolls
        body.u.x.array[:] = 0.0  # the force scale is that of the undeformed body
        self.problem = RubbingEquilibrium(body, state.rolling, friction, sliding)
        self.problem.pressure.value = state.inflation
        body.set_displacement(state.displacement)
        face, force, pull = body.surface, np.zeros(body.nodes), np.zeros((body.nodes, 2))
        force[face.local], pull[face.local] = state.force[face.place], state.pull[face.place]
        self.problem.road.resume(force, pull, self._height)
        self._sliding.commit()

    def start(self, slip: tuple[float, float]) -> float:
        """Go to the start of the curve, where the wheel's slip along the axis is zero.

        Returns the slope of the force there, N/m, for a rolling wheel N. Raises ConvergenceError if
        the state is not recovered."""
        sliding, own = self._sliding, slip[self._axis]
        if isinstance(sliding, Passing):
            sliding.slip = slip
        step = self.problem.solve(self._height, self._load)
        if not step.converged:
            raise ConvergenceError(
                f"static: the state with friction is not found again ({step.reason})"
            )
        if own:
            shift = self._shift(own if self._axis == 0 else -own)
            self._to(1.0, 0.0, lambda part: shift(-part * own if self._axis == 0 else part * own))
        return self._rate(self._shift(0.0), 1e-6)

    def _shift(self, moved: float) -> Callable[[float], None]:
        """Function that sets the road to `more` beyond `moved`."""
        sliding, axis = self._sliding, self._axis

        def shift(more: float) -> None:
            value = moved + more
            if isinstance(sliding, Passing):
                along, across = sliding.slip
                sliding.slip = (value, across) if axis == 0 else (along, -value)
            else:
                sliding.place[axis] = value

        return shift

    def curve(self, ends: Sequence[float]) -> Iterator[Slid]:
        """The states at ascending `ends`. Raises ConvergenceError if no equilibrium is found."""
        done = 0.0
        for end in ends:
            self._to(end, done, self._shift(0.0))
            done = end
            yield self._found(end, _NUDGE * ends[-1])

    def _to(self, end: float, start: float, put: Callable[[float], None]) -> None:
        at, begins = start, True

        def attempt(target: float) -> Step:
            """Each part starts from the last stick and slip; new contacts have slid since then."""
            nonlocal at, begins
            if begins:
                self._sliding.commit()
            put(target)
            step = self.problem.solve(self.problem.road.height, self._load)
            begins = step.converged
            at = target if begins else at
            put(at)
            return step

        show = (
            Show("slip of the wheel", 1.0, "") if self.rolls else Show("way of the road", 1.0, "m")
        )
        try:
            march(attempt, start, end, end - start, show)
        except LoadingStopped as error:
            raise ConvergenceError(
                f"{error}. Take more stiffness.slide_steps, or smaller elements at the footprint (tire.footprint_size)"
            ) from None

    def _force(self) -> float:
        pull = self.problem.road.pull[:, self._axis].sum()
        return self.problem.body.comm.allreduce(float(pull))

    def _rate(self, shift: Callable[[float], None], size: float) -> float:
        before = self._force()
        shift(size)
        after = self.problem.nudged(self._load)[self._axis]
        shift(0.0)
        return (after - before) / size

    def _found(self, moved: float, size: float) -> Slid:
        state, road = static_state(self.problem, 0.0), self.problem.road
        pressing = road.pressing()
        sums = np.array([pressing[road.sticks].sum(), pressing.sum()])
        stuck, whole = self.problem.body.comm.allreduce(sums)
        rate = self._rate(self._shift(moved), size)
        return Slid(moved, self._force(), rate, float(state.moment[2]), float(stuck / whole))
