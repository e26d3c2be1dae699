"""How the tire of a scene becomes a section, a lattice of nodes and a finite-element body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.sections.ring import Ring
from tireroad.runs.scene.extent.tire_section import built, make_section, patch
from tireroad.runs.scene.tables.tire import Material as MaterialTable
from tireroad.runs.scene.tables.tire import Region, Tire

if TYPE_CHECKING:
    from mpi4py import MPI


def make_tire(comm: MPI.Comm, tire: Tire):
    """The tire without loads, its finite elements made when they are asked for."""
    from tireroad.fem.model import TireModel

    section = make_section(tire)
    return TireModel(section, lambda: make_body(comm, tire, section))


def make_body(comm: MPI.Comm, tire: Tire, section: Ring):
    """The finite-element body, undeformed. Collective."""
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.stages.build.own_tire import own_cords, own_materials

    if tire.section == "file":
        return Body(comm, section, own_materials(tire), cords=own_cords(tire))
    if tire.section == "radial":
        return _radial_body(comm, tire, section)

    def rubber(part: Tire | Region) -> Material:
        table = part.material or MaterialTable()
        return Material(table.law, table.density, part.dynamic, part.loss_factor)

    names = [patch(i, region).name for i, region in enumerate(tire.region)]
    materials = {name: rubber(r) for name, r in zip(names, tire.region, strict=True)}
    placed = {"depth", "arc", "angle"}
    cords = [
        Cords(
            angle=float(np.radians(c.angle)),
            **{key: value for key, value in vars(c).items() if key not in placed},
        )
        for c in tire.cords
    ]
    return Body(comm, section, {"wall": rubber(tire)} | materials, cords=cords)


def _radial_body(comm: MPI.Comm, tire: Tire, section: Ring):
    """The body of a tire built of layers. Collective."""
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import compound

    construction, places = built(tire), {"under", "to"}
    cords = [
        Cords(**{key: value for key, value in vars(line).items() if key not in places})
        for line in construction.cords
    ]
    compounds = {
        name: compound("neo-hookean", **values) for name, values in construction.compounds.items()
    }
    return Body(comm, section, compounds, cords=cords)
