"""A tire as finite elements: as it was made, and the matrices of its small motions about a static state.

Both are functions of small arrays, and expensive parts are made when they are first asked for: whoever
reads all later results from files never makes a mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.matrices.operators import Operators, Rotation
from tireroad.fem.matrices.rim_motion import RimMotion, rim_motion
from tireroad.fem.matrices.support import Support
from tireroad.fem.sections.ring import Ring
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice, field_lattice

RIMS, ROADS = ("fixed", "free"), ("forces", "held")


class TireModel:
    """A tire without loads: its `section`, the `lattice` of its nodes, and its finite elements, `body`."""

    def __init__(self, section: Ring, make_body: Callable[[], Body]) -> None:
        self.section, self._make_body = section, make_body

    @cached_property
    def lattice(self) -> Lattice:
        """The nodes of the displacement field, without a mesh."""
        return field_lattice(self.section)

    @cached_property
    def body(self) -> Body:
        """The finite-element body, whose displacement is that of whoever used it last. Collective."""
        return self._make_body()


class SmallMotions:
    """The matrices of a tire's small motions about its static state, at that state's own inflation.

    `rim` "fixed" or "free"; `road` "forces": the road is replaced by its static forces, or "held": the
    nodes that touch it keep their height. Properties are collective at their first use.
    """

    def __init__(
        self, tire: TireModel, static: StaticState, *, rim: str = "fixed", road: str = "forces"
    ) -> None:
        for name, value, known in (("rim", rim, RIMS), ("road", road, ROADS)):
            if value not in known:
                raise InputError(f'{name} = "{value}" is unknown: take {" or ".join(known)}')
        self.tire, self.static, self.rim, self._road = tire, static, rim, road
        self._rim_motions: dict[bool, RimMotion] = {}

    @property
    def lattice(self) -> Lattice:
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
        """Mass and stiffness, and what the unknowns are."""
        self.body.set_displacement(self.static.displacement)
        held = {} if self._road == "forces" else {"held": self._touching()}
        support = Support(self.rim, **held)
        return Operators(self.body, self.static.inflation, support, self.static.rolling)

    def rim_motion(self, turns: bool) -> RimMotion | None:
        """What the rim's motions meet in the matrices of a tire whose rim is held, `turns` or stands; None of a free rim, and
        where the road holds what touches it. Collective.
        """
        if (self.rim, self._road) != ("fixed", "forces"):
            return None
        if turns not in self._rim_motions:
            self.body.set_displacement(self.static.displacement)
            given = self.body, self.static.inflation, self.static.rolling
            self._rim_motions[turns] = rim_motion(*given, turns)
        return self._rim_motions[turns]

    def _touching(self) -> np.ndarray:
        face = self.body.surface
        return face.local[self.static.force[face.place] > 0]

    @cached_property
    def rotation(self) -> Rotation:
        """The matrices of the rotating frame."""
        return self.operators.rotation()

    @property
    def unknowns(self) -> int:
        """Degrees of freedom that nothing holds."""
        return self.operators.stiffness.getSize()[0]
