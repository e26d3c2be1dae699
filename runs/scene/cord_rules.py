"""What the cords of a scene must keep to: names of their own, and a place inside the wall."""

from collections.abc import Callable

from tireroad.fem.errors import InputError
from tireroad.runs.scene.tire_tables import Tire

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
        if any(other.name == cords.name for other in tire.cords[:number]):
            raise error((*place, "name"), f'= "{cords.name}" is taken: give each line its own')
        if "/" in cords.name or cords.name in (".", ".."):
            raise error(
                (*place, "name"), f'= "{cords.name}" must hold no "/": results are named so'
            )
