"""How the tire of a scene becomes a section, a lattice of nodes and a finite-element body."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.sections.ring import Ring
from tireroad.runs.scene.tire_section import patch
from tireroad.runs.scene.tire_tables import Region, Tire


def make_lattice(section: Ring):
    """The nodes of the displacement field, without a mesh."""
    from tireroad.fem.tire.mesh import field_lattice

    return field_lattice(section)


def make_body(comm: MPI.Comm, tire: Tire, section: Ring):
    """The finite-element body, undeformed. Collective."""
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material

    def rubber(part: Tire | Region) -> Material:
        given = vars(part.material) | {"dynamic": part.dynamic, "loss_factor": part.loss_factor}
        return Material(**given)

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
