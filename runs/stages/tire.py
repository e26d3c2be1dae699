"""From the scene's tire to its section, lattice of nodes and finite-element body."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mpi4py import MPI

    from tireroad.fem.sections.ring import Ring
    from tireroad.fem.static.road import RoadShape
    from tireroad.fem.tire.body import Body
    from tireroad.runs.scene.tables.scene import Scene
    from tireroad.runs.scene.tables.tire import Tire


def make_tire(comm: MPI.Comm, tire: Tire):
    """The tire without loads; its finite elements are made on first use."""
    from tireroad.fem.model import TireModel

    section = tire.ring()
    return TireModel(section, lambda: make_body(comm, tire, section))


def road_shape(scene: Scene) -> RoadShape:
    """The road's shape under the tire: the wheel's camber, and the drum if there is one."""
    from tireroad.fem.static.road import RoadShape

    drum = scene.road.drum_radius if scene.road else None
    return RoadShape(
        camber=math.radians(scene.static.camber),
        drum_radius=drum,
        inside=drum is not None and scene.road.drum == "inside",
    )


def make_body(comm: MPI.Comm, tire: Tire, section: Ring) -> Body:
    """The finite-element body, undeformed. Collective."""
    from tireroad.fem.tire.body import Body

    return Body(comm, section, tire.shape.rubbers(tire), cords=tire.shape.cords(tire))
