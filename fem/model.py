"""Finite-element model of a tire: unloaded, and its small motions about a static state.

Both are defined by small arrays. Expensive parts are built on first use, so a run that reads all
later results from files builds no mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Operators, RimMotion, Rotation, Support, rim_motion
from tireroad.fem.sections.mesh2d import Ring
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import NodeGrid, field_lattice

RIMS, ROADS = ("fixed", "free"), ("forces", "held")


class TireModel:
    """An unloaded tire: its `section`, the `lattice` of its nodes and its finite-element `body`."""

    def __init__(self, section: Ring, make_body: Callable[[], Body]) -> None:
        self.section, self._make_body = section, make_body

    @cached_property
    def lattice(self) -> NodeGrid:
        """The nodes of the displacement field: those of the body where there is one; needs no mesh."""
        return self.body.lattice if "body" in vars(self) else field_lattice(self.section)

    @cached_property
    def body(self) -> Body:
        """The finite-element body, shared: its displacement is the one set last. Collective."""
        return self._make_body()


class SmallMotions:
    """Matrices of a tire's small motions about its static state, at the inflation of that state.

    `rim` "fixed" or "free"; `road` "forces": the road is replaced by its static forces, or "held":
    the vertical motion of the nodes in contact is held. Properties are collective at first use.
    """

    def __init__(
        self, tire: TireModel, static: StaticState, *, rim: str = "fixed", road: str = "forces"
    ) -> None:
        for name, value, known in (("rim", rim, RIMS), ("road", road, ROADS)):
            if value not in known:
                raise InputError(f'{name} = "{value}" is unknown: take {" or ".join(known)}')
        self.tire, self.static, self.rim, self.road = tire, static, rim, road
        self._rim_motions: dict[bool, RimMotion] = {}

    @property
    def lattice(self) -> NodeGrid:
        """The nodes of the displacement field."""
        return self.tire.lattice

    @cached_property
    def body(self) -> Body:
        """The finite-element body at the static state."""
        body = self.tire.body
        body.set_displacement(self.static.displacement)
        return body

    @cached_property
    def operators(self) -> Operators:
        """Mass, stiffness and the map of unknowns."""
        self.body.set_displacement(self.static.displacement)
        held = {} if self.road == "forces" else {"held": self._touching()}
        support = Support(self.rim, **held)
        return Operators(self.body, self.static.inflation, support, self.static.rolling)

    def rim_motion(self, turns: bool) -> RimMotion | None:
        """Coupling of the rim's rigid motions to a tire with fixed rim; `turns`: the wheel rotates.

        None for a free rim, and where the road holds the nodes in contact. Collective.
        """
        if (self.rim, self.road) != ("fixed", "forces"):
            return None
        if turns not in self._rim_motions:
            self.body.set_displacement(self.static.displacement)
            arguments = self.body, self.static.inflation, self.static.rolling
            self._rim_motions[turns] = rim_motion(*arguments, turns)
        return self._rim_motions[turns]

    def _touching(self) -> np.ndarray:
        face = self.body.surface
        return face.local[self.static.force[face.place] > 0]

    @cached_property
    def rotation(self) -> Rotation:
        """The matrices of the rotating wheel."""
        return self.operators.rotation()

    @property
    def unknowns(self) -> int:
        """Number of free degrees of freedom."""
        return self.operators.stiffness.getSize()[0]
