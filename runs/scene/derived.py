"""Defaults of a scene that follow from other tables than their own."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from tireroad.runs.scene.plan import skipped
from tireroad.runs.scene.sections.kind import SECTIONS
from tireroad.runs.scene.source import Source
from tireroad.runs.scene.tables.modal import Modal
from tireroad.runs.scene.tables.road import Road
from tireroad.runs.scene.tables.scene import Damping, Scene

Say = Callable[[str], object]


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


def with_road(scene: Scene, say: Say) -> Scene:
    """Set a flat road where there is contact with none given."""
    if scene.contact is None or scene.road is not None:
        return scene
    say("no [road]: it is flat")
    return replace(scene, road=Road())


def with_outputs(scene: Scene, say: Say) -> Scene:
    """Leave out what is asked of driven points where there are none."""
    kept = tuple(one for one in scene.output.kinds if scene.force or one[1].of != "points")
    if len(kept) == len(scene.output.kinds):
        return scene
    lost = [f"output.{name}" for name, kind in scene.output.kinds if (name, kind) not in kept]
    say(f"no [[force]], hence no driven points: {', '.join(lost)} left out")
    return replace(scene, output=replace(scene.output, kinds=kept))


def with_modal(scene: Scene, until: str | None) -> Scene:
    """Set the default [modal] where something needs modes, or the run is to end with them."""
    needed = scene.contact, scene.force, scene.rotation, scene.axle.kind != "fixed"
    if scene.modal is None and (any(needed) or until in ("modes", "rotating")):
        return replace(scene, modal=Modal())
    return scene


def with_count(
    scene: Scene, raw: dict[str, Any], until: str | None, source: Source, say: Say
) -> Scene:
    """Fit the default number of modes to the mesh; note a given one that the mesh does not have.

    A given number is judged only if the modes will be computed.
    """
    modal = scene.modal
    if modal is None or modal.up_to is not None:
        return scene
    count, free = modal.count, scene.tire.free_unknowns()
    if count < free:
        return scene
    if "count" not in raw.get("modal", {}):
        say(
            f"modal.count is {free - 1}, all the modes that the mesh has, not {count} as by default"
        )
        return replace(scene, modal=replace(modal, count=free - 1))
    if "modes" not in skipped(scene, until):
        text = f"= {count} must be less than the {free} free unknowns of the mesh"
        source.add(("modal", "count"), text)
    return scene
