"""Equilibrium on a level road with Coulomb friction; Newton's method in one loop, sets of contact, stick and slip in it."""

from __future__ import annotations

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction.road import RubbingRoad
from tireroad.fem.static.friction.sliding import Sliding
from tireroad.fem.static.friction.system import RubbingSystem
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body


class RubbingEquilibrium(Equilibrium):
    """As `Equilibrium`, of nodes that slide as `sliding` says under the coefficient `friction`. Collective."""

    road: RubbingRoad

    def __init__(self, body: Body, rolling: Rolling, friction: float, sliding: Sliding) -> None:
        self._given = friction, sliding
        super().__init__(body, rolling)

    def _make_road(self) -> RubbingRoad:
        return RubbingRoad(self.body, *self._given)

    def _make_system(self, kind: str) -> RubbingSystem:
        return RubbingSystem(self.body.comm, self.matrix, self.cost, self.road)

    def _make_contact(self) -> None:
        """None: the tangent is not symmetric."""
