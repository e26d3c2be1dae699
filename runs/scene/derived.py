"""Defaults of a scene that follow from other tables than their own."""

from dataclasses import replace
from typing import Any

from tireroad.runs.scene.sections.kind import SECTIONS
from tireroad.runs.scene.tables.scene import Damping, Scene


def by_section(raw: dict[str, Any]) -> None:
    """Set what follows from the kind of section: a mesh's section, a section's tread."""
    tire, contact = raw.get("tire"), raw.get("contact")
    if not isinstance(tire, dict):
        return
    if "mesh" in tire:
        tire.setdefault("section", "file")
    kind = tire.get("section")
    if isinstance(contact, dict) and isinstance(kind, str) and kind in SECTIONS:
        contact.setdefault("tread", SECTIONS[kind].tread_law)


def with_speed(scene: Scene) -> Scene:
    """Set the wheel's speed for a travel speed until the static state gives its rolling radius."""
    rotation = scene.rotation
    if rotation is None or rotation.travel_speed is None:
        return scene
    speed = rotation.travel_speed / (
        rotation.rolling_radius or scene.tire.proportions().outer_radius
    )
    return replace(scene, rotation=replace(rotation, speed=speed))


def with_damping(scene: Scene) -> Scene:
    """Set the default proportional damping if neither it nor a compound's loss factor is given."""
    loses = scene.tire.shape.has_losses(scene.tire)
    return replace(scene, damping=Damping()) if scene.damping is None and not loses else scene
