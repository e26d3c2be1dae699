"""How the tire of a scene becomes a section, a lattice of nodes and a finite-element body."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from mpi4py import MPI

from tireroad.runs.scene.tire_tables import Tire


def make_section(tire: Tire):
    """The shape of the tire and its elements."""
    from tireroad.fem.tire.mesh import Torus

    names = {f.name for f in fields(Torus)} - {"half_angle"}
    given = {name: getattr(tire, name) for name in names}
    return Torus(half_angle=np.radians(tire.half_angle), **given)


def make_lattice(section):
    """The nodes of the displacement field, without a mesh."""
    from tireroad.fem.tire.mesh import field_lattice

    return field_lattice(section)


def make_body(comm: MPI.Comm, tire: Tire, section):
    """The finite-element body, undeformed. Collective."""
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.fem.tire.wall import Region

    regions = [
        Region(Material(**vars(r.material)), tuple(np.radians(r.arc)), r.depth, r.side)
        for r in tire.region
    ]
    cords = [
        Cords(**vars(c) | {"arc": tuple(np.radians(c.arc)), "angle": float(np.radians(c.angle))})
        for c in tire.cords
    ]
    return Body(comm, section, Material(**vars(tire.material)), regions, cords)
