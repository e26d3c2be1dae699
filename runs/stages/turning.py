"""Rotation of the scene's wheel, and damping of its tire."""

from __future__ import annotations

import math

from tireroad.fem.static.friction_press import Friction
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.turning import Turning
from tireroad.modal.damping import Damping, Proportional, StrainEnergy
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.stage import Job


def damping_of(job: Job) -> Damping:
    """Proportional damping if the scene has it, else modal strain energy (loss factors)."""
    given = job.scene.damping
    return StrainEnergy() if given is None else Proportional(given.mass, given.stiffness)


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


def turning_of(job: Job) -> Turning:
    """The scene's speed, damping and inertia."""
    inertia = job.scene.rotation.inertia if job.speed else "full"
    return Turning(speed=job.speed, damping=damping_of(job), inertia=inertia)


def shapes_of(job: Job) -> Turning | None:
    """The wheel's rotation if rotation shapes join its modes (modal.rotation_shapes), else None."""
    return turning_of(job) if job.speed and job.scene.joins_shapes else None
