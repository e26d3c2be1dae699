"""How the tire of a scene becomes a section, a lattice of nodes and a finite-element body."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

    from tireroad.fem.sections.ring import Ring
    from tireroad.fem.tire.body import Body
    from tireroad.runs.scene.tables.tire import Tire


def make_tire(comm: MPI.Comm, tire: Tire):
    """The tire without loads, its finite elements made when they are asked for."""
    from tireroad.fem.model import TireModel

    section = tire.ring()
    return TireModel(section, lambda: make_body(comm, tire, section))


def make_body(comm: MPI.Comm, tire: Tire, section: Ring) -> Body:
    """The finite-element body, undeformed. Collective."""
    from tireroad.fem.tire.body import Body

    return Body(comm, section, tire.shape.rubbers(tire), cords=tire.shape.cords(tire))
