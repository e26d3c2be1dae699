"""What the wall is made of, region by region of the section: one value a cell of each coefficient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from tireroad.fem import compat
from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import LAWS, Material
from tireroad.fem.tire.mesh import TireMesh, Torus


@dataclass(frozen=True)
class Region:
    """A part of the section with a material of its own.

    `arc` (from, to) in rad from the crown, on the sides named: "both", "left" (y < 0) or "right";
    `depth` (from, to) through the wall, 0 the inner and 1 the outer face.
    """

    material: Material
    arc: tuple[float, float]
    depth: tuple[float, float] = (0.0, 1.0)
    side: str = "both"

    def covers(self, arc: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Whether points at a section angle (rad) and depth lie in the region."""
        along = {"both": np.abs(arc), "left": -arc, "right": arc}[self.side]
        inside = (along >= self.arc[0]) & (along <= self.arc[1])
        return inside & (depth >= self.depth[0]) & (depth <= self.depth[1])


class Wall:
    """Density and the coefficients of all laws in use, as fields that are constant in a cell.

    They are data of the compiled forms, not part of them: another modulus compiles nothing, and a
    region costs nothing. A cell belongs to the last region that holds its middle. Collective to make;
    raises InputError for a region that holds no cell.
    """

    def __init__(self, tire: TireMesh, space, material: Material, regions: Sequence[Region] = ()):
        self._space = compat.cell_space(tire.mesh)
        arc, depth = middles(tire.section, space)
        owner = np.zeros(len(arc), dtype=int)
        for number, region in enumerate(regions):
            covered = region.covers(arc, depth)
            if not tire.mesh.comm.allreduce(int(covered.sum())):
                raise InputError(
                    f"tire.region {number} (arc {np.degrees(region.arc[0]):g} to "
                    f"{np.degrees(region.arc[1]):g} deg) holds the middle of no element: make it "
                    "larger or the mesh finer"
                )
            owner[covered] = number + 1
        self._materials = [material, *(region.material for region in regions)]
        self._owner = owner
        self.density = self._field("density", None)
        self._laws = [
            (law.energy, [self._field(name, model) for name in law.coefficients])
            for model, law in LAWS.items()
            if any(m.model == model for m in self._materials)
        ]

    def _field(self, name: str, model: str | None) -> fem.Function:
        """An attribute of the materials by cell; 0 where the material follows another law."""
        values = [getattr(m, name) if model in (None, m.model) else 0.0 for m in self._materials]
        field = fem.Function(self._space)
        field.x.array[:] = np.array(values)[self._owner]
        return field

    def energy(self, C):
        """Strain energy density as (distortion, dilatation), J/m3, in UFL."""
        parts = [energy(C, *coefficients) for energy, coefficients in self._laws]
        return sum(part[0] for part in parts), sum(part[1] for part in parts)


def middles(section: Torus, space) -> tuple[np.ndarray, np.ndarray]:
    """Section angle (rad) and depth (0 inner face, 1 outer) of the middle of each cell, ghosts too.

    From the cell's own nodes: the middle in space of a flat-faced element lies inside the curve.
    """
    _, wall, arc = section.coordinates(space.tabulate_dof_coordinates())
    cells = space.mesh.topology.index_map(3)
    count = cells.size_local + cells.num_ghosts
    nodes = np.array([space.dofmap.cell_dofs(cell) for cell in range(count)])
    depth = 1 - (section.minor_radius - wall) / section.thickness
    return arc[nodes].mean(axis=1), depth[nodes].mean(axis=1)
