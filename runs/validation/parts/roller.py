"""A rubber roller in plane strain: the finite-element tire as a cylinder with closed forms.

A torus with such a large section circle that the strip in use is flat; its inner face is held, and
nothing moves along the axle. Elements are small at the road and grow from there around and inwards.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from tireroad.fem.sections.grid import product
from tireroad.fem.sections.torus import Torus
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import INNER, TREAD

FLAT = 1e3  # m, radius of the section circle
_GROWTH = 1.5
E = TypeVar("E", bound=Equilibrium)


@dataclass(frozen=True, kw_only=True)
class Roller:
    """Dimensions of the roller and its mesh, m.

    `outer` radius; `thickness` of the rubber; `width`; elements of `size` up to a distance `reach`
    from the lowest point.
    """

    outer: float = 0.3
    thickness: float = 0.1
    width: float = 0.01
    size: float = 2.5e-3
    reach: float = 0.019
    youngs_modulus: float = 1e6
    poisson_ratio: float = 0.49

    @property
    def modulus(self) -> float:
        """E / (1 - nu^2), Pa."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    def hertz_load(self, half: float) -> float:
        """Load (N) of a contact of half length `half` (m) on a half-space of this rubber."""
        return np.pi / 4 * self.modulus * half**2 / self.outer * self.width

    def body(self) -> Body:
        """The finite-element body, on this process alone."""
        half = self.width / 2 / FLAT
        torus = Torus(
            outer_radius=self.outer,
            minor_radius=FLAT,
            thickness=self.thickness,
            half_angle=half,
            segments=8,
            elements_arc=1,
            elements_thickness=1,
            order=2,
            grading="uniform",
        )
        around = _graded(self.size, np.pi * self.outer, self.reach) / self.outer
        depth = _graded(self.size, self.thickness, self.reach / 2) / self.thickness
        section = product(
            order=2, wall=1 - depth[::-1], arc=np.array([-half, half]), place=torus._place
        )
        ring = replace(
            torus.ring(),
            section=section,
            ring_corners=np.append(around, 2 * np.pi - around[-2::-1]),
            coarser=lambda: None,
        )
        rubber = compound(
            "neo-hookean",
            1000.0,
            youngs_modulus=self.youngs_modulus,
            poisson_ratio=self.poisson_ratio,
        )
        body = Body(MPI.COMM_SELF, ring, {"wall": rubber})
        body.rim, tread = body._face_dofs(INNER), body._face_dofs(TREAD)
        body.tread = tread[tread < body.nodes]
        return body


def _graded(size: float, end: float, reach: float) -> np.ndarray:
    """Corners (m) from 0 to `end`, spaced by `size` up to `reach`, then increasingly wider."""
    places = [0.0]
    while places[-1] < end:
        if places[-1] >= reach:
            size *= _GROWTH
        places.append(places[-1] + size)
    return np.array(places) * end / places[-1]


def plane(equilibrium: E) -> E:
    """The same problem without motion along the axle."""
    body, axial = equilibrium.body, equilibrium.body.space.sub(1)
    collapsed, _ = axial.collapse()
    everywhere = fem.locate_dofs_geometrical(
        (axial, collapsed), lambda x: np.full(x.shape[1], True)
    )
    equilibrium._clamp.append(fem.dirichletbc(fem.Function(collapsed), everywhere, axial))
    along = np.setdiff1d(np.arange(1, 3 * body.nodes, 3), 3 * body.rim + 1)
    equilibrium._rim = np.union1d(equilibrium._rim, along)
    return equilibrium


def middle(equilibrium: Equilibrium) -> tuple[np.ndarray, np.ndarray]:
    """Positions x (m) of the touching nodes in the middle of the width, and their tread indices."""
    body = equilibrium.body
    points = body.space.tabulate_dof_coordinates()[body.tread]
    x = points[:, 0] + body.owned(body.u.x.array)[body.tread, 0]
    some = np.flatnonzero((np.abs(points[:, 1]) < 1e-9) & equilibrium.road.active)
    some = some[np.argsort(x[some])]
    return x[some], some
