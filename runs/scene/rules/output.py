"""What the outputs of a scene need, and how much of them is too much."""

from collections.abc import Callable
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.cavity import has_air
from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]

MOST_FREQUENCIES = 1_000_000
MOST_SPEEDS = 10_000


def check_receptance(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    receptance = scene.output.receptance
    if receptance is None:
        return
    if not scene.force:
        raise error(("output", "receptance"), "is read at driven points: add a [[force]]")
    path = "output", "receptance", "step"
    _count(path, "frequencies", receptance.to, receptance.step, "Hz", MOST_FREQUENCIES, error)


def check_transmissibility(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """What the force on the axle per force on the tread needs."""
    wanted = scene.output.transmissibility
    if wanted is None:
        return
    path = "output", "transmissibility"
    if not scene.force:
        raise error(path, "is from driven points to the axle: add a [[force]]")
    if scene.modal.rim == "free" or scene.axle.kind != "fixed":
        raise error(
            path, 'is the force on a held axle: take modal.rim = "fixed", axle.kind = "fixed"'
        )
    if wanted.free_rim and has_air(scene):
        raise error(
            (*path, "free_rim"), "has no air in the tire: take 0, or take out [tire.cavity]"
        )
    _count((*path, "step"), "frequencies", wanted.to, wanted.step, "Hz", MOST_FREQUENCIES, error)


def check_campbell(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    campbell = scene.rotation.campbell if scene.rotation else None
    if campbell is not None:
        path = "rotation", "campbell", "step"
        _count(path, "speeds", campbell.to, campbell.step, "rad/s", MOST_SPEEDS, error)


def _count(path, what: str, to: float, step: float, unit: str, most: int, error: Where) -> None:
    """A step into a range that makes neither none nor too many."""
    if step > to:
        raise error(path, f"= {step:g} {unit} must not be more than to = {to:g} {unit}")
    if to / step > most:
        raise error(
            path,
            f"= {step:g} {unit} makes {to / step:.3g} {what} up to to = {to:g} {unit}, "
            f"more than {most}: take a larger step",
        )


def check_vibration(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """What the motion of the whole tire needs, in frequency and in time."""
    output = scene.output
    for key in ("vibration", "fields"):
        if not getattr(output, key):
            continue
        if scene.time is None or not (scene.force or scene.contact):
            raise error(
                ("output", key), "needs forces in time: add [time] with [contact] or a [[force]]"
            )
        if scene.rotation is not None and scene.rotation.speed and scene.rotation.method == "full":
            raise error(
                ("output", key), 'is seen through the modes: take rotation.method = "projected"'
            )
    if output.vibration and scene.contact is not None and not output.spectra:
        raise error(
            ("output", "vibration"), "needs output.spectra, which find the run-in and the limit"
        )
