"""The interface of a tread law: its parameters, and the compliance that they define."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.compliance import Influence, check_points, dense_compliance
from tireroad.fem.parameters import Parameters, Registry

Array = NDArray[np.float64]


class TreadLaw(Parameters):
    """Base of linear tread laws: the approach of a point to the carcass under a force on another.

    A derived class defines `influence`, and `matrix` if the law is not one of distances alone. A
    law without compliance of its own (`compliant` False) works only on the nodes of the mesh: a
    grid has more points than nodes, and the contact problem would be singular. A law that also
    deforms under forces in the plane of the road (`shears`) defines `shear`.
    """

    owner = "contact"
    compliant = True
    shears = False

    @property
    def creeps(self) -> bool:
        """Whether past pressure moves it."""
        return False

    @property
    def creep(self) -> tuple[Array, Array] | None:
        """Shares and times (k,), - and s, of its creep (contact.tread.memory), or None."""
        return None

    def influence(self, farthest: float) -> Influence:
        """Approach (m/N) at x, y (m) from rectangles of half sizes a, b (m) per unit force.

        `farthest` (m): the largest distance at which it will be evaluated.
        """
        raise NotImplementedError

    def shear(self, farthest: float) -> Influence:
        """Displacements (5, ...) m/N under unit forces in the plane of the road, if it `shears`.

        See contact.tread.shear.
        """
        raise NotImplementedError

    def matrix(self, points: Array, half_sizes: Array, farthest: float) -> Array:
        """Compliance (c, c) m/N between points (c, 2) m with rectangles of half sizes (c, 2) m.

        InputError if it is not positive definite.
        """
        check_points(points, half_sizes)
        return dense_compliance(points, half_sizes, self.influence(farthest))


TREADS: Registry[TreadLaw] = Registry("contact.tread", "tireroad.contact.tread.laws", TreadLaw)
tread_law = TREADS.register
