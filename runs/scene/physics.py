"""Physics of a scene: the tire, road, damping, rotation and friction that its tables describe."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from mpi4py import MPI

from tireroad.contact.roads.under_tire import is_level
from tireroad.contact.setup import ContactSetup
from tireroad.fem.model import TireModel
from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.road import RoadShape
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import REFERENCE
from tireroad.fem.wheel import Turning
from tireroad.modal.damping import Damping, Proportional, StrainEnergy
from tireroad.runs.scene.tables.scene import Scene

if TYPE_CHECKING:
    from tireroad.fem.sections.mesh2d import Ring
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import TireTable


def make_tire(comm: MPI.Comm, tire: TireTable, temperature: float = REFERENCE):
    """The tire without loads at a temperature, degrees C; its finite elements are made on first use."""
    section = tire.ring()
    return TireModel(section, partial(make_body, comm, tire, section, temperature))


def road_shape(scene: Scene) -> RoadShape:
    """The road's shape under the tire: the wheel's camber, and the drum if there is one."""
    drum = scene.road.drum_radius if scene.road else None
    return RoadShape(
        camber=math.radians(scene.static.camber),
        drum_radius=drum,
        inside=drum is not None and scene.road.drum == "inside",
    )


def make_body(
    comm: MPI.Comm, tire: TireTable, section: Ring, temperature: float = REFERENCE
) -> Body:
    """The finite-element body, undeformed, at a temperature, degrees C. Collective."""
    return Body(comm, section, compounds(tire, temperature), cords=tire.shape.cords(tire))


def compounds(tire: TireTable, temperature: float) -> dict[str, Material]:
    """The compounds as they fill the regions of the tire's section, at a temperature, degrees C."""
    layers = tire.shape.in_layers(tire)
    return {name: compound.at(temperature) for name, compound in layers.items()}


def damping_of(scene: Scene) -> Damping:
    """Proportional damping if the scene has it, else modal strain energy (loss factors)."""
    damping = scene.damping
    return StrainEnergy() if damping is None else Proportional(damping.mass, damping.stiffness)


def rolling_shape(turning: Turning) -> Rolling:
    """Steady rolling, for the static state, of a wheel that turns so; at rest for speed 0."""
    if turning.speed == 0:
        return AT_REST
    # Strain-energy damping needs modes, which come later: the shape then has inertia forces alone.
    mass, stiffness = (0.0, 0.0) if isinstance(turning.damping, StrainEnergy) else turning.damping
    return Rolling(
        speed=turning.speed, damping=mass, stiffness_damping=stiffness, inertia=turning.inertia
    )


def wheel_slip(scene: Scene) -> tuple[float, float]:
    """The scene's slip of the wheel (s_x, s_y), including its slip angle."""
    along, across = scene.contact.slip if scene.contact else (0.0, 0.0)
    angle = scene.rotation.slip_angle if scene.rotation else 0.0
    return along, across + math.tan(math.radians(angle))


def friction_of(scene: Scene, rolling: Rolling) -> Friction | None:
    """Friction of the static state that rolls so; None if the scene has none."""
    static, rotation = scene.static, scene.rotation
    if static.friction is None:
        return None
    if not rolling.speed or rotation is None:
        return Friction(coefficient=static.friction, steps=static.friction_steps)
    return Friction(
        coefficient=static.friction, radius=rotation.rolling_radius, slip=wheel_slip(scene)
    )


def turning_of(scene: Scene, speed: float) -> Turning:
    """The rotation of a wheel at a `speed` (rad/s), with the scene's damping and inertia."""
    if not speed or scene.rotation is None:
        return Turning(speed=speed, damping=damping_of(scene))
    return Turning(
        speed=speed,
        damping=damping_of(scene),
        inertia=scene.rotation.inertia,
        shape_tolerance=scene.rotation.shape_tolerance,
    )


def shapes_of(scene: Scene, speed: float) -> Turning | None:
    """The wheel's rotation if rotation shapes join its modes (modal.rotation_shapes), else None."""
    return turning_of(scene, speed) if speed and scene.joins_shapes else None


def run_in_time(setup: ContactSetup, length: float) -> float:
    """Time (s) until the whole patch is past a run-in of this `length` (m); 0 of a standing wheel, or if the
    road is level up to its end."""
    speed, whole = setup.rolled.speed, setup.road.grown
    x0, x1, y0, y1 = setup.patch.extent
    if speed == 0 or is_level(setup.road, min(x0, whole), whole, y0, y1):
        return 0.0
    return (length + x1 - x0) / speed
