"""What the geometry, the cords and the compounds of a scene must keep to."""

import math
from collections.abc import Callable
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.fem.sections.tire_size import size
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.tables.tire import Material, Tire

Where = Callable[[tuple[str, ...], str], InputError]


def check_cords(tire: Tire, error: Where) -> None:
    """Raise InputError for the first line of cords that has no place or no name of its own."""
    for number, cords in enumerate(tire.cords):
        place = ("tire", "cords", str(number))
        low, high = cords.arc
        if low >= high:
            raise error((*place, "arc"), f"= [{low:g}, {high:g}] must ascend")
        if max(-low, high) > tire.half_angle:
            raise error(
                (*place, "arc"),
                f"= [{low:g}, {high:g}] deg reaches beyond the beads, at "
                f"tire.half_angle = {tire.half_angle:g} deg",
            )
        if cords.depth > tire.thickness:
            raise error(
                (*place, "depth"),
                f"= {cords.depth:g} m lies outside the wall: at most "
                f"tire.thickness = {tire.thickness:g} m",
            )
        if cords.area / cords.spacing > tire.thickness:
            raise error(
                (*place, "area"),
                f"= {cords.area:g} m² every {cords.spacing:g} m is more cord than the wall of "
                f"{tire.thickness:g} m has room for",
            )
        if any(other.name == cords.name for other in tire.cords[:number]):
            raise error((*place, "name"), f'= "{cords.name}" is taken: give each line its own')
        if "/" in cords.name or cords.name in (".", ".."):
            raise error(
                (*place, "name"), f'= "{cords.name}" must hold no "/": results are named so'
            )


def full_matrices(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """What is solved on the full matrices needs a damping that they have."""
    if scene.damping is not None:
        return
    advice = "needs full matrices of damping, and loss factors make none: add [damping]"
    if scene.rotation is not None and scene.rotation.method == "full":
        raise error(("rotation", "method"), f'= "full" {advice}')
    receptance = scene.output.receptance
    if receptance is not None and receptance.direct:
        raise error(("output", "receptance", "direct"), f"= {receptance.direct} {advice}")


def _radial(tire: Tire, error: Where) -> None:
    for key, absent in (("material", Material()), ("region", ()), ("cords", ())):
        if getattr(tire, key) != absent:
            raise error(("tire", key), "is of a torus: a radial tire has all of it by its size")
    try:
        size(tire.size)
    except InputError as problem:
        raise error(("tire", "size"), str(problem).removeprefix("tire.size ")) from None


def geometry(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    tire = scene.tire
    if tire.section == "file":
        return
    if tire.section == "radial":
        _radial(tire, error)
        return
    if tire.thickness >= tire.minor_radius:
        raise error(
            ("tire", "thickness"),
            f"= {tire.thickness:g} m must be less than minor_radius = {tire.minor_radius:g} m",
        )
    if tire.minor_radius >= tire.outer_radius:
        raise error(
            ("tire", "minor_radius"),
            f"= {tire.minor_radius:g} m must be less than outer_radius = {tire.outer_radius:g} m",
        )
    bead = (
        tire.outer_radius
        - tire.minor_radius
        + tire.minor_radius * math.cos(math.radians(tire.half_angle))
    )
    if bead <= 0:
        raise error(
            ("tire", "half_angle"),
            f"= {tire.half_angle:g} deg puts the beads at {bead:g} m from the axle:"
            " make it or minor_radius smaller",
        )
    for number, region in enumerate(tire.region):
        if region.name is not None:
            raise error(
                ("tire", "region", str(number), "name"),
                'is for section = "file": a part of a torus is told by arc, side and depth',
            )
        for key in ("arc", "depth"):
            low, high = getattr(region, key)
            if low >= high:
                raise error(
                    ("tire", "region", str(number), key), f"= [{low:g}, {high:g}] must ascend"
                )
    check_cords(tire, error)
