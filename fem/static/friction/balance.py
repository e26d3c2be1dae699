"""Equilibrium on a smooth road with Coulomb friction: contact, stick, slip in one Newton loop."""

from __future__ import annotations

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction.road import RubbingRoad
from tireroad.fem.static.friction.sliding import Sliding
from tireroad.fem.static.friction.system import RubbingSystem
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body


class RubbingEquilibrium(Equilibrium):
    """`Equilibrium` with coefficient `friction` and slip as in `sliding`. Collective."""

    road: RubbingRoad

    def __init__(self, body: Body, rolling: Rolling, friction: float, sliding: Sliding) -> None:
        self._given = friction, sliding
        super().__init__(body, rolling, sliding.shape)

    def _make_road(self) -> RubbingRoad:
        return RubbingRoad(self.body, *self._given)

    def _make_system(self, kind: str) -> RubbingSystem:
        return RubbingSystem(self.body.comm, self.matrix, self.cost, self.road)

    def _make_contact(self) -> None:
        """None: the tangent is unsymmetric."""

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> Step:
        """As without friction."""
        self.road.search()
        return super().solve(road_height, load, allowed)

    def nudged(self, load: float) -> np.ndarray:
        """Sum (2,) N of the forces along and across the road after one step under `load` (N).

        The stick and slip sets are kept, and the state is restored. Raises ConvergenceError for a
        singular tangent. Collective."""
        field = self.body.u.x
        kept, self._before.x.array[:] = (field.array.copy(), self.road.kept()), field.array
        self._out()
        if not self._take_tangent() or self._move(self._system.closing, load):
            raise ConvergenceError("static: the tangent of a state with friction is singular")
        for _ in range(1, self.rounds):  # what an incomplete tangent left
            self._out()
            self._move(None, load)
        pulled = self.body.comm.allreduce(self.road.pull.sum(axis=0))
        field.array[:] = kept[0]
        self.road.put_back(kept[1])
        return pulled
