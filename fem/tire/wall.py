"""Materials of the wall by region of the section: one value per cell for each coefficient."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.sections.grid import Patch
from tireroad.fem.tire.law import MATERIALS, MaterialLaw
from tireroad.fem.tire.material import Material
from tireroad.fem.tire.mesh import TireMesh


@dataclass(frozen=True, kw_only=True)
class Region:
    """A part of a torus's section with a material of its own; its boundary lies on element edges.

    `arc` (from, to) in rad from the crown, on the sides named: "both", "left" (y < 0) or "right";
    `depth` (from, to) through the wall: 0 inner, 1 outer face.
    """

    material: Material
    arc: tuple[float, float]
    depth: tuple[float, float] = (0.0, 1.0)
    side: str = "both"

    def patch(self, number: int) -> Patch:
        """The part of the section, named after its number in the scene."""
        low, high = self.arc
        right, left = (low, high), (-high, -low)
        arcs = {"both": (right, left), "left": (left,), "right": (right,)}[self.side]
        return Patch(f"tire.region {number}", arcs, self.depth)


def compounds(material: Material, regions: tuple[Region, ...]) -> dict[str, Material]:
    """The materials of a torus by the names of its section's regions."""
    return {"wall": material} | {r.patch(i).name: r.material for i, r in enumerate(regions)}


class Wall:
    """Density and coefficients of all laws in use, as fields constant in each cell.

    They are data of the compiled forms, so another modulus needs no recompilation and regions cost
    nothing. `materials` by name of the section's regions. Raises InputError for a region without a
    material. Collective to make.
    """

    def __init__(self, tire: TireMesh, materials: Mapping[str, Material]) -> None:
        self._space = compat.cell_space(tire.mesh)
        section = tire.ring.section
        missing = [name for name in section.regions if name not in materials]
        if missing:
            raise InputError(f"section: no material for region {missing[0]!r}")
        self._owner = section.region[tire.section_cell]  # region number of each cell
        self._materials = [materials[name] for name in section.regions]
        self.density = self._by_cell([m.density for m in self._materials])
        self.stiffens = any(m.dynamic != 1 for m in self._materials)
        self.loses = any(m.loss_factor for m in self._materials)
        self._laws = [
            (law.energy, [self._coefficient(name, law) for name in law.coefficients])
            for law in map(MATERIALS.__getitem__, MATERIALS)
            if any(type(m.law) is law for m in self._materials)
        ]

    def _coefficient(self, name: str, law: type[MaterialLaw]) -> fem.Function:
        """A coefficient of the law by cell; 0 where the material follows another law."""
        own = [m.law for m in self._materials]
        return self._by_cell([getattr(one, name) if type(one) is law else 0.0 for one in own])

    def _by_cell(self, values: Sequence[float]) -> fem.Function:
        field = fem.Function(self._space)
        field.x.array[:] = np.array(values)[self._owner]
        return field

    def stiffening(self) -> fem.Function:
        """Excess of the dynamic modulus over the static one, as a fraction of it: dynamic - 1."""
        return self._by_cell([m.dynamic - 1 for m in self._materials])

    def losses(self) -> fem.Function:
        """Loss modulus of small motions as a fraction of the static modulus."""
        return self._by_cell([m.dynamic * m.loss_factor for m in self._materials])

    def energy(self, C: Expr) -> tuple[Expr, Expr]:
        """Strain energy density as (distortion, dilatation), J/m3, in UFL."""
        parts = [energy(C, *coefficients) for energy, coefficients in self._laws]
        return sum(part[0] for part in parts), sum(part[1] for part in parts)
